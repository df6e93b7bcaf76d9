"""The bridge between a context manager and ROS 2: topics become variables and poses, and variables become topics.

It imports the `rclpy` of the program's ROS 2; codra itself does not need ROS.
"""

from codra_dsl.integrations.ros2.bridge import Bridge, clock_of
from codra_dsl.integrations.ros2.messages import PoseTopic

__all__ = ["Bridge", "PoseTopic", "clock_of"]
