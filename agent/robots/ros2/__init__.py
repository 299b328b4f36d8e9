"""The driver of a ROS 2 robot.

Pure cores, which are told the time:

    odometer.py       which odometry can be believed
    localisation.py   from odometry and a correction of its drift to where the robot is now
    commands.py       from commands of ours to velocities in the body's frame
    fence.py          how fast a command may be obeyed so that the body can still stop on the ground
    others.py         where the other robots will be in a moment
    governor.py       what the robot is told next: limits, fence, stops
    stops.py          who has told the robot to stop, and has not released it

What connects them to a robot:

    hardware.py       what the robot says of itself, its time, and who stops it
    steering.py       how it is moved: by velocities, or by goals for its Nav2
    driver.py         the mind's body, and the thread that drives
    shown.py          map, fog and path, for whoever looks on
    robot_map.py      the map that the robot has
    settings.py       topics, kinds of commands, limits
    options.py        the same on a command line
"""
