"""How far a trace is from the truth, and what is odd about a log."""
