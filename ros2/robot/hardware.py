"""The robot's side of a link: its messages, its time, its stops, and its other drivers. Nothing here moves it.

Commands of two senders alternate unpredictably, so there must be only one.

ROS lets every node command. The graph shows which do, where the format has one; a bridge shows what it carries.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from threading import Event, Thread
from typing import Any, TypeVar

from patrol.errors import printable
from ros2.robot.localisation import Fix, Localisation
from ros2.robot.options import DriveSettings
from ros2.robot.stops import StopFiles, Stopper, Stops, StopTopic
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Bool, Clock, Odometry, PoseWithCovarianceStamped, TFMessage
from ros2.wire.names import LATCHED, SENSOR, USUAL, Entity, EntityKind, Qos, full_name
from ros2.wire.ports import Ros2Link

M = TypeVar("M")

LOOK_S = 1.0
"""Time between two looks at the graph, s."""
GRAPH_S = 2.0
"""Longest time of a look, s."""
GONE_S = 4.0
"""Time to wait, at the start, for another driver to go: a router forgets one that was cut off after 2 s."""
_AGAIN_S = 0.2
# Any node can call itself anything, and must not fill a line with that.
_LONGEST = 100
_MOST = 4


def rivals(entities: Sequence[Entity], topic: str | None, is_ours: Callable[[Entity], bool], node: str) -> list[str]:
    """Describe the other drivers of the robot.

    `topic` is the full name of the topic of its commands; None where it gets goals, which Nav2 itself turns into
    commands. `node` is the full name of our own node, which no other may have.
    """
    names = set()
    for entity in entities:
        if is_ours(entity):
            continue
        name = full_name(entity.node.namespace, entity.node.name)
        if entity.kind is EntityKind.NODE and name == node:
            names.add(f"another agent, {node}")
        elif entity.kind is EntityKind.PUBLISHER and entity.topic == topic and name != node:
            names.add(f"{printable(name[:_LONGEST]) if entity.node.name else 'somebody'} on {topic}")
    return sorted(names)[:_MOST]


class Rivals:
    """Looks for other drivers of the robot (`ros2.robot.driver.Objection`).

    `topic` is the full name of the topic of its commands; None where it gets goals, or where others may command too.
    """

    def __init__(self, link: Ros2Link, topic: str | None) -> None:
        self._link = link
        self._topic = topic
        self._node = link.resolve(link.node.name)
        self._found: list[str] = []
        self._over = Event()
        self._thread = Thread(target=self._watch_graph, name="rivals", daemon=True)

    @property
    def why(self) -> str:
        """The other drivers of the robot; empty if there are none."""
        return f"also driven by {', '.join(self._found)} (end all but one)" if self._found else ""

    def release(self) -> None:
        """Keep all drivers: an operator's word ends none."""

    def are_there(self, wait_s: float = GONE_S, stopped: Callable[[], bool] = lambda: False) -> list[str]:
        """Return the other drivers that are still there after up to `wait_s`, or once `stopped` returns True."""
        end_s = time.monotonic() + wait_s
        while self._find_rivals() and time.monotonic() < end_s and not stopped():
            self._over.wait(_AGAIN_S)
        return self._found

    def watch(self) -> Rivals:
        """Look again and again, on a thread of its own, until `close`; itself."""
        self._thread.start()
        return self

    def close(self) -> None:
        """Look no more."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()

    def _watch_graph(self) -> None:
        while not self._over.wait(LOOK_S):
            self._find_rivals()

    def _find_rivals(self) -> list[str]:
        self._found = rivals(self._link.graph(GRAPH_S), self._topic, self._link.is_ours, self._node)
        return self._found


_ROOM = 64
"""Messages that wait of a topic; more than come between two looks, of which there are 20 a second."""


class RobotTime:
    """The robot's time: the system's clock, or the clock of a simulation.

    `clock` receives the time of a simulation; None stands for the system's clock. What it said last counts for
    `fresh_s` of our time. `factor` is the seconds of the robot's time in one of ours.
    """

    def __init__(self, factor: float, clock: RosMailbox[Clock] | None, fresh_s: float) -> None:
        self._factor = factor
        self._clock = clock
        self._fresh_s = fresh_s

    def at(self, moment_s: float) -> float | None:
        """Return the robot's time at a moment of `time.monotonic`, s since its epoch; None while it is unknown."""
        if self._clock is None:
            return time.time() - (time.monotonic() - moment_s)
        newest = self._clock.newest
        if newest is None or moment_s - newest.at_s > self._fresh_s:
            return None
        return newest.message.stamp_ns / 1e9 + self._factor * (moment_s - newest.at_s)

    def now(self) -> float | None:
        """Return the robot's time now, s since its epoch."""
        return self.at(time.monotonic())


class Hardware:
    """Hears the robot.

    `factor` is the seconds of the robot's time in one of ours, 1 but for simulations. Without `stop_files`, stops end
    with this process.
    """

    def __init__(
        self,
        link: Ros2Link,
        settings: DriveSettings,
        factor: float,
        say: Callable[[str], None],
        stop_files: StopFiles | None = None,
    ) -> None:
        self.link = link
        self.settings = settings
        self.factor = factor
        self.stops = Stops(link.resolve(settings.topic("stop")), stop_files)
        self._say = say
        self._unnoted = ""
        self._mailboxes: list[RosMailbox[Any]] = []
        self._refusals: set[str] = set()
        self._localisation = Localisation(settings.localisation)
        self._stop = StopTopic(Stopper.TOPIC in self.stops, time.time_ns)
        clock: RosMailbox[Clock] | None = None
        if settings.sim_time:
            clock = self._listen_to("clock", Clock, SENSOR, RosMailbox())
        self.time = RobotTime(factor, clock, settings.localisation.fresh_s / factor)
        self._listen_to("stop", Bool, LATCHED, self._stop)
        self._tf_static = self._listen_for_transforms("tf_static", LATCHED)
        self._tf = self._listen_for_transforms("tf", USUAL)
        self._poses = self._listen_to("amcl_pose", PoseWithCovarianceStamped, LATCHED, RosMailbox(_ROOM))
        self._odometry = self._listen_to("odom", Odometry, SENSOR, RosMailbox(_ROOM))

    def _listen_to(self, usual: str, kind: type[M], qos: Qos, mailbox: RosMailbox[M]) -> RosMailbox[M]:
        self.link.subscribe(self.settings.topic(usual), kind, mailbox, qos)
        self._mailboxes.append(mailbox)
        return mailbox

    def _listen_for_transforms(self, usual: str, qos: Qos) -> tuple[RosMailbox[TFMessage], RosMailbox[TFMessage]]:
        """Return the transforms in the robot's own namespace, and those outside of every namespace.

        ROS says them outside, unless a launch file moves them into the robot's namespace.
        """
        inside: RosMailbox[TFMessage] = self._listen_to(usual, TFMessage, qos, RosMailbox(_ROOM))
        outside: RosMailbox[TFMessage] = RosMailbox(_ROOM)
        if self.settings.topic(usual) == usual and self.link.resolve(usual) != f"/{usual}":
            self.link.subscribe(f"/{usual}", TFMessage, outside, qos)
            self._mailboxes.append(outside)
        return inside, outside

    @property
    def why(self) -> str:
        """The reason why the robot's pose is unknown, in one line; empty if it is known."""
        if self.time.now() is None:
            return f"no time on {self.settings.topic('clock')}; leave --use-sim-time out, or start the simulation"
        refused = [*self._odometry.said.values(), *self._tf[0].said.values(), *self._poses.said.values()]
        reason = self._localisation.why
        return f"{reason} ({refused[0]})" if reason and refused else reason

    def fix(self) -> Fix | None:
        """Locate the robot now, by the messages that have arrived; None if unknown. From one thread at a time."""
        self._heed_stops()
        now_s = self.time.now()
        if now_s is None:
            return None
        while (odometry := self._odometry.take()) is not None:
            self._localisation.odometry(odometry.message, self._arrival_time_s(odometry.at_s, now_s), odometry.sender)
        for (inside, outside), fixed in ((self._tf_static, True), (self._tf, False)):
            # Outside they count only while there are none inside: other robots may use the same names there.
            mailbox = inside if inside.received else outside
            while (transforms := mailbox.take()) is not None:
                self._localisation.transforms(
                    transforms.message, self._arrival_time_s(transforms.at_s, now_s), fixed=fixed
                )
        while (pose := self._poses.take()) is not None:
            self._localisation.localised(pose.message, self._arrival_time_s(pose.at_s, now_s))
        return self._localisation.at(now_s)

    @property
    def odometry_age_s(self) -> float | None:
        """The age of the newest odometry, s of ours; None before the first. From any thread."""
        newest = self._odometry.newest
        return None if newest is None else time.monotonic() - newest.at_s

    @property
    def correction_age_s(self) -> float | None:
        """The age of what corrects the odometry, s of the robot's time; None while unknown. From any thread."""
        now_s = self.time.now()
        return None if now_s is None else self._localisation.correction_age_s(now_s)

    @property
    def refused(self) -> dict[str, float]:
        """Counts of the robot's messages that could not be used, by reason. From any thread."""
        return dict(sum((Counter(mailbox.refused) for mailbox in self._mailboxes), Counter[str]()))

    def stamp_ns(self) -> int:
        """Return the stamp of a message that is sent now; 0 while the time is unknown."""
        now_s = self.time.now()
        return 0 if now_s is None else max(0, int(now_s * 1e9))

    def _arrival_time_s(self, at_s: float, now_s: float) -> float:
        """Return the arrival time of a message, s of the robot's time."""
        then_s = self.time.at(at_s)
        return now_s if then_s is None else min(then_s, now_s)

    def _heed_stops(self) -> None:
        for line in [line for mailbox in self._mailboxes for line in list(mailbox.said.values())]:
            if line not in self._refusals:
                self._refusals.add(line)
                self._say(f"refused: {line}")
        stopped, holds, ignored = self._stop.heed()
        source = self.stops.name(Stopper.TOPIC)
        if stopped and self.stops.hold(Stopper.TOPIC):
            self._say(f"stopped by {source}")
        if not holds and self.stops.release(Stopper.TOPIC):
            self._say(f"released by {source}")
        if (error := self.stops.error) != self._unnoted:
            self._unnoted = error
            if error:
                self._say(f"stops are not noted: {error}")
        if ignored:
            self._say(f"still stopped by {source}: {ignored}")
