"""The interface between a page and what it shows: a running fleet, or a run that is played back; and its tick rate.

One thread reads a source (`wait`, `last_seen`, `series`, `events`); reading never slows the fleet. Any thread may call
`control`. Arrays that a source returns belong to the source: read them before the next `wait`, and never write to them.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from patrol.ground.terrain import Terrain
    from patrol.journal.records import Event, Status
    from patrol.pose import Pose
    from patrol.scenario import Scenario
    from patrol.scenario.marks import Looks


Layer = Literal["truth", "heard"] | int
"""A fog: the true one, the one that follows from every position sent, or the one that a robot (by number) believes."""

OUTSIDE = -2
"""Replaces a last-seen tick where the fleet patrols the point, but the robot whose fog this is does not."""


@dataclass(frozen=True, slots=True)
class RobotShape:
    """The constant properties of a robot."""

    number: int
    name: str
    model: str
    radius: float  # of the body, m
    range: float  # of its sensor, m
    angle: float  # field of view of its sensor, degrees
    spare: bool = False  # takes part only once an operator or a fault lets it join

    @classmethod
    def all_of(cls, scenario: Scenario) -> tuple[RobotShape, ...]:
        """Return the properties of a scenario's robots."""
        seen = scenario.sensor.range, scenario.sensor.angle
        return tuple(
            cls(spec.number, spec.name, spec.model, spec.radius, *seen, spec.spare) for spec in scenario.roster
        )


@dataclass(frozen=True, eq=False)
class Static:
    """The constant properties of a source."""

    name: str
    scenario: Mapping[str, Any]
    terrain: Terrain
    patrolled: NDArray[np.bool_]  # (h, w), row 0 at the lowest y
    robots: tuple[RobotShape, ...]
    step: float  # s
    ticks: int | None  # of the whole run; None when unknown
    bound_s: float | None  # lower bound of MFoW; None when unknown
    live: bool  # the fleet is running now
    layers: tuple[Layer, ...]  # those that `Source.last_seen` knows, the default one first
    controls: tuple[str, ...] = ()  # accepted by `Source.control`, by the value of "do"
    note: str = ""  # for the viewer, such as what is missing
    # robots hear each other directly (`radio.via`): only they know deliveries, so no links and no beliefs
    direct: bool = False
    late: int = 0  # ticks by which a fog may be older than the state and still be shown, as of its own tick

    @property
    def has_truth(self) -> bool:
        """True if the true fog and the true poses are known."""
        return "truth" in self.layers


@dataclass(frozen=True, slots=True)
class Trapped:
    """The time since which a robot has been trapped (`patrol.measures.progress`)."""

    since_s: float  # when its stay began
    exact: bool = True  # its stay began then; otherwise before, and this is the first time that is known


@dataclass(frozen=True, slots=True)
class RobotState:
    """The state of one robot."""

    number: int
    status: Status  # LOST where only positions are known and none has arrived for long
    state: str = ""  # as its mind reports; empty without a report
    pose: Pose | None = None  # true or, without truth, the one last heard; None when unknown
    goal: tuple[float, float] | None = None  # m; None without a goal
    decision_ms: float | None = None  # wall time of its last decision; None when unknown
    # time since another robot (if unknown or without one, the source) last heard it; None if never
    heard_s: float | None = None
    trapped: Trapped | None = None  # None for a robot that is not, or while this is being computed
    charge: float | None = None  # share of its battery's capacity that is left; None without a battery or a report
    radio_wrong: str = ""  # what is wrong with its direct radio, as it reports; empty if nothing is known


@dataclass(frozen=True, eq=False)
class LinkCounts:
    """Frames by directed link so far; rows are senders and columns receivers, in roster order."""

    sent: NDArray[np.int64]  # (n, n)
    delivered: NDArray[np.int64]  # (n, n)
    heard: NDArray[np.int64]  # (n, n), tick in which the receiver last heard the sender; -1 for never
    since: int = 0  # tick from which on frames are counted


@dataclass(frozen=True, eq=False)
class State:
    """A patrol at tick k, after its observations."""

    k: int
    time_s: float  # simulated time
    running: bool  # ticks follow each other without further requests
    pace: float | None  # requested factor of real time; negative for a replay running backwards, None for unlimited
    ticks_per_s: float  # of wall time, over the last few seconds
    robots: tuple[RobotState, ...]  # in roster order
    mfow_s: float | None  # of the first layer; None when unknown
    fog_mean_s: float | None  # of the first layer; None when unknown
    links: LinkCounts | None = None  # None when unknown
    ended: str | None = None  # why no more ticks follow; None while more may follow
    # x and y (m) and name of those present; a control ends them by name
    intruders: tuple[tuple[float, float, str], ...] = ()
    looks: Looks = field(default_factory=dict)  # of the map's marks
    faults: tuple[Mapping[str, Any], ...] = ()  # in force and requested by operators, as entries of a scenario's faults
    note: str = ""  # what is wrong now, such as that nothing has been heard for some time
    gone: bool = False  # the world has disappeared without reporting an end


@dataclass(frozen=True, eq=False)
class Series:
    """MFoW and mean fog over time, arrays of one length in order of ticks."""

    ticks: NDArray[np.int64]
    mfow_s: NDArray[np.float64]
    fog_mean_s: NDArray[np.float64]


class SeriesLog:
    """MFoW and mean fog of the ticks that have become known so far."""

    def __init__(
        self, step: float, ticks: Iterable[int] = (), mfow: Iterable[float] = (), fog_mean: Iterable[float] = ()
    ) -> None:
        """Start with some ticks; `step` is their duration, s, and the measures are in ticks."""
        self._step = step
        self._ticks, self._mfow, self._mean = array("q", ticks), array("d", mfow), array("d", fog_mean)

    def add(self, k: int, mfow: float, fog_mean: float) -> None:
        """Add the next tick that is known."""
        self._ticks.append(k)
        self._mfow.append(mfow)
        self._mean.append(fog_mean)

    def after(self, k: int) -> Series:
        """Return the ticks later than k."""
        first = bisect_right(self._ticks, k)
        mfow, mean = (np.array(measure[first:], dtype=np.float64) * self._step for measure in (self._mfow, self._mean))
        return Series(np.array(self._ticks[first:], dtype=np.int64), mfow, mean)


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of a control."""

    done: bool  # it was accepted
    text: str = ""  # one line for the operator: the reason if it was refused


class Source(Protocol):
    """Source of all that a page shows. Those that inherit from it may leave out what has a default here."""

    def static(self) -> Static:
        """Return the constant properties; available from the beginning."""
        ...

    def wait(self, timeout_s: float) -> State | None:
        """Wait for a state that differs from the one returned before; return None after the timeout.

        The timeout is wall time.
        """
        ...

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """Return the tick in which each point was last seen, as of `tick`: int32 (h, w).

        Points not seen yet have `patrol.ground.fog.NEVER`, and `OUTSIDE` marks those that the robot does not patrol.
        None is returned while the fog is being computed, or when it is unknown.
        """
        ...

    def tick(self, layer: Layer) -> int:
        """The tick of a fog: that of the state that `wait` returned last, or up to `Static.late` ticks earlier."""
        ...

    def set_shown(self, layers: Collection[Layer]) -> None:  # noqa: ARG002 - for those that need it
        """Set which fogs to keep up to date: those that open pages show, also in the background."""
        return

    def since(self, layer: Layer) -> int:  # noqa: ARG002 - likewise
        """Return the tick from which on a fog is known. Points last seen before it may have been seen later."""
        return 0

    def trail(self, first: int, last: int) -> NDArray[np.float64] | None:  # noqa: ARG002 - likewise
        """Return the robots' positions at ticks `first` to `last`, inclusive.

        The array is float64 (last - first + 1, robots, 2), m, with NaN for robots without a body. None is returned
        where the page collects the trail from the states, because time only runs forwards.
        """
        return None

    def series(self, after: int) -> Series:
        """Return MFoW and mean fog of the first layer, all that is known later than tick `after`.

        For a run that is over that goes up to its end.
        """
        ...

    def events(self, since: int) -> Sequence[Event]:
        """Return the events from number `since` on (0 for all), in the order in which they became known.

        One that is found later may have happened earlier.
        """
        ...

    def control(self, control: Mapping[str, Any]) -> Answer:
        """Carry out a control, or refuse it if it is malformed.

        `Static.controls` lists the accepted values of ``do``. A fleet takes the controls of `patrol.scenario.controls`.
        A replay takes ``{"do": "pause"}``, ``go``, ``step``, ``pace`` with a ``factor``, which plays backwards where it
        is negative, and ``seek`` with a tick ``k``.
        """
        ...

    def close(self) -> None:
        """Release links, files and memory."""
        return


WINDOW_S = 3.0
"""Wall time over which the rate is taken, s."""
SAMPLE_S = 0.1
"""Least wall time between two samples, s."""


class TickRate:
    """The rate of ticks over the last `WINDOW_S`. Times are s of any clock."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int]] = deque()

    def clear(self) -> None:
        """Forget all ticks: what comes next has another rate."""
        self._samples.clear()

    def add(self, now_s: float, k: int) -> None:
        """Take in a tick."""
        # Fast ticks would otherwise fill the memory with samples that tell nothing new.
        if not self._samples or now_s >= self._samples[-1][0] + SAMPLE_S:
            self._samples.append((now_s, k))

    def at(self, now_s: float, k: int) -> float:
        """Return the ticks per second of wall time; 0 without ticks.

        For example, 2.0 at 13 s and tick 26 if the oldest sample is tick 20 at 10 s.
        """
        # One sample from before the window stays, so that the rate spans all of it.
        while len(self._samples) > 2 and self._samples[1][0] <= now_s - WINDOW_S:
            self._samples.popleft()
        if not self._samples:
            return 0.0
        since, before = self._samples[0]
        return (k - before) / (now_s - since) if now_s > since else 0.0
