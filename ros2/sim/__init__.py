"""Simulated ROS 2 robots: a process that talks like robots over Zenoh, and moves bodies in our own world.

From the bottom up:

    odometry.py    what a robot takes itself to have driven, with noise and drift
    bodies.py      what moves the bodies: our own motion, or another program's
    robot.py       one robot: its body, its commands and its watchdog
    nav2.py        what stands for its Nav2: a way to a goal
    node.py        what it says and hears on its topics
    simulation.py  all of them on one terrain, step by step, and what is measured
    process.py     the process; `options.py` has its command line
"""
