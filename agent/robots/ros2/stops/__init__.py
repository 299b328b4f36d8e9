"""Who has told a ROS 2 robot to stop, how that outlives the process, and whether the robot stands."""
