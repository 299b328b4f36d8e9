"""Scripted robots, and a clock that only waiting moves."""

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from patrol.exchange import Reply, Sensed
from patrol.pose import Pose, Velocity
from runtime.messages.phases import Hello, HelloReply, PhaseA, PhaseB, ReplyA, ReplyB, ToRobot, ToWorld, decode_to_robot
from runtime.messages.session import WorldRun
from runtime.net.mailbox import Presence
from runtime.security.keys import FleetKeys
from worldsim.fleet.lockstep import LockstepFleet
from worldsim.fleet.paced import PacedFleet
from worldsim.fleet.sessions import FleetConnection, Sessions

M = TypeVar("M")
KEYS = FleetKeys("f")
NAMES = {1: "r1", 2: "r2", 3: "r3"}
RUN, HASH = 9, "c" * 64
POSES = {number: Pose(float(number), 0.0, 0.0) for number in NAMES}


class Net:
    """Robots that answer at once unless told otherwise, and time that passes only while somebody waits."""

    def __init__(self, *, launched: bool = False, robots: int = 3, absent: Sequence[int] = ()) -> None:
        self.time = 1000.0
        self.refused: Counter[str] = Counter()
        self.letters: deque[tuple[float, str, Any]] = deque()
        self.sent: list[tuple[int, ToRobot]] = []
        self.delays: dict[tuple[int, int, str], float] = {}
        self.mute: set[int] = set()
        self.connected = True
        self.ending = False
        self.ended: set[int] = set()
        """Robots whose processes have ended, which only a launcher knows."""
        self.stands_still: deque[tuple[float, float]] = deque()
        """When the whole machine stands still, and for how long, s."""
        names = {number: NAMES[number] for number in range(1, robots + 1)}
        posts = {number: self.post_of(number) for number in names}
        ended = self.has_ended if launched else None
        clock = lambda: self.time  # noqa: E731
        self.wire = FleetConnection(KEYS, names, posts, self, lambda: self.connected, clock, lambda: self.ending, ended)
        self.sessions = Sessions(self.wire, WorldRun(RUN, HASH), absent)

    def has_ended(self, number: int) -> bool:
        return number in self.ended

    @property
    def waiting(self) -> int:
        return sum(due <= self.time for due, *_ in self.letters)

    def get(self, timeout_s: float = 0.0) -> tuple[str, Any] | None:
        if self.stands_still and self.stands_still[0][0] <= self.time + timeout_s:
            since, for_s = self.stands_still.popleft()
            self.letters = deque((due + for_s * (due > since), *letter) for due, *letter in self.letters)
            self.time, timeout_s = max(self.time, since) + for_s, 0.0
        due = sorted(self.letters, key=lambda letter: letter[0])
        if due and due[0][0] <= self.time + timeout_s:
            self.letters.remove(due[0])
            self.time = max(self.time, due[0][0])
            return due[0][1:]
        self.time += timeout_s
        return None

    def deliver(self, number: int, message: ToWorld, after_s: float = 0.0) -> None:
        self.letters.append((self.time + after_s, KEYS.reply(NAMES[number]), message))

    def presence(self, number: int, present: bool, after_s: float = 0.0) -> None:
        self.letters.append((self.time + after_s, KEYS.alive(NAMES[number]), Presence(present)))

    def post_of(self, number: int) -> Callable[[bytes], None]:
        def post(payload: bytes) -> None:
            message = decode_to_robot(payload)
            self.sent.append((number, message))
            if number not in self.mute:
                self.answer(number, message)

        return post

    def answer(self, number: int, message: ToRobot) -> None:
        me = (1, 70 + number, message.k, message.run)
        if isinstance(message, Hello):
            self.deliver(number, HelloReply(1, 70 + number, 0, message.run, HASH))
        elif isinstance(message, PhaseA):
            self.deliver(number, ReplyA(*me, (b"frame",)), self.delays.pop((number, message.k, "A"), 0.001))
        elif isinstance(message, PhaseB):
            reply = ReplyB(*me, Reply(Velocity(float(message.k), 0.0), "patrolling", None, 2.0, 0))
            self.deliver(number, reply, self.delays.pop((number, message.k, "B"), 0.001))
        else:
            self.presence(number, False)

    def gather(self) -> None:
        for number in NAMES:
            self.presence(number, True)
        self.sessions.gather(10.0, lambda _names, _s: None)

    def told(self, kind: type[M], number: int) -> list[M]:
        return [message for to, message in self.sent if to == number and isinstance(message, kind)]


def lockstep(deadline_s: float = 10.0, *, launched: bool = False) -> tuple[Net, LockstepFleet]:
    net = Net(launched=launched)
    net.gather()
    return net, LockstepFleet(net.sessions, deadline_s)


def paced(step_s: float = 0.5, *, launched: bool = False) -> tuple[Net, PacedFleet]:
    net = Net(launched=launched)
    net.gather()
    return net, PacedFleet(net.sessions, step_s)


def tick(fleet: LockstepFleet | PacedFleet, k: int) -> Mapping[int, Reply | None]:
    """Do both phases of a tick; the answers to the second."""
    fleet.phase_a(k, sensed(k))
    return fleet.phase_b(k, heard())


def sensed(k: int, numbers: Sequence[int] = (1, 2, 3)) -> dict[int, Sensed]:
    return {number: Sensed(k, POSES[number]) for number in numbers}


def heard(numbers: Sequence[int] = (1, 2, 3)) -> dict[int, list[bytes]]:
    return {number: [b"x"] for number in numbers}
