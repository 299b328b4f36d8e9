"""Simulated ROS 2 robots: a process that talks like robots over Zenoh, and moves bodies in our own world.

odometry.py    what a robot takes itself to have driven, with noise and drift
robot.py       one robot: its body, its commands and its watchdog
node.py        what it says and hears on its topics
simulation.py  all of them on one terrain, step by step, and what is measured
process.py     the process, and its command line
"""
