"""A ROS graph of its own for each session: on this machine alone, in a domain that no other session has."""

import importlib.util
import os
import socket
from collections.abc import Iterator
from contextlib import suppress

import pytest

LAST_DOMAIN = 101
"""The last domain whose ports lie below those that Linux hands out."""
FIRST_PORT = 7200
"""Port by which a session claims domain 0; no test's router has one so low, and no domain's own ports begin there."""


@pytest.fixture(scope="session", autouse=True)
def domain() -> Iterator[int]:
    if importlib.util.find_spec("rclpy") is None:
        pytest.skip("rclpy is not installed here: make test-ros")
    for number in range(1, LAST_DOMAIN + 1):
        with socket.socket() as claim, suppress(OSError):
            claim.bind(("127.0.0.1", FIRST_PORT + number))
            os.environ.update(ROS_DOMAIN_ID=str(number), RMW_IMPLEMENTATION="rmw_fastrtps_cpp")
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            yield number
            return
    pytest.fail("every domain of ROS is taken")
