"""MCAP files.

container           one file: channels, and messages in the order of their log times
container_records   layout of the container's records
summary_section     what a file says of itself at its end, wherever that stands
places              where records are, over damage
recovery            chunks and channels of a file that is damaged or was cut short
chunks              unpacking chunks; what is left of a damaged one is salvaged
frames              what damaged zstd and lz4 frames give before the fault
reader              the messages of a log as records of mapcli
pose_reader         the poses on a topic as a trajectory
writer              records of mapcli as a log; replay_writer: the result of a replay
"""
