"""ROS 2 over Zenoh alone: messages, keys and sessions of `rmw_zenoh` and of `zenoh-bridge-ros2dds`. ROS is not needed.

    messages.py      the messages that are sent and heard, in SI units and in the plane, and their fields in ROS
    definitions.py   the types of ROS and their hashes
    packing.py       values of ours to values of ROS and back, checked
    codec.py         messages of ours to bytes and back
    names.py         names, quality of service, entities and their tokens in the graph
    formats.py       the keys and attachments of the two formats
    mailbox.py       queues of received messages; what is overheard of a topic: how often, how old, the newest message
    ports.py         the operations of a link
    goals.py         the action NavigateToPose, both sides
    link.py          the link over Zenoh, the only file here that knows it
    rclpy_link.py    the link of a node of ROS itself, the only file here that knows rclpy

What needs the extra ``ros2`` imports it when a message is coded for the first time.
"""
