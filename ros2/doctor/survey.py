"""Looking at a robot's Zenoh router, and listening there."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ros2.robot.localisation import Source
from ros2.wire.ear import Ear, Overheard
from ros2.wire.formats import Bridge, RmwZenoh
from ros2.wire.link import RouterSays, ZenohRos2Link
from ros2.wire.names import ADMIN_SPACE, full_name

_TOKENS_S = 3.0


@dataclass(frozen=True, slots=True)
class Wanted:
    """The settings of a robot's agent, which say what a patrol needs of the robot."""

    # names other than the usual, by those (`ros2.robot.settings.TOPICS`)
    topics: Mapping[str, str] = field(default_factory=dict)
    localisation: Source = Source.TF  # what corrects the odometry
    map_frame: str = "map"
    sim_time: bool = False  # the robot's time comes from its clock topic

    def topic(self, usual: str) -> str:
        """Return the name of a topic by its usual name, relative to the robot's namespace.

        The clock's usual topic, ``/clock``, is absolute.
        """
        return self.topics.get(usual, "/clock" if usual == "clock" else usual)


@dataclass(slots=True)
class Survey:
    """All that was seen and overheard of a robot."""

    domain: int  # ROS_DOMAIN_ID
    namespace: str
    wanted: Wanted
    tokens: list[str] = field(default_factory=list)  # of both formats and every domain
    heard: dict[str, Overheard] = field(default_factory=dict)  # by key
    router: RouterSays | None = None  # what the router says of itself; None if it does not answer


def survey(link: ZenohRos2Link, domain: int, namespace: str, wanted: Wanted, seconds: float) -> Survey:
    """Look at a robot's router and listen there for some seconds; `domain` is the ROS_DOMAIN_ID."""
    ear = Ear()
    for form in (RmwZenoh(domain), Bridge()):
        for name, latched in names_of(namespace, wanted):
            link.overhear(form.heard(name), ear, latched)
    threading.Event().wait(seconds)
    # A router with access rules answers for our domain, and not for all of them.
    graphs = (RmwZenoh(domain).graph, f"{ADMIN_SPACE}/**", Bridge.graph)
    tokens = dict.fromkeys(token for graph in graphs for token in link.tokens(graph, _TOKENS_S))
    return Survey(domain, namespace, wanted, list(tokens), ear.heard, link.router(_TOKENS_S))


def names_of(namespace: str, wanted: Wanted) -> Iterator[tuple[str, bool]]:
    """Yield the full names of all topics that matter, and whether they are latched."""
    for usual, latched in (("odom", False), ("amcl_pose", True), ("cmd_vel", False)):
        yield full_name(namespace, wanted.topic(usual)), latched
    for usual, latched in (("tf", False), ("tf_static", True), ("map", True)):
        name = wanted.topic(usual)
        yield from dict.fromkeys([(full_name(namespace, name), latched), (full_name("", name), latched)])
    if wanted.sim_time:
        yield full_name(namespace, wanted.topic("clock")), False
