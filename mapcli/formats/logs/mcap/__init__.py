"""MCAP files: reading, salvaging what is damaged, writing."""
