"""mapcli: 2D robot mapping without ROS, after chapter 9 of *Elements of Robotics*."""

__version__ = "0.1.0"
