"""Robot logs: `open_log` finds the format, and one reader per format gives records.

log            base class of all readers: choice of topics, order of stamps, damage
carmen         CARMEN logs; their grammar is in carmen_messages
message_clock, clock_faults, line_clock    when records are from, where stamps do not tell
mcap/          MCAP container: reader, recovery of damaged files, writer
ros/           ROS messages (CDR, JSON) and transforms
blocks, rep117, topics     used by every reader: gzip and lines, ranges, choice of topics
"""
