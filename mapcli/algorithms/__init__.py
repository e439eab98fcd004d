"""Pure functions on records, and one stateful run per algorithm. Knows no file formats."""
