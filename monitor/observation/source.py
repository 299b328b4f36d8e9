"""The interface between a page and what it shows: a running fleet, or a run that is played back.

One thread reads a source (`wait`, `last_seen`, `series`, `events`); reading never slows the fleet. Any thread may call
`control`. Arrays that a source returns belong to the source: read them before the next `wait`, and never write to them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.journal.records import Event, Status
    from patrol.pose import Pose
    from patrol.scenario.zones import ZoneNow

Layer = Literal["truth", "heard"] | int
"""A fog: the true one, the one that follows from every position sent, or the one that a robot (by number) believes."""

OUTSIDE = -2
"""Replaces a last-seen tick where the fleet patrols the point, but the robot whose fog this is does not."""


@dataclass(frozen=True, slots=True)
class RobotShape:
    """The constant properties of a robot.

    Attributes:
        number: Its number.
        name: Its name.
        model: Its body model.
        radius: Radius of the body, m.
        range_m: Range of its sensor, m.
        angle_deg: Field of view of its sensor, degrees.
        spare: Whether it takes part only once an operator or a fault lets it join.
    """

    number: int
    name: str
    model: str
    radius: float
    range_m: float
    angle_deg: float
    spare: bool = False


@dataclass(frozen=True, eq=False)
class Static:
    """The constant properties of a source.

    Attributes:
        name: Name of the fleet or the run.
        scenario: The resolved scenario.
        passable: bool (h, w), row 0 at the lowest y.
        patrolled: bool (h, w), row 0 at the lowest y.
        point: Side of a point, m.
        origin: Lower left corner of the grid, m.
        robots: The roster.
        step: Duration of a tick, s.
        ticks: Number of ticks of the whole run; None when unknown.
        bound_s: Lower bound of MFoW, s; None when unknown.
        live: Whether the fleet is running now.
        layers: The fogs that `Source.last_seen` knows, the default one first.
        controls: The controls that `Source.control` accepts, by the value of "do"; empty when it accepts none.
        note: What the viewer should know in addition, such as what is missing.
        direct: Whether robots hear each other directly (`radio.via`). Then only the robots know which frames each robot
            has received, so there are no links and no beliefs.
        late: How many ticks a fog may be older than the state and still be shown, as of its own tick.
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
        """True if the true fog and the true poses are known."""
        return "truth" in self.layers


@dataclass(frozen=True, slots=True)
class Trapped:
    """Since when a robot has been trapped (`patrol.measures.progress`).

    Attributes:
        since_s: When its stay began, s.
        exact: Whether its stay began then; otherwise it began before, and this is the first that is known.
    """

    since_s: float
    exact: bool = True


@dataclass(frozen=True, slots=True)
class RobotState:
    """The state of one robot.

    Attributes:
        number: Its number.
        status: Its status; LOST where only positions are known and none has arrived for long.
        state: What its mind reports to be doing; empty without a report.
        pose: Its true pose or, without truth, the one last heard; None when unknown.
        goal: Where it is going, m; None without a goal.
        decision_ms: Wall time of its last decision, ms; None when unknown.
        heard_s: Time since another robot last heard it, s; None if none has. Where it is unknown which robots hear each
            other, or there is no other robot, the time since the source last heard it.
        rejected: Number of frames that it has rejected so far; None when unknown.
        trapped: Since when it has been trapped; None for a robot that is not, or while this is being computed.
        radio_wrong: What is wrong with its direct radio, by what it reports; empty if nothing is known to be.
    """

    number: int
    status: Status
    state: str = ""
    pose: Pose | None = None
    goal: tuple[float, float] | None = None
    decision_ms: float | None = None
    heard_s: float | None = None
    rejected: int | None = None
    trapped: Trapped | None = None
    radio_wrong: str = ""


@dataclass(frozen=True, eq=False)
class LinkCounts:
    """Frames by directed link so far; rows are senders and columns receivers, in roster order.

    Attributes:
        sent: int64 (n, n), frames sent.
        delivered: int64 (n, n), frames delivered.
        heard: int64 (n, n), the tick in which the receiver last heard the sender; -1 for never.
        since: The tick from which on frames are counted.
    """

    sent: NDArray[np.int64]
    delivered: NDArray[np.int64]
    heard: NDArray[np.int64]
    since: int = 0


@dataclass(frozen=True, eq=False)
class State:
    """A patrol at tick k, after its observations.

    Attributes:
        k: The tick.
        time_s: Simulated time, s.
        running: Whether ticks follow each other without further requests.
        pace: The requested factor of real time; negative for a replay that runs backwards, None for unlimited.
        ticks_per_s: Ticks per second of wall time, over the last few seconds.
        robots: In roster order.
        mfow_s: MFoW of the first layer, s; None when unknown.
        fog_mean_s: Mean fog of the first layer, s; None when unknown.
        links: Frame counts by link; None when unknown.
        ended: Why no more ticks follow; None while more may follow.
        intruders: (x, y, name) of the intruders that are present, m; a control ends them by their names.
        closed: Names of the closures that are closed.
        waiting: Names of the closures that are to close and wait until bodies are clear of them.
        zones: All zones, by name.
        faults: The faults in force that operators have requested, as entries of a scenario's faults.
        note: What is wrong now, such as that nothing has been heard for some time.
        gone: Whether the world has disappeared without reporting an end.
    """

    k: int
    time_s: float
    running: bool
    pace: float | None
    ticks_per_s: float
    robots: tuple[RobotState, ...]
    mfow_s: float | None
    fog_mean_s: float | None
    links: LinkCounts | None = None
    ended: str | None = None
    intruders: tuple[tuple[float, float, str], ...] = ()
    closed: tuple[str, ...] = ()
    waiting: tuple[str, ...] = ()
    zones: Mapping[str, ZoneNow] = field(default_factory=dict)
    faults: tuple[Mapping[str, Any], ...] = ()
    note: str = ""
    gone: bool = False


@dataclass(frozen=True, eq=False)
class Series:
    """MFoW and mean fog over time, in order.

    Attributes:
        ticks: int64 (m,).
        mfow_s: float64 (m,), s.
        fog_mean_s: float64 (m,), s.
    """

    ticks: NDArray[np.int64]
    mfow_s: NDArray[np.float64]
    fog_mean_s: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of a control.

    Attributes:
        done: Whether it was accepted.
        text: One line for the operator: the reason if it was refused.
    """

    done: bool
    text: str = ""


class Source(Protocol):
    """Source of all that a page shows."""

    def static(self) -> Static:
        """Return the constant properties; available from the beginning."""
        ...

    def wait(self, timeout_s: float) -> State | None:
        """Wait for a new state.

        Args:
            timeout_s: How long to wait, s of wall time.

        Returns:
            The newest state once it differs from the one returned before; None after the timeout.
        """
        ...

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """Return the tick in which each point was last seen, as of `tick`.

        Args:
            layer: Which fog.

        Returns:
            int32 (h, w), with `patrol.ground.fog.NEVER` for points not seen yet, and `OUTSIDE`. None while it is being
            computed, or when it is unknown.
        """
        ...

    def tick(self, layer: Layer) -> int:
        """The tick of a fog: that of the state that `wait` returned last, or up to `Static.late` ticks earlier."""
        ...

    def set_shown(self, layers: Collection[Layer]) -> None:
        """Set which fogs to keep up to date.

        Args:
            layers: The fogs that open pages show, including pages in the background.
        """
        ...

    def since(self, layer: Layer) -> int:
        """Return the tick from which on a fog is known. Points last seen before it may have been seen later."""
        ...

    def trail(self, first: int, last: int) -> NDArray[np.float64] | None:
        """Return the robots' poses at some ticks.

        Args:
            first: The first tick.
            last: The last tick.

        Returns:
            float64 (last - first + 1, robots, 2), m, NaN for robots without a body. None where the page collects the
            trail from the states, because time only runs forwards.
        """
        ...

    def series(self, after: int) -> Series:
        """Return MFoW and mean fog of the first layer.

        Args:
            after: The last tick that is already known.

        Returns:
            All that is known of later ticks; for a run that is over, up to its end.
        """
        ...

    def events(self, since: int) -> Sequence[Event]:
        """Return the events in the order in which they became known. One that is found later may have happened earlier.

        Args:
            since: Number of the first event; 0 for all.
        """
        ...

    def control(self, control: Mapping[str, Any]) -> Answer:
        """Carry out a control, or refuse it if it is malformed.

        Args:
            control: {"do": "pause"}, "go", "step", or {"do": "pace", "factor": 2.0 or None}. A replay also accepts
                {"do": "seek", "k": 120}, and a negative factor, which plays backwards. A fleet accepts {"do": "fault",
                "fault": {...}} with an entry of a scenario's faults without a time, {"do": "heal", "id": "..."}, and
                {"do": "intruder", "place": [x, y], "stay": s or None}.

        Returns:
            Whether it was accepted.
        """
        ...

    def close(self) -> None:
        """Release what the source holds."""
        ...
