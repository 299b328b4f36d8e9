"""The ports of a mind: the protocols of everything that can be exchanged around it, and the values that pass.

    Policy      what to want          decide(view) -> intent       once a tick
    Body        how to get there      obey(intent, view) -> choice
    Robot       a body's hardware     sense() -> sensed, act(command)
    Radio       positions             send(frames), hear() -> frames
    FleetClock  the fleet's ticks     tick(), decide()
    Telemetry   viewers               report(...)

A policy answers with an intent and never with how to carry it out: paths, refinement of the goal, steering, getting
unstuck and giving way are the body's business, so that policies compete on equal terms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable
from warnings import warn

from patrol.exchange import Sensed
from patrol.pose import Command

if TYPE_CHECKING:
    from agent.belief.posts import Posts
    from agent.routes.ground import Disc, Spot
    from agent.view import View
    from patrol.energy.spec import DockSpec
    from patrol.graph import Graph
    from patrol.ground.fields import StaticFields
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.prepare import Prepared
    from patrol.radio.peers import Peer
    from patrol.scenario import BodyLengths, PatrolSpec, RobotSpec

__all__ = [
    "Bearing",
    "Body",
    "Choice",
    "Decision",
    "Figures",
    "FleetClock",
    "FleetSetup",
    "Goal",
    "GroundSetup",
    "Intent",
    "Place",
    "Policy",
    "PolicyFailed",
    "PolicySetup",
    "Radio",
    "Robot",
    "RobotSetup",
    "State",
    "Stay",
    "Steer",
    "Telemetry",
]

Figures = Mapping[str, float]
"""Numbers that a policy wants to have shown, by name; for example ``{"way_m": 12.5, "age_s": 40.0}``."""


class State(StrEnum):
    """The state of a robot, as it is reported. A policy may use words of its own, for example "cleaning"."""

    PATROLLING = "patrolling"
    FREE = "free"  # patrols by choices of its own, where its policy has a plan or round
    DEAD_END = "dead-end"
    HOLDING = "holding"
    SURROUNDING = "surrounding"
    DOCKING = "docking"
    CHARGING = "charging"


# --- what a policy wants ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Bearing:
    """Go in the first of these directions in which the body can move.

    For example, ``Bearing((0.0, 1.57))`` goes along the x axis, or along the y axis where the first way is blocked.

    Attributes:
        bearings: rad, best first. Another sequence than a tuple is made one before a body reads it.
        near: A place in sight, x and y in m, at which a body that can stop there should; None for none.
        bend: Where the way to what pulls hardest first bends, x and y in m; a body that keeps getting stuck heads for
            it. None where there is none.
        wander: A direction, rad, to be taken for this one step instead of all others where the body can; None for none.
        state: The robot's state while it obeys, for reports.
        figures: For telemetry.
    """

    bearings: Sequence[float]
    near: Spot | None = None
    bend: Spot | None = None
    wander: float | None = None
    state: str = State.PATROLLING
    figures: Figures = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Place:
    """Get there by the shortest way, and stay there.

    For example, ``Place(12.0, 40.0, exact=True)`` goes to (12, 40) m, and a car ends on that very point.

    Attributes:
        x: m.
        y: m. A place that no way leads to stands for the nearest one that can be reached.
        bend: Where the shortest way there first bends, x and y in m; the body looks for it itself where this is None.
            A car goes by the place alone, and so does a differential robot between bends that are close together.
        lean: A point to head for in place of the bend as long as that leads on, such as one pushed aside by others.
        wander: A direction, rad, to be taken for this one step instead where the body can; None for none.
        exact: Whether a car that is as near as one step brings it goes on until it is on the very point of the place.
        gives_room: Whether the body passes others on the right, and stops before it touches one
            (`agent.bodies.keeping_right`); otherwise it goes round others once it has bumped.
        state: The robot's state while it obeys, for reports.
        figures: For telemetry.
        step: The next command on the way, of the kind that the body's model obeys, for a body that may take it: no wall
            and no other robot is in its way. None for one that the body finds itself.
        others: Where the policy knows the other robots to be now, by number, in place of where they were heard; None
            for the latter.
        heading: Where to face, rad: a holonomic robot on its way too, others once they are there. A car does so where
            the place is exact and it searches for manoeuvres, to an eighth of pi. None for any heading.
    """

    x: float
    y: float
    bend: Spot | None = None
    lean: Spot | None = None
    wander: float | None = None
    exact: bool = False
    gives_room: bool = False
    state: str = State.PATROLLING
    figures: Figures = field(default_factory=dict)
    step: Command | None = None
    others: Mapping[int, Peer] | None = None
    heading: float | None = None


@dataclass(frozen=True, slots=True)
class Stay:
    """Stand still; a car that is getting out of a dead end finishes that first.

    For example, ``Stay(State.CHARGING)`` at a dock.
    """

    state: str = State.HOLDING
    figures: Figures = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Steer:
    """Obey this command: the policy steers the body itself. One that leads into a wall is not obeyed.

    For example, ``Steer(Twist(0.5, 0.2))`` drives a differential robot at 0.5 m/s while it turns left at 0.2 rad/s.

    Attributes:
        command: Of the kind that the body's model obeys; numbers beyond its limits are cut to them.
        state: The robot's state while it obeys, for reports.
        figures: For telemetry.
    """

    command: Command
    state: str = State.PATROLLING
    figures: Figures = field(default_factory=dict)


Intent = Bearing | Place | Stay | Steer


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """The robot that a policy decides for.

    Attributes:
        spec: Its number, model, speed (m/s), radius (m), turning radius (m) and battery.
        lengths: The lengths of its patrol, m.
    """

    spec: RobotSpec
    lengths: BodyLengths


@dataclass(frozen=True, slots=True)
class GroundSetup:
    """The ground of a robot.

    Attributes:
        terrain: The ground, and the points that block the view.
        fields: Where the robot's body fits and gets to, and the points that it can see from there.
        posts: Where to stand to see points that no body can reach.
        sight: The sensor on the terrain: the points seen from a pose, and how far it sees.
        prepared: The ground of the whole fleet, with rounds, regions and the ground of zones. Its scenario is without
            sections that no robot knows: faults, intruders and ground that closes.
        scratch: Working memory by name, shared by policies of one process that never think at the same time.
    """

    terrain: Terrain
    fields: StaticFields
    posts: Posts
    sight: Footprint
    prepared: Prepared
    scratch: dict[str, Any] = field(default_factory=dict)

    def graph(self) -> Graph:
        """Return the terrain's graph, which is made at the first call, for all policies of the process."""
        if "graph" not in self.scratch:
            self.scratch["graph"] = self.prepared.make_graph()
        graph: Graph = self.scratch["graph"]
        return graph


@dataclass(frozen=True, slots=True)
class FleetSetup:
    """The fleet, the same for all its robots.

    Attributes:
        step: s per tick.
        roster: All robots in the order of their numbers, the spare ones included.
        patrol: The scenario's section `patrol`; its lengths that are ``auto`` are in `RobotSetup.lengths`.
        docks: The scenario's section `docks`.
        chance: A random number in [0, 1) for a question of integers, the same for all robots. It comes from the fleet's
            key, so that only the fleet can compute it; without a key from the scenario's seed, which every copy of the
            scenario holds (`agent.chance`).
    """

    step: float
    roster: tuple[RobotSpec, ...]
    patrol: PatrolSpec
    docks: tuple[DockSpec, ...]
    chance: Callable[..., float]

    @property
    def team(self) -> int:
        """Number of robots that patrol from the start; for example 3 of four robots of which one is spare."""
        return sum(not spec.spare for spec in self.roster)

    @property
    def radii(self) -> Mapping[int, float]:
        """The radii of all robots by number, m."""
        return {spec.number: spec.radius for spec in self.roster}


_MOVED: Mapping[str, str] = MappingProxyType(
    {name: f"robot.{name}" for name in ("spec", "lengths")}
    | {name: f"ground.{name}" for name in ("terrain", "fields", "posts", "sight", "graph", "scratch")}
    | {name: f"fleet.{name}" for name in ("step", "radii", "team", "patrol", "docks")}
    | {"fleet_chance": "fleet.chance", "sensor": "ground.prepared.scenario.sensor"}
)
"""Attributes that `PolicySetup` had itself in 1.0, and where they are now."""


@dataclass(frozen=True, slots=True)
class PolicySetup:
    """Values that a policy is made from: all that never changes while its robot runs.

    For example, ``setup.robot.spec.speed`` is in m/s, and ``setup.fleet.step`` in s.

    The attributes of 1.0, such as ``setup.terrain`` and ``setup.step``, are deprecated: they warn, and go with 2.0.

    Attributes:
        robot: The robot itself.
        ground: Its ground.
        fleet: All robots.
        options: What `patrol.options` says, as the policy's own ``Options``; an empty mapping where it has none.
    """

    robot: RobotSetup
    ground: GroundSetup
    fleet: FleetSetup
    options: Any

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            place = _MOVED.get(name)
            if place is None:
                raise AttributeError(f"PolicySetup has no attribute {name}; see docs/compatibility.md, Policies")
            warn(f"setup.{name} is setup.{place} since 1.1", FutureWarning, stacklevel=2)
            return attrgetter(place)(self)


class Policy(Protocol):
    """The choice of a robot's next intent.

    A policy is made anew with each incarnation of its robot, by ``Policy(setup)`` (`PolicySetup`). It may
    keep any state. Its class may have a pydantic model named ``Options``, which `patrol.options` of the
    scenario is validated by. If it raises, or returns anything but an intent, its own robot stops and no other does.

    For example, a policy that always drives to the right of the map:

        class East:
            def __init__(self, setup: PolicySetup) -> None:
                pass

            def decide(self, view: View) -> Intent:
                return Bearing((0.0,))
    """

    def decide(self, view: View) -> Intent:
        """Choose an intent for this tick.

        Args:
            view: All that the robot may know now; see `agent.view.View`.

        Returns:
            One intent.
        """
        ...


class PolicyFailed(Exception):
    """A policy has raised, taken too long, or returned something that is no intent: one line of text."""


# --- how a body carries it out ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Goal:
    """The place that a body heads for.

    Attributes:
        goal: x and y in m, before refinement.
        refined: x and y in m, after it.
    """

    goal: Spot
    refined: Spot


@dataclass(frozen=True, slots=True)
class Choice:
    """The body's answer to an intent.

    For example, ``Choice(Twist(0.5, 0.0), State.PATROLLING)`` drives straight ahead at 0.5 m/s.

    Attributes:
        command: For the next step.
        state: The robot's state, for reports.
        bearing: The direction that was chosen, rad, or None.
        goal: Where it heads, or None.
    """

    command: Command
    state: str
    bearing: float | None = None
    goal: Goal | None = None


class Body(Protocol):
    """The way in which a robot of one model moves."""

    def obstacles(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer]) -> Sequence[Disc]:
        """Return the discs in this body's way for now, besides walls: the robots that it gives way to.

        Args:
            tick: Now.
            pose: The robot's own.
            bumped: Whether its last move was cancelled.
            peers: The robots heard so far, by number.

        Returns:
            Discs: x, y and radius in m, for example ``[(12.0, 40.0, 2.5)]``.
        """
        ...

    def obey(self, intent: Intent, view: View) -> Choice:
        """Return the command that carries an intent out best in the next step.

        Args:
            intent: Checked (`agent.answers.checked`).
            view: The same as the policy's.

        Returns:
            The command, and its purpose.
        """
        ...


@dataclass(frozen=True, slots=True)
class Decision:
    """One tick's decision and its diagnostics.

    Attributes:
        command: For the next step.
        state: `State.DEAD_END` while escaping (car, differential) or blocked on every side (holonomic), `State.HOLDING`
            when nothing pulls or the robot is off the reachable ground; else the policy's word.
        direction: The bearing that was chosen, rad, or None.
        goal: x and y in m before refinement, or None.
        refined: x and y in m after refinement, or None.
        mfow: Believed age of the stalest point, ticks.
        rejected: Frames refused so far.
        figures: The policy's numbers, for viewers.
    """

    command: Command
    state: str
    direction: float | None
    goal: Spot | None
    refined: Spot | None
    mfow: int
    rejected: int
    figures: Figures = field(default_factory=dict)


# --- what a mind is put into -----------------------------------------------------------------------------------------


class Robot(Protocol):
    """A body that can be read and commanded."""

    def sense(self) -> Sensed | None:
        """Wait for the fleet's next tick; None when it is time to leave.

        A robot that has had no pose for long stops meanwhile: it must not drive without knowing where it is.
        """
        ...

    def act(self, command: Command) -> None:
        """Obey for one step."""
        ...

    def stop(self, reason: str) -> None:
        """Stop for good, perhaps not for the first time: the mind cannot go on, or the driver ends.

        Args:
            reason: One line.
        """
        ...


class Radio(Protocol):
    """A broadcast of position frames."""

    def send(self, frames: tuple[bytes, ...]) -> None:
        """Send this robot's position and its contacts.

        For example, a robot that sees one intruder sends two frames.
        """
        ...

    def hear(self) -> list[bytes] | None:
        """Return the frames that have arrived for this tick's decision, by sender and sequence.

        None when the tick is over, so that a decision would come too late, or when it is time to leave.
        """
        ...


class FleetClock(Protocol):
    """The source of the fleet's ticks: the world of simulated robots, or a clock of the robot's own."""

    def tick(self) -> int | None:
        """Wait for the next tick, which is never an earlier one; None when it is time to leave."""
        ...

    def decide(self) -> bool:
        """Wait until it is time to decide on this tick; False when it is too late for that, or time to leave."""
        ...


@runtime_checkable
class Telemetry(Protocol):
    """A viewer of decisions. It must not change any of them."""

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """Take note of a decision that is about to be acted on.

        Args:
            sensed: The robot's senses in this tick.
            decision: The decision of its mind.
            decision_ms: Wall time that this took, ms.
        """
        ...
