"""The motion of a ROS 2 robot, and what prevents it: limits, the fence, a pose that does not follow."""
