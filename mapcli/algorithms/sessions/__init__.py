"""Several drives through one building: joined, refined together, one map."""
