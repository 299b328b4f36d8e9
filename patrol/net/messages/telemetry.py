"""Messages for observers of a run: live tables, pages, recordings. No robot decides by them.

    truth/metrics        `Metrics`    the world, at most about ten times a second
    truth/events         `Notice`     the world, when something happens
    telemetry/<robot>    `Telemetry`  an agent, at most about five times a second

Each is one msgpack map by field names, so that more can be added (`patrol.wire.read`); readers skip what they do not
know.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Annotated

import msgpack
from pydantic import Field

from patrol.journal import Event, Status, TickRecord
from patrol.journal.records import MAX_TICKS
from patrol.scenario.control_words import described
from patrol.wire import FAIL_FAST, FAIL_FAST_MAP, NO_WHOLE, PRINTABLE, Flag, Text, read

METRICS = "metrics"
EVENTS = "events"
TRAPPED = "trapped"
FREE = "no longer trapped"
NOT_RECORDED = "not recorded"
"""Kinds of the notices that are no events of the journal: about a robot that makes no progress, and a full disk."""
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

_Whole = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1)]
_Number = Annotated[float, Field(strict=True, ge=-MOST, le=MOST), NO_WHOLE]
_Amount = Annotated[float, Field(strict=True, ge=0.0, le=MOST), NO_WHOLE]
_Text = Annotated[Text, Field(max_length=MAX_TEXT), PRINTABLE]
_Place = tuple[_Number, _Number]


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

    name: _Text
    status: Annotated[int, Field(strict=True, ge=min(Status), le=max(Status))]
    state: _Text
    x: _Number
    y: _Number
    heading: _Number


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
        stalest: x and y in m of the stalest place now, or None where it is not told.
    """

    k: Annotated[_Whole, Field(ge=1)]
    ticks: Annotated[_Whole, Field(le=MAX_TICKS)]
    time_s: _Amount
    mfow_s: _Amount
    mfow_mean_s: _Amount
    mfow_max_s: _Amount
    seen_share: Annotated[float, Field(strict=True, ge=0.0, le=1.0), NO_WHOLE]
    ticks_per_s: _Amount
    robots: Annotated[tuple[RobotView, ...], FAIL_FAST]
    stalest: _Place | None = None

    def __post_init__(self) -> None:
        if self.k > self.ticks:
            raise ValueError(f"{self.k} ticks are done, of {self.ticks}")


@dataclass(frozen=True, slots=True)
class Notice:
    """An event of the run.

    Attributes:
        k: It happened before this tick.
        kind: Of the event.
        robot: Its name, or empty for the whole run.
        detail: One line.
    """

    k: Annotated[int, Field(strict=True, ge=0, le=MAX_TICKS)]
    kind: _Text
    robot: _Text
    detail: _Text


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

    incarnation: _Whole
    sent: _Whole
    heard: Annotated[dict[Text, _Whole], FAIL_FAST_MAP]
    refused: _Whole
    final: Flag


@dataclass(frozen=True, slots=True)
class Telemetry:
    """A robot's decision in one tick.

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

    k: _Whole
    state: _Text
    goal: _Place | None
    refined: _Place | None
    direction: _Number | None
    mfow: _Whole
    decision_ms: _Number
    rejected: _Whole
    traffic: Traffic | None = None


@dataclass(frozen=True, slots=True)
class _WithTraffic:
    """Telemetry as the world reads it: traffic counts whatever else the robot says."""

    traffic: Traffic


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
        """Take in the next tick.

        Args:
            record: Of the tick.
            stalest: Gives x and y in m of the stalest place; asked only when metrics are due.

        Returns:
            The metrics when they are due, and after the last tick; otherwise None.
        """
        self._sum += record.mfow
        self._max = max(self._max, record.mfow)
        now = self._now()
        ticks_done = record.k + 1
        if now < self._due and ticks_done < self._ticks:
            return None
        self._due = now + SHOW_S
        return Metrics(
            k=ticks_done,
            ticks=self._ticks,
            time_s=ticks_done * self._step,
            mfow_s=record.mfow * self._step,
            mfow_mean_s=self._sum / ticks_done * self._step,
            mfow_max_s=self._max * self._step,
            seen_share=record.seen / self._points,
            ticks_per_s=self._rate(now, ticks_done),
            robots=tuple(
                RobotView(self._names[row.number], int(row.status), row.state, row.x, row.y, row.heading)
                for row in record.robots
            ),
            stalest=None if stalest is None else stalest(),
        )

    def notice(self, event: Event) -> Notice:
        """Make an event of the journal as observers receive it.

        Args:
            event: Of the journal.
        """
        name = "" if event.robot is None else self._names[event.robot]
        return Notice(event.k, event.kind, name, described(event)[:MAX_TEXT])

    def _rate(self, now: float, done: int) -> float:
        """Return the ticks per wall second over the last `_RATE_S`."""
        while len(self._shown) > 1 and self._shown[1][0] <= now - _RATE_S:
            self._shown.popleft()
        since, before = self._shown[0]
        self._shown.append((now, done))
        return (done - before) / (now - since) if now > since else 0.0


def longest_metrics(robots: int) -> int:
    """Return the bytes of the longest metrics that are read: a stranger's small objects could become many more.

    Args:
        robots: In the roster.
    """
    return min(MAX_VIEW, MAX_NOTICE + 2 * MAX_TEXT * robots)


def pack_view(view: Metrics | Notice | Telemetry) -> bytes:
    """Pack a view.

    Args:
        view: To send.
    """
    packed: bytes = msgpack.packb(asdict(view))
    return packed


def read_traffic(payload: bytes) -> Traffic:
    """Read the traffic in a robot's telemetry.

    Args:
        payload: Any bytes.

    Raises:
        Malformed: For anything else, and without traffic.
    """
    return read(_WithTraffic, payload).traffic
