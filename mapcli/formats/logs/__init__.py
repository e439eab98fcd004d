"""Robot logs: one module finds the format (`open_log`), one folder or file per format reads it."""
