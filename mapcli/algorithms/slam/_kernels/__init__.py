"""The compiled inner loops of `slam`."""
