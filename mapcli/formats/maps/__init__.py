"""Grid maps: `load` and `dump` choose the format, one module per format reads and writes it."""
