"""Sect. 9.5 and 9.6: perceptions at candidate poses, scored against a map."""
