"""The stops of a ROS 2 robot, the files in which they outlive the process, and the check that the robot stands."""
