"""MCAP files.

container           one file: channels, and messages in the order of their log times
container_records   layout of the container's records
chunks              unpacking chunks; what is left of a damaged one is salvaged
recovery            finding the records of a file that is damaged or was cut short
reader              the messages of a log as records of mapcli
pose_reader         the poses on a topic as a trajectory
writer              records of mapcli as a log; replay_writer: the result of a replay
"""
