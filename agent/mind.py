"""One robot's mind: from what it knows to what it does, once a tick (paper, "Final algorithm").

Pure: no clock, no I/O, no randomness but draws from (seed, robot, incarnation, tick).
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.belief.believed import Belief
from agent.belief.contacts import Place
from agent.belief.posts import Posts
from agent.bodies.giveway import GiveWay
from agent.bodies.goal import Goal, GoalFinder
from agent.bodies.steering import CarSteering, HolonomicSteering
from agent.bodies.unstuck import Unstuck
from agent.decision import Decision, State
from agent.policies.potential_field.direction import bearings_by_force, bearings_by_vector
from agent.policies.potential_field.field import Field, Pull
from agent.policies.potential_field.fuzzy import FuzzySectors
from agent.policies.potential_field.separation import (
    artificial_obstacles,
    critical_areas,
    numbered,
    occupied_areas,
    repel,
)
from agent.policies.surround.errand import Errand, Surround
from agent.routes.ground import Ground
from agent.routes.path_window import Window
from patrol.ground.fields import StaticFields
from patrol.ground.footprint import Footprint, sensor_footprint
from patrol.ground.terrain import Terrain
from patrol.pose import TAU, Command, Drive, Pose, Velocity
from patrol.radio.inbox import inbox_of
from patrol.radio.message import MAX_CONTACTS, Position, as_received, encode
from patrol.radio.peers import Peer
from patrol.random import Purpose, draw
from patrol.scenario import RobotSpec, Scenario

if TYPE_CHECKING:
    from patrol.regions.split import RegionSplit

BLOCKED_SHARE = 0.1
"""A holonomic robot that can make less than this share of a step in any direction is in a dead end."""

CLEAR_SHARE = 0.5
"""A direction in which a robot can make at least this share of a step is good enough to take."""


AFTER_BUMP = 0.5
"""Probability that a holonomic robot that bumped on its way around an intruder takes a random step."""

BARELY = 1e-3
"""A move shorter than this is none, m."""


@dataclass(frozen=True, slots=True)
class MindSetup:
    """What a mind is made of.

    number: of the robot. incarnation: 1 for the first process, one more for each restart. fields: of the robot's body.
    psi: float32 (h, w) of `agent.bodies.refine.psi_field`, needed for goal refinement. key: of the fleet, or None.
    footprint, scratch: shared by the minds of one process, to save time and memory; each mind makes its own otherwise.
    regions: of the robot's body, needed for paths through regions.
    """

    scenario: Scenario
    number: int
    terrain: Terrain
    fields: StaticFields
    psi: NDArray[np.float32] | None = None
    incarnation: int = 1
    key: bytes | None = None
    footprint: Footprint | None = None
    scratch: dict[str, Window] = field(default_factory=dict)
    regions: RegionSplit | None = None


class Mind:
    """Call `frames` with the pose of tick k, then `step` with what was heard; once each, k counting up."""

    def __init__(self, setup: MindSetup) -> None:
        scenario, terrain = setup.scenario, setup.terrain
        patrol = scenario.patrol
        self.spec: RobotSpec = scenario.roster[setup.number - 1]
        self._setup = setup
        self._step = scenario.step
        self._patience = math.ceil(scenario.radio.forget_after / scenario.step)
        self._memory = math.floor(patrol.contact_memory / scenario.step)
        self._radii = {spec.number: spec.radius for spec in scenario.roster}
        self._margin = self.spec.radius + 0.5 * scenario.point
        self._trail: deque[tuple[int, int]] = deque(maxlen=scenario.radio.trail + 1)
        self._framed = -1
        inbox = inbox_of(scenario, setup.number, terrain.bounds, setup.key)
        footprint = setup.footprint or sensor_footprint(scenario, terrain)
        # A window of half the terrain's points in every direction already holds all of it.
        dilatation = min(round(patrol.dilatation / scenario.point), terrain.height + terrain.width)
        # Straight paths know no walls: each point pulls from where it is, and not from a post.
        straight = patrol.paths == "straight"
        posts = Posts(np.full_like(setup.fields.proxy, -1) if straight else setup.fields.proxy)
        patrolled = setup.fields.patrolled
        spread = patrolled if straight else setup.fields.reach
        self.belief = Belief(patrolled, spread, posts, footprint, inbox, dilatation)
        self._separations = frozenset(patrol.separations)
        areas: list[NDArray[np.bool_]] = []
        if "semaphores" in self._separations:
            areas = critical_areas(patrol, terrain, setup.fields.reach)
        self._areas = numbered(areas, terrain.shape) if areas else None
        self._ground = Ground(terrain, setup.fields.reach, areas)
        fuzzy = patrol.avoidance == "fuzzy"
        self._fuzzy = FuzzySectors(terrain, patrol.sectors, patrol.fuzzy_distance) if fuzzy else None
        self._field = Field(patrol, setup.fields, posts, scenario.point, setup.scratch, setup.regions)
        refined = patrol.avoidance == "goal-refinement"
        if refined and setup.psi is None:
            raise ValueError("goal refinement needs psi")
        self._goals = GoalFinder(patrol, self._ground, setup.psi if refined else None)
        self._holonomic = HolonomicSteering(self.spec, terrain, scenario.step)
        self._car = CarSteering(self.spec, terrain, scenario.step)
        identity = (scenario.seed, setup.number, setup.incarnation)
        self._give_way = GiveWay(*identity, self._radii, scenario.step) if patrol.give_way else None
        self._unstuck = Unstuck(
            self._car, self.spec.speed, scenario.step, lambda k, index: self._draw(k, index, Purpose.UNSTUCK)
        )
        self._parking = max(self._car.stride, 2.0 * self.spec.turning_radius)
        self._surround = Surround(scenario, setup.number, terrain, setup.fields, setup.scratch)

    def frame(self, k: int, pose: Pose, clock_s: float | None = None) -> bytes:
        """The position message of tick k. clock_s: what the robot's own clock shows, s; k steps unless given."""
        time_s = k * self._step if clock_s is None else clock_s
        position = Position.of(self.spec.number, k, time_s, pose)
        if k != self._framed + 1:
            # Receivers date a trail's places by counting back one tick each.
            self._trail.clear()
        self._framed = k
        self._trail.appendleft((position.x_cm, position.y_cm))
        places = list(self._trail)
        trail = tuple((old[0] - new[0], old[1] - new[1]) for new, old in itertools.pairwise(places))
        return encode(replace(position, trail=trail), self._setup.key)

    def frames(
        self, k: int, pose: Pose, contacts: Sequence[Place] = (), clock_s: float | None = None
    ) -> tuple[bytes, ...]:
        """All that the robot sends in tick k: its position, and the intruders (x, y in m) that it sees itself."""
        time_s = k * self._step if clock_s is None else clock_s
        found = [Position.of_contact(k, time_s, x, y) for x, y in contacts[:MAX_CONTACTS]]
        return self.frame(k, pose, time_s), *(encode(contact, self._setup.key) for contact in found)

    def step(
        self, k: int, pose: Pose, heard: Sequence[bytes], bumped: bool, contacts: Sequence[Place] = ()
    ) -> Decision:
        """Decide at tick k.

        pose: the robot's own. heard: the frames that reach it, by sender and sequence. bumped: whether its last move
        was cancelled by a collision. contacts: the intruders (x, y in m) that it sees itself.
        """
        as_heard = as_received(pose)
        self.belief.update(k, as_heard, heard, self._step)
        for place in contacts[:MAX_CONTACTS]:
            self.belief.contacts.report(Position.of_contact(k, k * self._step, *place), k)
        intruders = self.belief.contacts.known(k, self._memory)
        self._obstruct(k, pose, bumped, separate=not intruders)
        start = self._ground.join(pose.x, pose.y)
        mfow = self.belief.fog.mfow(k)
        pull = Pull(np.zeros(0), None)
        errand = None
        if start is not None and intruders:
            errand = self._surround.errand(as_heard, self._live(k), intruders, self._ground, start)
        if start is not None and errand is None:
            pull = self._pull(k, pose, start, mfow)
        if errand is not None and start is not None:
            choice = self._take_place(k, pose, start, errand, bumped)
        elif self.spec.model == "holonomic":
            choice = self._go(k, pose, start, pull)
        else:
            choice = self._drive(k, pose, self._ahead(k, start, pull), bumped)
        command, state, bearing, goal = choice
        return Decision(
            command=command,
            state=state,
            direction=bearing,
            sector_sums=tuple(pull.sums.tolist()),
            goal=None if goal is None else goal.goal,
            refined=None if goal is None else goal.refined,
            mfow=mfow,
            rejected=self.belief.inbox.rejected,
        )

    def _obstruct(self, k: int, pose: Pose, bumped: bool, *, separate: bool) -> None:
        """Close what is in the way just now: silent peers, those given way to, artificial obstacles, semaphores.

        separate: whether the last two count, as they do while the robot patrols.
        """
        point = self._setup.scenario.point
        live = self._live(k)
        silent = self.belief.silent(k, self._patience, self._radii, self._margin)
        discs = [disc for disc in silent if math.hypot(disc[0] - pose.x, disc[1] - pose.y) >= disc[2]]
        if self._give_way is not None:
            self._give_way.update(k, pose, bumped, self.belief.peers, 2.0 * self._holonomic.stride)
            discs += self._give_way.discs(k, pose, self.belief.peers, point)
        if separate and "artificial-obstacles" in self._separations:
            discs += artificial_obstacles(pose, live, self._setup.scenario.patrol.obstacle_radius, point)
        areas = []
        if separate and self._areas is not None:
            areas = occupied_areas(self._areas, self._ground.terrain, pose, live)
        self._ground.obstruct(discs, areas)

    def _live(self, k: int) -> dict[int, Peer]:
        """The peers heard from lately; a silent one's claims and obstacles end."""
        return {number: peer for number, peer in self.belief.peers.items() if k - peer.tick <= self._patience}

    def _pull(self, k: int, pose: Pose, start: tuple[int, int], mfow: int) -> Pull:
        """The forces at tick k, with what other robots and close obstacles make of them."""
        patrol = self._setup.scenario.patrol
        live = self._live(k)
        rivals = []
        if "claims" in self._separations:
            joined = [self._ground.join(peer.pose.x, peer.pose.y) for _, peer in sorted(live.items())]
            rivals = [place for place in joined if place is not None]
        seen, dilated = self.belief.fog.last_seen, self.belief.dilated
        pull = self._field.pull(self._ground, *start, seen, dilated, k, mfow, rivals)
        if self._fuzzy is not None:
            np.multiply(pull.sums, self._fuzzy.coefficients(start[0] - 1, start[1] - 1), out=pull.sums)
        if "repulsion" in self._separations:
            repel(pull.sums, pose, live, patrol)
        return pull

    def _draw(self, k: int, index: int, purpose: Purpose = Purpose.RANDOM_MOVE) -> float:
        """What chance says of tick k's move, in [0, 1). index: 0 whether it is random, 1 where it goes."""
        scenario, number = self._setup.scenario, self.spec.number
        return draw(scenario.seed, purpose, number, self._setup.incarnation, k, index)

    def _directions(self, pull: Pull) -> list[float]:
        """The bearings to try, rad, best first."""
        patrol = self._setup.scenario.patrol
        if patrol.direction == "vector" and pull.sums.size:
            return bearings_by_vector(float(pull.sums[0]), float(pull.sums[1]), patrol.sectors)
        return bearings_by_force(pull.sums)

    def _go(
        self, k: int, pose: Pose, start: tuple[int, int] | None, pull: Pull
    ) -> tuple[Command, State, float | None, Goal | None]:
        """A holonomic robot's choice: the strongest direction in which it can move, or now and then a random one."""
        if self._draw(k, 0) < self._setup.scenario.patrol.random_move:
            bearing = TAU * self._draw(k, 1)
            return self._holonomic.heading(pose, bearing)[0], State.PATROLLING, bearing, None
        directions = self._directions(pull)
        if start is None or not directions:
            return Velocity(0.0, 0.0), State.HOLDING, None, None
        centre = self._ground.centre(*start)
        if pull.near is not None:
            place = self._ground.centre(*pull.near)
            velocity, way = self._holonomic.towards(pose, place)
            if way < CLEAR_SHARE * min(self._holonomic.stride, math.dist((pose.x, pose.y), place)):
                # Free from the centre of its own point, but not quite from where the robot stands on it.
                velocity, way = self._holonomic.towards(pose, centre)
            if way > BARELY:
                return velocity, State.PATROLLING, directions[0], Goal(place, place)
        best: tuple[Velocity, float, float, Goal] | None = None
        for bearing in directions:
            goal = self._goals.along(bearing, *start)
            velocity, way = self._holonomic.towards(pose, goal.refined)
            if best is None or way > best[1]:
                best = velocity, way, bearing, goal
            if way >= CLEAR_SHARE * self._holonomic.stride:
                break
        assert best is not None
        velocity, way, bearing, goal = best
        blocked = way < BLOCKED_SHARE * self._holonomic.stride
        return velocity, State.DEAD_END if blocked else State.PATROLLING, bearing, goal

    def _take_place(
        self, k: int, pose: Pose, start: tuple[int, int], errand: Errand, bumped: bool
    ) -> tuple[Command, State, float | None, Goal | None]:
        """The way to a place around an intruder, or staying there."""
        bearing = math.atan2(errand.bend[1] - pose.y, errand.bend[0] - pose.x)
        goal = Goal(errand.place, errand.bend)
        if self.spec.model == "holonomic":
            return self._approach(k, pose, start, errand, bumped), State.SURROUNDING, bearing, goal
        near = errand.bend == errand.place and math.dist((pose.x, pose.y), errand.place) < self._parking
        if near and not bumped and not self._unstuck.active:
            return self._car.park(pose, errand.place), State.SURROUNDING, bearing, goal
        command, state, _, _ = self._drive(k, pose, (bearing, goal), bumped)
        return command, State.SURROUNDING if state is State.PATROLLING else state, bearing, goal

    def _approach(self, k: int, pose: Pose, start: tuple[int, int], errand: Errand, bumped: bool) -> Velocity:
        """A holonomic robot's step towards a place, yielding to others on the way but not on its last step."""
        if bumped and self._draw(k, 0) < AFTER_BUMP:
            return self._holonomic.heading(pose, TAU * self._draw(k, 1))[0]
        here = (pose.x, pose.y)
        targets = [errand.bend, self._ground.centre(*start)]
        if math.dist(here, errand.place) > self._holonomic.stride:
            targets = [self._surround.pushed(pose, self._live(k), errand.bend), *targets]
        velocity, way = self._holonomic.towards(pose, targets[0])
        for target in targets[1:]:
            if way < CLEAR_SHARE * min(self._holonomic.stride, math.dist(here, errand.bend)):
                velocity, way = self._holonomic.towards(pose, target)
        return velocity

    def _drive(
        self, k: int, pose: Pose, ahead: tuple[float | None, Goal | None], bumped: bool
    ) -> tuple[Command, State, float | None, Goal | None]:
        """A car's choice: towards the goal ahead (its bearing, rad, and itself), or out of a dead end."""
        bearing, goal = ahead
        if self._unstuck.active:
            drive = self._unstuck.step(k, pose, bumped)
            if drive is not None:
                return drive, State.DEAD_END, None, goal
            bumped = False
        if goal is None or bearing is None:
            return Drive(0.0, 0.0), State.HOLDING, None, None
        drive = self._car.towards(pose, goal.refined)
        if not bumped and self._car.is_free(pose, drive):
            return drive, State.PATROLLING, bearing, goal
        self._unstuck.begin(k, bearing)
        drive = self._unstuck.step(k, pose, bumped=False)
        return drive or Drive(0.0, 0.0), State.DEAD_END, bearing, goal

    def _ahead(self, k: int, start: tuple[int, int] | None, pull: Pull) -> tuple[float | None, Goal | None]:
        """The strongest direction that leads at least half a step, and its goal; the strongest of all if none does.

        The paper's forces act along first steps of paths, which are free by construction. A bearing rounded to its
        sector's bisector may point into a wall right beside the robot; where it leads into one again and again, a car,
        whose moves know no chance, would never get away. It then takes the bearing of the strongest force as it is.
        """
        directions = self._directions(pull)
        if start is None or not directions:
            return None, None
        centre = self._ground.centre(*start)
        if pull.bend is not None and pull.bend != start and self._unstuck.keeps_happening(k):
            across, up = (there - here for there, here in zip(self._ground.centre(*pull.bend), centre, strict=True))
            directions = [math.atan2(up, across), *directions]
        for bearing in directions:
            goal = self._goals.along(bearing, *start)
            if math.dist(goal.goal, centre) >= CLEAR_SHARE * self._car.stride:
                return bearing, goal
        return directions[0], self._goals.along(directions[0], *start)
