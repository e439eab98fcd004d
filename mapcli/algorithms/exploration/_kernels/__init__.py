"""The loops of `exploration`, compiled."""
