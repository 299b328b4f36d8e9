"""The pose of a ROS 2 robot, by its odometry and what corrects it."""
