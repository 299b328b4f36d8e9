#!/usr/bin/env python3
"""A small bridge between ROS 2 over DDS on this machine and a Zenoh router, in the format of zenoh-bridge-ros2dds.

    export ROS_DOMAIN_ID=5
    build/ros-venv/bin/python deploy/ros/relay.py --connect tcp/127.0.0.1:7447 --topics '/robot1/.*|/tf.*'
    fogwatch doctor --connect tcp/127.0.0.1:7447 --namespace robot1

Once a second it looks at the ROS graph. What other nodes publish goes to Zenoh, under the topic's name without its
first slash; what they subscribe to comes from there. Messages pass as the bytes that they are. Each topic is shown on
Zenoh by a liveliness token, so that `fogwatch doctor` sees who publishes and who obeys.

It carries no services and so no actions; for them, and for cameras, use zenoh-bridge-ros2dds itself. It needs
eclipse-zenoh, rclpy 9.1.1 or newer (Kilted), which says who has sent a message, and of each type the Python package: a
topic whose package is missing is named and left out.

Exit codes: 2 bad input, or no router; 130 interrupted.
"""

from __future__ import annotations

import argparse
import importlib
import json
import re
import signal
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any

BAD_INPUT, INTERRUPTED = 2, 130
NAME = "fogwatch_relay"
LOOK_S, HEED_S = 1.0, 0.2
DEPTH = 10
OWN_OF_ROS = re.compile(r"/(rosout|parameter_events)|.*/_.*")
"""Topics that every node has, and hidden ones."""


@dataclass(frozen=True)
class Route:
    """A topic, and the way that its messages take: MP from ROS to Zenoh, MS from Zenoh to ROS."""

    way: str
    topic: str
    type_name: str
    latched: bool
    reliable: bool

    @property
    def key(self) -> str:
        """The key of its messages on Zenoh."""
        return self.topic[1:]

    def token(self, session_id: object) -> str:
        """Return the token that zenoh-bridge-ros2dds would show for it."""
        topic, kind = self.key.replace("/", "§"), self.type_name.replace("/", "§")
        return f"@/{session_id}/@ros2_lv/{self.way}/{topic}/{kind}/:::"


class Relay:
    """Carries the messages of all topics that match."""

    def __init__(self, rclpy: Any, zenoh: Any, session: Any, wanted: re.Pattern[str]) -> None:
        self._qos, self._zenoh, self._session, self._wanted = rclpy.qos, zenoh, session, wanted
        self.node = rclpy.create_node(NAME, start_parameter_services=False)
        self._carried: dict[Route, ExitStack] = {}
        self._left_out: set[str] = set()
        self.node.create_timer(LOOK_S, self.look)

    def look(self) -> None:
        """Carry what is in the graph now, and nothing else."""
        found = {route for name, types in self.node.get_topic_names_and_types() for route in self._routes(name, types)}
        for route in self._carried.keys() - found:
            self._carried.pop(route).close()
        for route in found - self._carried.keys():
            if (kind := self._type(route.type_name)) is not None:
                self._carried[route] = self._carry(route, kind)

    def _routes(self, topic: str, types: list[str]) -> list[Route]:
        """Return the ways that a topic's messages take: none, one or both."""
        if OWN_OF_ROS.fullmatch(topic) or not self._wanted.fullmatch(topic):
            return []
        latched, reliable = self._qos.DurabilityPolicy.TRANSIENT_LOCAL, self._qos.ReliabilityPolicy.RELIABLE
        ends = {"MP": self.node.get_publishers_info_by_topic, "MS": self.node.get_subscriptions_info_by_topic}
        routes = []
        for way, infos in ends.items():
            all_profiles = [
                info.qos_profile for info in infos(topic) if info.node_name not in {NAME, "_NODE_NAME_UNKNOWN_"}
            ]
            if all_profiles:
                # A subscription hears all publishers if it asks for no more than each gives, and the other way round.
                together: Callable[[list[bool]], bool] = all if way == "MP" else any
                is_latched = together([profile.durability == latched for profile in all_profiles])
                is_reliable = together([profile.reliability == reliable for profile in all_profiles])
                routes.append(Route(way, topic, types[0], is_latched, is_reliable))
        return routes

    def _type(self, type_name: str) -> Any:
        """Return the class of a type; None, and say so once, where its package is not installed."""
        package, _, name = type_name.partition("/msg/")
        with suppress(ImportError, AttributeError):
            return getattr(importlib.import_module(f"{package}.msg"), name)
        if type_name not in self._left_out:
            self._left_out.add(type_name)
            print(f"left out: {type_name}; install the package {package}", file=sys.stderr, flush=True)
        return None

    def _is_relayed(self, topic: str, gid: bytes) -> bool:
        """Return True if a relay has published a message: it came from Zenoh, and going back it would go round."""
        ends = self.node.get_publishers_info_by_topic(topic)
        return any(end.node_name == NAME and bytes(end.endpoint_gid) == gid for end in ends)

    def _carry(self, route: Route, kind: Any) -> ExitStack:
        """Carry a topic until the stack is closed."""
        durability, reliability = self._qos.DurabilityPolicy, self._qos.ReliabilityPolicy
        profile = self._qos.QoSProfile(
            depth=DEPTH,
            durability=durability.TRANSIENT_LOCAL if route.latched else durability.VOLATILE,
            reliability=reliability.RELIABLE if route.reliable else reliability.BEST_EFFORT,
        )
        extended, session, ends = self._zenoh.ext, self._session, ExitStack()
        ends.callback(session.liveliness().declare_token(route.token(session.info.zid())).undeclare)
        # What comes from ROS stays out of this session: it would go back to ROS.
        elsewhere = self._zenoh.Locality.REMOTE
        if route.way == "MP":
            cache = extended.CacheConfig(max_samples=1) if route.latched else None
            sender = extended.declare_advanced_publisher(
                session, route.key, cache=cache, publisher_detection=route.latched, allowed_destination=elsewhere
            )
            ends.callback(sender.undeclare)

            def send(raw: bytes, info: dict[str, Any]) -> None:
                if not self._is_relayed(route.topic, bytes(info["publisher_gid"]["data"])):
                    sender.put(raw)

            heard = self.node.create_subscription(kind, route.topic, send, profile, raw=True)
            ends.callback(self.node.destroy_subscription, heard)
        else:
            told = self.node.create_publisher(kind, route.topic, profile)
            ends.callback(self.node.destroy_publisher, told)
            history = extended.HistoryConfig(detect_late_publishers=True, max_samples=1) if route.latched else None
            receiver = extended.declare_advanced_subscriber(
                session, route.key, lambda sample: told.publish(sample.payload.to_bytes()), history=history
            )
            ends.callback(receiver.undeclare)
        print(f"{'to' if route.way == 'MP' else 'from'} Zenoh: {route.topic} {route.type_name}", flush=True)
        return ends


def main() -> int:
    """Relay until interrupted; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--connect", required=True, metavar="LOCATOR", help="the Zenoh router, tcp/HOST:7447")
    parser.add_argument("--topics", default=".*", metavar="REGEX", help="carry these, by full name (default: all)")
    parser.add_argument("--wait", type=float, default=60.0, metavar="S", help="for the router (default: %(default)g s)")
    options = parser.parse_args()
    try:
        wanted = re.compile(options.topics)
        rclpy: Any = importlib.import_module("rclpy")
        zenoh: Any = importlib.import_module("zenoh")
        for module in ("rclpy.executors", "rclpy.qos", "rclpy.signals", "zenoh.ext"):
            importlib.import_module(module)
        config = zenoh.Config()
        for field, value in (
            ("mode", "client"),
            ("connect/endpoints", [options.connect]),
            ("connect/timeout_ms", round(1000 * options.wait)),
            ("connect/exit_on_failure", True),
            ("scouting/multicast/enabled", False),
            ("timestamping/enabled", True),
        ):
            config.insert_json5(field, json.dumps(value))
        session = zenoh.open(config)
    except re.error as error:
        print(f"--topics {options.topics}: no regular expression ({error})", file=sys.stderr)
        return BAD_INPUT
    except ImportError as error:
        print(f"{error}; make test-ros sets up an environment with both", file=sys.stderr)
        return BAD_INPUT
    except Exception as error:  # noqa: BLE001 - Zenoh's errors have no class of their own in all its versions
        print(f"--connect {options.connect}: {error}; is a Zenoh router running there?", file=sys.stderr)
        return BAD_INPUT
    leaving: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda heard, _frame: leaving.append(heard))
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    with session:
        executor = rclpy.executors.SingleThreadedExecutor()
        executor.add_node(Relay(rclpy, zenoh, session, wanted).node)
        print(f"relays to {options.connect}", flush=True)
        while not leaving:
            executor.spin_once(timeout_sec=HEED_S)
        rclpy.shutdown()
    return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
