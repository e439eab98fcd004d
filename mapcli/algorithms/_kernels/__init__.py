"""The numba loops, and nothing else; each has a slow, obvious twin in the tests."""
