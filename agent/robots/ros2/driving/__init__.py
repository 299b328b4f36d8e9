"""How a ROS 2 robot is moved, and what keeps it from moving: limits, the fence, a pose that does not follow."""
