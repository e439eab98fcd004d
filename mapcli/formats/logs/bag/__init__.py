"""ROS 1 bags: `records` finds records in a file or a chunk, `chunks` unpacks, `container` is the
`MessageFile`. Format 2.0: <http://wiki.ros.org/Bags/Format/2.0>."""
