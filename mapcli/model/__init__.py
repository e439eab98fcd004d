"""Plain frozen records and their arithmetic: no files, no search, nothing but numpy."""
