"""Looking at a robot's Zenoh router, and listening there."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

from patrol.ros2.ear import Ear, Overheard
from patrol.ros2.formats import Bridge, RmwZenoh
from patrol.ros2.link import ZenohRos2Link
from patrol.ros2.names import ADMIN_SPACE, full_name

_TOKENS_S = 3.0


@dataclass(frozen=True, slots=True)
class Wanted:
    """Names of the topics that a patrol uses, relative to the robot's namespace."""

    odometry: str = "odom"
    pose: str = "amcl_pose"
    command: str = "cmd_vel"
    map: str = "map"
    action: str = "navigate_to_pose"


@dataclass(slots=True)
class Survey:
    """What was seen and overheard.

    Attributes:
        domain: The ROS_DOMAIN_ID that was looked into.
        namespace: The robot's namespace.
        wanted: The topics' names.
        tokens: All tokens of both formats, of every domain.
        heard: What was overheard, by key.
    """

    domain: int
    namespace: str
    wanted: Wanted
    tokens: list[str] = field(default_factory=list)
    heard: dict[str, Overheard] = field(default_factory=dict)


def survey(link: ZenohRos2Link, domain: int, namespace: str, wanted: Wanted, seconds: float) -> Survey:
    """Look and listen.

    Args:
        link: A link to the robot's router.
        domain: The ROS_DOMAIN_ID.
        namespace: The robot's namespace.
        wanted: The topics' names.
        seconds: How long to listen.
    """
    ear = Ear()
    for form in (RmwZenoh(domain), Bridge()):
        for name, latched in names_of(namespace, wanted):
            link.overhear(form.heard(name), ear, latched)
    threading.Event().wait(seconds)
    # A router with access rules answers for our domain, and not for all of them.
    graphs = (RmwZenoh(domain).graph, f"{ADMIN_SPACE}/**", Bridge.graph)
    tokens = dict.fromkeys(token for graph in graphs for token in link.tokens(graph, _TOKENS_S))
    return Survey(domain, namespace, wanted, list(tokens), ear.heard)


def names_of(namespace: str, wanted: Wanted) -> Iterator[tuple[str, bool]]:
    """The full names of all topics that matter, and whether they are latched."""
    for name in (wanted.odometry, wanted.pose, wanted.command):
        yield full_name(namespace, name), False
    for name, latched in (("tf", False), ("tf_static", True), (wanted.map, True)):
        yield from dict.fromkeys([(full_name(namespace, name), latched), (full_name("", name), latched)])
