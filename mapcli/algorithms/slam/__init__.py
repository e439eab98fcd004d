"""Algorithm 9.2 (`slam`) and what makes it work on real logs."""
