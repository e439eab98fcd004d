"""Logs of educational robots: CSV with a YAML beside it that says where the sensors sit."""
