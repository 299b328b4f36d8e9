"""What observers of a run receive: live tables, pages, recordings. Nothing that decides anything reads it.

    truth/metrics        `Metrics`    the world, at most about ten times a second
    truth/events         `Notice`     the world, when something happens
    telemetry/<robot>    `Telemetry`  an agent, at most about five times a second

Each is one msgpack map by field names, so that more can be added; readers skip what they do not know.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import msgpack

from patrol.journal import Event, Status, TickRecord
from patrol.journal.records import MAX_TICKS
from patrol.scenario.control_words import described

METRICS = "metrics"
EVENTS = "events"
TRAPPED = "trapped"
FREE = "no longer trapped"
"""Kinds of the notices about a robot that makes no progress; they are no events of the journal."""
SHOW_S = 0.1
"""Wall time between two metrics."""
MAX_VIEW = 1 << 22
"""Bytes of the longest view that a reader looks at: a fleet of tens of thousands."""

MAX_NOTICE = 1 << 13
"""Bytes of the longest notice."""

_RATE_S = 3.0
MAX_TEXT = 500
"""Characters of the longest text in a view."""
MOST = 1e12
"""The greatest number in a view, either sign: far beyond any place, time or rate, and of few digits."""
_STATUSES = frozenset(int(status) for status in Status)


class Unreadable(ValueError):
    """Bytes that are none of these views."""


@dataclass(frozen=True, slots=True)
class RobotView:
    """One robot.

    Attributes:
        name: Of the robot.
        status: a `patrol.journal.Status`.
        state: What its mind reports that it is doing.
        x: m, of its true pose.
        y: m, of the same.
        heading: rad, of the same.
    """

    name: str
    status: int
    state: str
    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Metrics:
    """The run so far.

    Attributes:
        k: Ticks done.
        ticks: Of the whole run.
        time_s: Simulated.
        mfow_s: Now.
        mfow_mean_s: Over all ticks.
        mfow_max_s: Over all ticks.
        seen_share: Of the patrolled area.
        ticks_per_s: By the wall clock, over the last seconds.
        robots: In roster order.
        stalest: x and y in m of the stalest place now, or None where nobody says.
    """

    k: int
    ticks: int
    time_s: float
    mfow_s: float
    mfow_mean_s: float
    mfow_max_s: float
    seen_share: float
    ticks_per_s: float
    robots: tuple[RobotView, ...]
    stalest: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Notice:
    """An event of the run.

    Attributes:
        k: It happened before this tick.
        kind: Of the event.
        robot: Its name, or empty for the whole run.
        detail: One line.
    """

    k: int
    kind: str
    robot: str
    detail: str


@dataclass(frozen=True, slots=True)
class Traffic:
    """Frames that one process of a robot has sent and heard by direct radio so far.

    Attributes:
        incarnation: Which of the robot's processes.
        sent: Frames.
        heard: Frames by the sender's name.
        refused: Frames dropped unread.
        final: Whether this process is about to leave.
    """

    incarnation: int
    sent: int
    heard: Mapping[str, int]
    refused: int
    final: bool


@dataclass(frozen=True, slots=True)
class Telemetry:
    """What a robot decided in one tick.

    Attributes:
        k: The tick.
        state: What it is doing.
        goal: m, before refinement.
        refined: m, after refinement.
        direction: rad, or None.
        mfow: Believed, ticks.
        decision_ms: Wall time.
        rejected: Frames so far.
        traffic: Of a direct radio, or None.
    """

    k: int
    state: str
    goal: tuple[float, float] | None
    refined: tuple[float, float] | None
    direction: float | None
    mfow: int
    decision_ms: float
    rejected: int
    traffic: Traffic | None = None


class Watcher:
    """Turns tick records into metrics, at most one each `SHOW_S` of wall time.

    Args:
        names: By robot number.
        points: Of the patrolled area.
        step: s.
        ticks: Of the whole run.
        now: Wall clock, s.
    """

    def __init__(
        self, names: Mapping[int, str], points: int, step: float, ticks: int, now: Callable[[], float]
    ) -> None:
        self._names = names
        self._points = max(points, 1)
        self._step = step
        self._ticks = ticks
        self._now = now
        self._sum = 0
        self._max = 0
        self._due = 0.0
        self._shown: deque[tuple[float, int]] = deque([(now(), 0)])

    def take(self, record: TickRecord, stalest: Callable[[], tuple[float, float]] | None = None) -> Metrics | None:
        """The next tick is done.

        Args:
            record: Of the tick.
            stalest: Gives x and y in m of the stalest place; asked only when metrics are due.

        Returns:
            The metrics when they are due, and after the last tick; otherwise None.
        """
        self._sum += record.mfow
        self._max = max(self._max, record.mfow)
        now = self._now()
        done = record.k + 1
        if now < self._due and done < self._ticks:
            return None
        self._due = now + SHOW_S
        return Metrics(
            k=done,
            ticks=self._ticks,
            time_s=done * self._step,
            mfow_s=record.mfow * self._step,
            mfow_mean_s=self._sum / done * self._step,
            mfow_max_s=self._max * self._step,
            seen_share=record.seen / self._points,
            ticks_per_s=self._rate(now, done),
            robots=tuple(
                RobotView(self._names[row.number], int(row.status), row.state, row.x, row.y, row.heading)
                for row in record.robots
            ),
            stalest=None if stalest is None else stalest(),
        )

    def notice(self, event: Event) -> Notice:
        """An event of the journal as observers receive it.

        Args:
            event: Of the journal.
        """
        name = "" if event.robot is None else self._names[event.robot]
        return Notice(event.k, event.kind, name, described(event)[:MAX_TEXT])

    def _rate(self, now: float, done: int) -> float:
        """Ticks per wall second over the last `_RATE_S`."""
        while len(self._shown) > 1 and self._shown[1][0] <= now - _RATE_S:
            self._shown.popleft()
        since, before = self._shown[0]
        self._shown.append((now, done))
        return (done - before) / (now - since) if now > since else 0.0


def longest_metrics(robots: int) -> int:
    """Bytes of the longest metrics that a reader looks at: many more would be made of a stranger's small objects.

    Args:
        robots: In the roster.
    """
    return min(MAX_VIEW, MAX_NOTICE + 2 * MAX_TEXT * robots)


def pack_view(view: Metrics | Notice | Telemetry) -> bytes:
    """A view as bytes.

    Args:
        view: To send.
    """
    packed: bytes = msgpack.packb(asdict(view))
    return packed


def read_metrics(payload: bytes) -> Metrics:
    """The metrics in a payload.

    Args:
        payload: Any bytes.

    Raises:
        Unreadable: For anything else.
    """
    says = _map(payload)
    robots = says.get("robots")
    if type(robots) is not list:
        raise Unreadable("no robots")
    k, ticks = _whole(says, "k"), _whole(says, "ticks")
    if not 1 <= k <= ticks <= MAX_TICKS:
        raise Unreadable("ticks done are from 1 to those of the run")
    return Metrics(
        k=k,
        ticks=ticks,
        time_s=_amount(says, "time_s"),
        mfow_s=_amount(says, "mfow_s"),
        mfow_mean_s=_amount(says, "mfow_mean_s"),
        mfow_max_s=_amount(says, "mfow_max_s"),
        seen_share=_amount(says, "seen_share", 1.0),
        ticks_per_s=_amount(says, "ticks_per_s"),
        robots=tuple(map(_robot, robots)),
        stalest=_place(says, "stalest"),
    )


def read_notice(payload: bytes) -> Notice:
    """The notice in a payload.

    Args:
        payload: Any bytes.

    Raises:
        Unreadable: For anything else.
    """
    says = _map(payload)
    k = _whole(says, "k")
    if k > MAX_TICKS:
        raise Unreadable("later than any run")
    return Notice(k, _text(says, "kind"), _text(says, "robot"), _text(says, "detail"))


def read_traffic(payload: bytes) -> Traffic:
    """The traffic in a robot's telemetry.

    Args:
        payload: Any bytes.

    Raises:
        Unreadable: For anything else.
    """
    says = _map(payload).get("traffic")
    if type(says) is not dict:
        raise Unreadable("no traffic")
    heard = says.get("heard")
    if type(heard) is not dict or type(says.get("final")) is not bool:
        raise Unreadable("no counts")
    return Traffic(
        incarnation=_whole(says, "incarnation"),
        sent=_whole(says, "sent"),
        heard={sender: _whole(heard, sender) for sender in heard},
        refused=_whole(says, "refused"),
        final=says["final"],
    )


def read_telemetry(payload: bytes) -> Telemetry:
    """What a robot decided, without its traffic.

    Args:
        payload: Any bytes.

    Raises:
        Unreadable: For anything else.
    """
    says = _map(payload)
    direction = says.get("direction")
    return Telemetry(
        k=_whole(says, "k"),
        state=_text(says, "state"),
        goal=_place(says, "goal"),
        refined=_place(says, "refined"),
        direction=None if direction is None else _number(says, "direction"),
        mfow=_whole(says, "mfow"),
        decision_ms=_number(says, "decision_ms"),
        rejected=_whole(says, "rejected"),
    )


def _place(says: Mapping[str, Any], field: str) -> tuple[float, float] | None:
    place = says.get(field)
    if place is None:
        return None
    if type(place) is not list or len(place) != 2:
        raise Unreadable(f"{field} is not a place")
    x, y = (_number({field: value}, field) for value in place)
    return x, y


def _robot(says: object) -> RobotView:
    if type(says) is not dict:
        raise Unreadable("a robot is a map")
    status = _whole(says, "status")
    if status not in _STATUSES:
        raise Unreadable("unknown status")
    return RobotView(
        name=_text(says, "name"),
        status=status,
        state=_text(says, "state"),
        x=_number(says, "x"),
        y=_number(says, "y"),
        heading=_number(says, "heading"),
    )


def _map(payload: bytes) -> dict[str, Any]:
    try:
        says = msgpack.unpackb(payload, raw=False, strict_map_key=True)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        raise Unreadable(f"not msgpack ({type(error).__name__})") from None
    if type(says) is not dict:
        raise Unreadable("not a map")
    return says


def _whole(says: Mapping[str, Any], field: str) -> int:
    value = says.get(field)
    if type(value) is not int or not 0 <= value < 2**63:
        raise Unreadable(f"{field} is not a whole number")
    return value


def _number(says: Mapping[str, Any], field: str) -> float:
    value = says.get(field)
    if type(value) is not float or not abs(value) <= MOST:
        raise Unreadable(f"{field} is not a number of a sensible size")
    return value


def _amount(says: Mapping[str, Any], field: str, most: float = MOST) -> float:
    value = _number(says, field)
    if not 0.0 <= value <= most:
        raise Unreadable(f"{field} is not from 0 to {most:g}")
    return value


def _text(says: Mapping[str, Any], field: str) -> str:
    value = says.get(field)
    if type(value) is not str or len(value) > MAX_TEXT or not value.isprintable():
        raise Unreadable(f"{field} is not printable text")
    return value
