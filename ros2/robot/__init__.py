"""The driver of a ROS 2 robot.

Where it is (`pose`; told the time, without links):

    pose/odometer.py      which odometry can be believed
    pose/initial.py       where it stands at first, and how its localisation is told
    pose/localisation.py  from odometry and a correction of its drift to where the robot is now

How it is moved (`driving`; all but steering.py is told the time and has no links):

    driving/commands.py   from commands of ours to velocities in the body's frame
    driving/fence.py      how fast a command may be obeyed so that the body can still stop on the ground
    driving/others.py     where the other robots will be in a moment
    driving/governor.py   what the robot is told next: limits, fence, stops
    driving/response.py   whether its pose follows
    driving/steering.py   by velocities, or by goals for its Nav2

How it is stopped (`stops`):

    stops/stops.py        who has told the robot to stop, and has not released it
    stops/topic.py        by a message
    stops/files.py        stops that outlive the process
    stops/standing.py     whether the robot stands

What connects them:

    hardware.py           what the robot says of itself, its time, and who stops it
    driver.py             the mind's body, and the thread that drives
    rivals.py             who else drives the robot
    shown.py              map, fog and path, for viewers
    diagnostics.py        how patrol and robot do, for the robot's own tools
    robot_map.py          the map that the robot has
    settings.py           topics, kinds of commands, limits
    options.py            the same on a command line
"""
