"""Survey of a ROS 2 robot on its Zenoh router: its topics, and whether a patrol could start on it.

survey.py    look and listen
topics.py    what comes on the topics that matter
examine.py   what follows from it
"""
