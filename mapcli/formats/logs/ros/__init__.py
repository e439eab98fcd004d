"""ROS messages, whatever container they come in: decoding, transforms, laser scans."""
