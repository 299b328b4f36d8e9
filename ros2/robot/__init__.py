"""The driver of a ROS 2 robot.

Where it is (told the time, without links):

    odometer.py      which odometry can be believed
    initial.py       where it stands at first, and how its localisation is told
    localisation.py  from odometry and a correction of its drift to where the robot is now

How it is moved (all but steering.py is told the time and has no links):

    commands.py      from commands of ours to velocities in the body's frame
    fence.py         how fast a command may be obeyed so that the body can still stop on the ground, clear of others
    governor.py      what the robot is told next: limits, fence, stops; whether its pose follows
    steering.py      by velocities, or by goals for its Nav2

How it is stopped:

    stops.py         who has told the robot to stop, and has not released it; a topic that stops it; whether it stands
    stop_files.py    stops that outlive the process

What connects them:

    process.py       the process around a mind that drives a robot
    hardware.py      what the robot says of itself, its time, who stops it, and who else drives it
    driver.py        the mind's body, and the thread that drives
    shown.py         map, fog and path, for viewers
    robot_map.py     the map that the robot has
    diagnostics.py   how patrol and robot do, for the robot's own tools
    options.py       topics, kinds of commands, limits, and these on a command line
"""
