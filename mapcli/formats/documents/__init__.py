"""What mapcli writes and reads besides maps and logs: traces, trajectories, tables, worlds."""
