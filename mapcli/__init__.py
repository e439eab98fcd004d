"""mapcli: 2D robot mapping without ROS, after chapter 9 of *Elements of Robotics*."""

from mapcli.version import __version__ as __version__
