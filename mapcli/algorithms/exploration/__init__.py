"""Algorithm 9.1 (`frontier`) and what robots need to run it on any map."""
