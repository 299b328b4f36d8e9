"""What a page shows, wherever it comes from: a fleet that is running, or a run that is played again.

A source is read by one thread (`wait`, `last_seen`, `series`, `events`), which is never hurried and never makes a fleet
wait; `ask` may be called from any other. Arrays that a source hands out are its own: they are read before the next
`wait` and never written to.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.journal.records import Event, Status
    from patrol.pose import Pose

Layer = Literal["truth", "heard"] | int
"""A fog: the true one, the one that follows from all positions that can be heard, or what a robot believes."""

OUTSIDE = -2
"""In place of a last-seen tick: the point counts for the fleet, but not for the one whose fog this is."""


@dataclass(frozen=True, slots=True)
class RobotShape:
    """What never changes of a robot. radius: m. range_m, angle_deg: of its sensor's footprint."""

    number: int
    name: str
    model: str
    radius: float
    range_m: float
    angle_deg: float


@dataclass(frozen=True, eq=False)
class Static:
    """What never changes while a source lasts.

    name: of the fleet or the run. scenario: resolved. passable, patrolled: bool (h, w), row 0 at the lowest y. point:
    m. origin: m, the grid's lower left corner. step: s of a tick. ticks: of the whole run, None where nobody knows.
    bound_s: the lower bound of MFoW, None where nobody knows. live: it is going on now. layers: the fogs that
    `last_seen` can tell of, the first one best. controls: what `ask` takes, by the names of a control's "do"; none
    where nothing can be asked. note: what the viewer should know besides, such as what is missing. direct: robots hear
    each other by themselves (`radio.via`), so nobody else knows what each of them has heard: no links, no beliefs.
    late: by how many ticks a fog may be older than the state and is shown all the same, as of its own tick.
    """

    name: str
    scenario: Mapping[str, Any]
    passable: NDArray[np.bool_]
    patrolled: NDArray[np.bool_]
    point: float
    origin: tuple[float, float]
    robots: tuple[RobotShape, ...]
    step: float
    ticks: int | None
    bound_s: float | None
    live: bool
    layers: tuple[Layer, ...]
    controls: tuple[str, ...] = ()
    note: str = ""
    direct: bool = False
    late: int = 0

    @property
    def has_truth(self) -> bool:
        """Whether the true fog and true poses are known."""
        return "truth" in self.layers


@dataclass(frozen=True, slots=True)
class RobotState:
    """One robot now.

    status: its standing; LOST where only positions are known and none has come for long. state: what its mind says it
    does, empty where it says nothing. pose: where it truly is, or was last heard; None where that is unknown. goal: m.
    decision_ms: of its last decision. heard_s: how long ago it was last heard by another robot, or by the source where
    robots' hearing is not known or none is there to hear it; None where it was not. rejected: frames that it has
    refused so far.
    """

    number: int
    status: Status
    state: str = ""
    pose: Pose | None = None
    goal: tuple[float, float] | None = None
    decision_ms: float | None = None
    heard_s: float | None = None
    rejected: int | None = None


@dataclass(frozen=True, eq=False)
class Links:
    """What became of frames so far, by directed link, places in the roster: source by destination.

    sent, delivered: int64 (n, n). heard: int64 (n, n), the tick in which the destination last heard the source, -1 for
    never.
    """

    sent: NDArray[np.int64]
    delivered: NDArray[np.int64]
    heard: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class State:
    """A patrol at tick k, after its observations.

    running: ticks go on by themselves. pace: the factor of real time that is asked for, negative where a replay goes
    backwards, None for as fast as it goes. ticks_per_s: by the wall clock, lately. robots: in roster order. mfow_s,
    fog_mean_s: of the first layer; None where nothing is known. links: None where nobody tells. ended: why no more
    ticks will come, None while some may. intruders: (x, y), m, those that are there. faults: those that operators have
    asked for and that are in force, as entries of a scenario's faults. note: what is wrong now, such as that nothing
    has been heard for some time. gone: there is nobody any more who could tell, though no end was told.
    """

    k: int
    time_s: float
    running: bool
    pace: float | None
    ticks_per_s: float
    robots: tuple[RobotState, ...]
    mfow_s: float | None
    fog_mean_s: float | None
    links: Links | None = None
    ended: str | None = None
    intruders: tuple[tuple[float, float], ...] = ()
    faults: tuple[Mapping[str, Any], ...] = ()
    note: str = ""
    gone: bool = False


@dataclass(frozen=True, eq=False)
class Series:
    """MFoW and mean fog over time, in order: ticks int64 (m,), mfow_s and fog_mean_s float64 (m,)."""

    ticks: NDArray[np.int64]
    mfow_s: NDArray[np.float64]
    fog_mean_s: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of a control. text: one line for the one who asked, why not where it was refused."""

    done: bool
    text: str = ""


class Source(Protocol):
    """Where a page takes what it shows from."""

    def static(self) -> Static:
        """What never changes; there is always an answer."""
        ...

    def wait(self, timeout_s: float) -> State | None:
        """The newest state once it differs from what was returned before, or None after `timeout_s`."""
        ...

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """int32 (h, w): the tick in which each point was last seen; None while that is worked out, or not known.

        As of `tick`. `patrol.ground.fog.NEVER` where a point was not seen, and `OUTSIDE`.
        """
        ...

    def tick(self, layer: Layer) -> int:
        """Of which a fog is: that of the state that `wait` returned last, or up to `Static.late` before it."""
        ...

    def keep(self, layers: Collection[Layer]) -> None:
        """These fogs, no others, are on open pages, also on some that draw nothing now: what they take is kept."""
        ...

    def since(self, layer: Layer) -> int:
        """The tick from which on a fog is followed: a point that was last seen before it may have been seen later."""
        ...

    def trail(self, first: int, last: int) -> NDArray[np.float64] | None:
        """float64 (last - first + 1, robots, 2), m: where robots were in these ticks, NaN where there was no body.

        None where a page remembers what it was told, as time only goes forwards.
        """
        ...

    def series(self, after: int) -> Series:
        """What is known of the first layer in ticks after `after`; of a run that is over, all of it at once."""
        ...

    def events(self, since: int) -> Sequence[Event]:
        """What has happened, from the event numbered `since` (0: from the first) on, in order."""
        ...

    def ask(self, control: Mapping[str, Any]) -> Answer:
        """Ask for something: {"do": "pause"}, "go", "step", {"do": "pace", "factor": 2.0 or None}, ...

        A replay also takes {"do": "seek", "k": 120}, and a negative factor, which plays backwards. A fleet takes
        {"do": "fault", "fault": {...}} with an entry as in a scenario's faults but without a time, {"do": "heal", "id":
        "..."}, and {"do": "intruder", "place": [x, y], "stay": s or None}. What is malformed is refused.
        """
        ...

    def close(self) -> None:
        """No more is wanted."""
        ...
