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
from patrol.scenario.controls import described
from patrol.wire import FAIL_FAST, FAIL_FAST_MAP, NO_WHOLE, PRINTABLE, Flag, Text, read

METRICS = "metrics"
EVENTS = "events"
TRAPPED = "trapped"
FREE = "no longer trapped"
NOT_RECORDED = "not recorded"
WAITS = "world waits"
"""Kinds of the notices that are no events of the journal: about a robot that makes no progress, a full disk, and robots
that the world waits for."""
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
_Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0), NO_WHOLE]
_Text = Annotated[Text, Field(max_length=MAX_TEXT), PRINTABLE]
_Place = tuple[_Number, _Number]


@dataclass(frozen=True, slots=True)
class RobotView:
    """One robot."""

    name: _Text
    status: Annotated[int, Field(strict=True, ge=min(Status), le=max(Status))]  # a `patrol.journal.Status`
    state: _Text  # as its mind reports it
    x: _Number  # m, true
    y: _Number  # m, true
    heading: _Number  # rad, true


@dataclass(frozen=True, slots=True)
class Metrics:
    """The run so far."""

    k: Annotated[_Whole, Field(ge=1)]  # ticks done
    ticks: Annotated[_Whole, Field(le=MAX_TICKS)]  # of the whole run
    time_s: _Amount  # simulated
    mfow_s: _Amount  # now
    mfow_mean_s: _Amount  # over all ticks
    mfow_max_s: _Amount  # over all ticks
    seen_share: _Share  # of the patrolled area
    ticks_per_s: _Amount  # by the wall clock, over the last seconds
    robots: Annotated[tuple[RobotView, ...], FAIL_FAST]  # in roster order
    stalest: _Place | None = None  # x and y of the stalest place now, m; None where it is not told

    def __post_init__(self) -> None:
        if self.k > self.ticks:
            raise ValueError(f"{self.k} ticks are done, of {self.ticks}")


@dataclass(frozen=True, slots=True)
class Notice:
    """An event of the run."""

    k: Annotated[int, Field(strict=True, ge=0, le=MAX_TICKS)]  # the tick before which it happened
    kind: _Text
    robot: _Text  # its name, empty for the whole run
    detail: _Text  # one line


@dataclass(frozen=True, slots=True)
class Traffic:
    """Frames that one process of a robot has sent and heard by direct radio so far."""

    incarnation: _Whole  # of the process
    sent: _Whole
    heard: Annotated[dict[Text, _Whole], FAIL_FAST_MAP]  # frames by the sender's name
    refused: _Whole  # frames dropped unread
    final: Flag  # this process is about to leave


@dataclass(frozen=True, slots=True)
class Telemetry:
    """A robot's decision in one tick."""

    k: _Whole
    state: _Text
    goal: _Place | None  # x and y before refinement, m
    refined: _Place | None  # x and y after refinement, m
    direction: _Number | None  # rad
    mfow: _Whole  # as the robot believes, ticks
    decision_ms: _Number  # wall time
    rejected: _Whole  # frames so far
    traffic: Traffic | None = None  # of a direct radio
    stopped: _Text = ""  # why the robot may not drive, and what ends that; empty if it may
    charge: _Share | None = None  # share of its battery's capacity that is left; None without a battery


@dataclass(frozen=True, slots=True)
class _WithTraffic:
    """Telemetry as the world reads it: traffic counts whatever else the robot says."""

    traffic: Traffic


class Watcher:
    """Turns tick records into metrics, at most one each `SHOW_S` of wall time.

    `points` is the number of points of the patrolled area, `step` the length of a tick in s, and `now` a wall clock in
    s.
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
        """Take in the next tick; return the metrics when they are due and after the last tick, otherwise None.

        `stalest` gives x and y in m of the stalest place. It is called only when metrics are due.
        """
        self._sum += record.mfow
        # Each tick counts, whether or not its metrics are shown.
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
            ticks_per_s=self._tick_rate(now, ticks_done),
            robots=tuple(
                RobotView(self._names[row.number], int(row.status), row.state, row.x, row.y, row.heading)
                for row in record.robots
            ),
            stalest=None if stalest is None else stalest(),
        )

    def notice(self, event: Event) -> Notice:
        """Make an event of the journal as observers receive it."""
        name = "" if event.robot is None else self._names[event.robot]
        return Notice(event.k, event.kind, name, described(event)[:MAX_TEXT])

    def _tick_rate(self, now: float, done: int) -> float:
        """Return the ticks per wall second over the last `_RATE_S`."""
        # One entry from before the window stays, so that the rate spans all of it.
        while len(self._shown) > 1 and self._shown[1][0] <= now - _RATE_S:
            self._shown.popleft()
        since, before = self._shown[0]
        self._shown.append((now, done))
        return (done - before) / (now - since) if now > since else 0.0


def longest_metrics(robots: int) -> int:
    """Return the length in bytes of the longest metrics that are read, for a roster of `robots`.

    The limit bounds the memory that a stranger's small objects could take.

    For example, 18,192 bytes for 10 robots.
    """
    return min(MAX_VIEW, MAX_NOTICE + 2 * MAX_TEXT * robots)


def pack_view(view: Metrics | Notice | Telemetry) -> bytes:
    """Pack a view."""
    # Without a stop, what is sent is as it always was.
    fields = {
        name: value for name, value in asdict(view).items() if (name, value) not in (("stopped", ""), ("charge", None))
    }
    packed: bytes = msgpack.packb(fields)
    return packed


def read_traffic(payload: bytes) -> Traffic:
    """Read the traffic in a robot's telemetry; telemetry without traffic is `Malformed`."""
    return read(_WithTraffic, payload).traffic
