"""The compiled inner loops of `simulation`."""
