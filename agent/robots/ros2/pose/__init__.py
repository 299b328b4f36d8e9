"""Where a ROS 2 robot is, by its odometry and what corrects it."""
