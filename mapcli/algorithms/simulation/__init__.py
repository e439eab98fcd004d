"""Robots that do not exist, and the logs that they leave."""
