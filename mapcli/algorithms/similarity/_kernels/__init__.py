"""The compiled inner loops of `similarity`."""
