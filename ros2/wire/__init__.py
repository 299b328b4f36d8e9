"""ROS 2 over Zenoh alone: messages, keys and sessions of `rmw_zenoh` and of `zenoh-bridge-ros2dds`. ROS is not needed.

    messages.py      what we say and hear, in SI units and in the plane
    definitions.py   their fields in ROS, their type hashes
    packing.py       messages of ours to messages of ROS and back, checked
    codec.py         messages of ours to bytes and back
    names.py         names, quality of service, entities and their tokens in the graph
    formats.py       the keys and attachments of the two formats
    mailbox.py       where what was received waits
    ear.py           what is overheard of a topic: how often, how old, the newest message
    ports.py         what a link can do
    goals.py         the action NavigateToPose, both sides
    link.py          the link over Zenoh, the only file here that knows it
    rclpy_link.py    the link of a node of ROS itself, the only file here that knows rclpy

What needs the extra ``ros2`` imports it when a message is coded for the first time.
"""
