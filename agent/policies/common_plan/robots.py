"""The point robots of a common plan: how they drive, and what they see.

They drive the shortest ways, a little slower than the bodies do (`PACE`). Those on wheels see a little less. So a body
that drives from place to place as they do sees what they see.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.kernels.plan import oldest_ages, take_stale, weighted_ages
from patrol.ground.footprint import REMEMBERED
from patrol.ground.ways import framed
from patrol.kernels.ways import FAR, is_clear, way_between
from patrol.own_sensor import make_footprint
from patrol.pose import Pose
from patrol.radio.message import as_received

if TYPE_CHECKING:
    from agent.policies.common_plan.stations import KnownStations
    from agent.ports import GroundSetup
    from agent.routes.ground import Spot
    from patrol.ground.footprint import View
    from patrol.scenario import RobotSpec

PACE = {"holonomic": 0.99, "differential": 0.97, "car": 0.97}
"""Their speed by model, as a share of the body's: the rest is for making up for time lost."""

BESIDE = 0.8
"""How much less far they see in a fleet with cars, in turning radii: cars drive beside the way."""

LEAST_SIGHT = 0.5
"""Lower bound of how far they see, as a share of the sensor's range."""

TURNING = 0.5
"""Way that a body which does not move sideways loses for each radian by which it turns, in radii of the body."""

Ages = NDArray[np.float64]


class Visit:
    """A stretch of a planned robot's way, from one draw to the next.

    A point of it is one that was stale when the robot saw it.
    """

    __slots__ = ("begun", "ended", "places", "points", "seen_before", "station", "then", "trail")

    def __init__(self, station: int, begun: int) -> None:
        self.station = station
        self.begun = begun  # tick
        self.trail: list[Spot] = []  # where the robot is after each tick of it, x and y in m
        self.ended: int | None = None  # tick at which its points were seen; None until then
        self.points = np.zeros(0, dtype=np.int64)  # flat indices
        self.seen_before = self.points  # the ticks at which each had been seen before
        self.places = self.points  # the places of the trail from which each was seen
        self.then: Visit | None = None  # the robot's next visit


@dataclass(slots=True)
class PlannedRobot:
    """A robot of the plan."""

    spec: RobotSpec
    place: Spot  # x and y in m
    visit: Visit
    left: Spot  # the last corner of its way that it has passed
    corners: list[Spot] = field(default_factory=list)  # of the rest of its way, the last one first
    stand: int = -1  # flat index of the end of its way
    course: float | None = None  # direction in which it last drove, rad
    lost_m: float = 0.0  # way that it has still to make up for, by corners and turns
    view: View | None = None  # what it saw at the last tick
    age_s: float = 0.0  # weighted age of its station when it was drawn
    oldest: int = 0  # number in the round of the station's oldest point, when all were looked at last
    taken: list[NDArray[np.int64]] = field(default_factory=list)  # what is to become the visit's arrays, (3, n) each

    def take(self, points: NDArray[np.int64]) -> None:
        """Note stale points, (2, n), that it has seen: flat indices, and when each was seen before."""
        places = np.full((1, points.shape[1]), max(len(self.visit.trail) - 1, 0))
        self.taken.append(np.concatenate([points, places]))

    def begin(self, visit: Visit) -> None:
        """End its visit, and begin another one."""
        ended = self.visit
        ended.ended, ended.then = visit.begun, visit
        if self.taken:
            ended.points, ended.seen_before, ended.places = np.concatenate(self.taken, axis=1)
            self.taken = []
        self.visit = visit


class Ways:
    """The shortest ways of the widest body of a fleet, on the ground as the map has it; not for two threads at once."""

    def __init__(self, setup: GroundSetup, widest: int) -> None:
        """Take the number of the robot with that body."""
        self._terrain = setup.prepared.terrain
        self._open = framed(setup.prepared.fields[widest].reach)
        self._lengths = np.full(self._open.shape, FAR, dtype=np.int32)
        self._queues = np.empty((2, self._open.size, 2), dtype=np.int32)
        self._way = np.empty(self._open.size, dtype=np.int32)

    def find(self, robot: PlannedRobot, stand: int) -> list[Spot]:
        """Return the corners of a robot's way to a point, the last one first."""
        first = self._cell(robot.place)
        is_between = not self._open.flat[first]  # where a way passes between two points, and the nearest one is closed
        if is_between:
            first = self._cell(robot.left)
        last = self._cell(self._terrain.centre(*divmod(stand, self._terrain.width)))
        count = way_between(self._open, first, last, self._lengths, self._queues, self._way)
        cells = [divmod(cell, self._open.shape[1]) for cell in self._way[0 if is_between else 1 : count].tolist()]
        return [self._terrain.centre(row - 1, col - 1) for row, col in reversed(cells)]

    def is_straight(self, place: Spot, to: Spot) -> bool:
        """Return True if the straight way between two places leads over reachable ground alone."""
        return bool(is_clear(self._open, self._cell(place), self._cell(to)))

    def _cell(self, place: Spot) -> int:
        """Return the flat index, in the framed ground, of the point on which a place lies."""
        row, col = self._terrain.nearest_point(*place)
        return (row + 1) * (self._terrain.width + 2) + col + 1


class PlannedGround:
    """The ground as the robots of one plan see it."""

    def __init__(self, setup: GroundSetup, step: float, known: KnownStations, robots: list[RobotSpec]) -> None:
        """Begin with nothing seen."""
        prepared, self._step, self._known = setup.prepared, step, known
        self._terrain = terrain = prepared.terrain
        turns_m = max((spec.turning_radius for spec in robots if spec.model == "car"), default=0.0)
        range_m = setup.sight.range_m
        sensor = prepared.scenario.sensor
        shorter = sensor.model_copy(update={"range": max(range_m - BESIDE * turns_m, LEAST_SIGHT * range_m)})
        self._full_sight = make_footprint(sensor, terrain, REMEMBERED)
        self._sight = make_footprint(shorter, terrain, REMEMBERED) if turns_m else self._full_sight
        widest = max(robots, key=lambda spec: spec.radius).number
        ways_by_robot: dict[int, Ways] = setup.scratch.setdefault("ways of plans", {})
        if widest not in ways_by_robot:
            ways_by_robot[widest] = Ways(setup, widest)
        self._ways = ways_by_robot[widest]
        self._tracked = np.zeros(terrain.shape, dtype=np.bool_)
        self._tracked.flat[known.points] = True
        self.last_seen = np.zeros(terrain.shape, dtype=np.int32)
        self._witnesses = np.full((len(known), 2), -1, dtype=np.int64)
        self._taken = np.empty((2, len(known.points)), dtype=np.int64)

    def send(self, robot: PlannedRobot, stand: int) -> None:
        """Send a robot to a point, flat index."""
        robot.stand, robot.corners = stand, self._ways.find(robot, stand)

    def drive(self, robot: PlannedRobot) -> None:
        """Drive on for a tick; to the next corner at most, unless the way there and on from it is as good as straight.

        So the body, which drives straight from place to place, drives the same way.
        """
        begun, has_turned, is_holonomic = robot.place, False, robot.spec.model == "holonomic"
        remaining_m, robot.lost_m = PACE[robot.spec.model] * robot.spec.speed * self._step - robot.lost_m, 0.0
        while robot.corners and remaining_m > 0.0:
            (x, y), (to_x, to_y) = robot.place, robot.corners[-1]
            away_m = math.hypot(to_x - x, to_y - y)
            if away_m > 0.0 and not is_holonomic:
                course = math.atan2(to_y - y, to_x - x)
                if robot.course is not None:
                    turn = abs(math.remainder(course - robot.course, math.tau))
                    remaining_m -= TURNING * robot.spec.radius * turn
                robot.course = course
            share = min(max(remaining_m, 0.0) / away_m, 1.0) if away_m > 0.0 else 1.0
            # Rounded as a body's pose is, so that body and plan look from the same place.
            there = as_received(Pose(x + share * (to_x - x), y + share * (to_y - y), 0.0))
            place = there.x, there.y
            if has_turned and not self._ways.is_straight(begun, place):
                return
            robot.place = place
            if share < 1.0:
                remaining_m = min(remaining_m, 0.0)
                break
            remaining_m -= away_m
            robot.left = robot.corners.pop()
            has_turned = away_m > 0.0
        if not is_holonomic:
            robot.lost_m = max(-remaining_m, 0.0)

    def look(self, robot: PlannedRobot, tick: int, least_s: float) -> None:
        """Note what a robot sees, and which points of it are at least so old, weighted.

        A body on wheels may be a little beside the way, so on the way two ticks in a row have to see a point.
        """
        view = (self._sight if robot.corners else self._full_sight).visible(Pose(*robot.place, 0.0))
        before = robot.view
        if before is None or not robot.corners or robot.spec.model == "holonomic":
            before = view
        robot.view = view
        windows = view.mask, view.row0, view.col0, before.mask, before.row0, before.col0
        count = take_stale(
            *windows, self._tracked, self._known.weights, tick, least_s / self._step, self.last_seen, self._taken
        )
        if count:
            robot.take(self._taken[:, :count])

    def see_from_stand(self, robot: PlannedRobot, tick: int, least_s: float) -> None:
        """Count the points of a robot's station as seen that are to be seen from its stand."""
        span = self._known.span(robot.visit.station)
        is_here = self._known.stands[span] == robot.stand
        unseen = self._known.points[span][is_here & (self.ages_s(span, tick) > least_s)]
        robot.take(np.stack([unseen, self.last_seen.flat[unseen]]))
        self.last_seen.flat[self._known.points[span][is_here]] = tick

    def ages_s(self, some: slice, tick: int) -> Ages:
        """Return the weighted ages of some of the round's points, s; 0 for those in view."""
        points = self._known.points[some]
        ages = np.empty(points.size)
        weighted_ages(points, self._tracked, self.last_seen, self._known.weights, tick, self._step, ages)
        return ages

    def oldest_s(self, tick: int) -> Ages:
        """Return the weighted age of the oldest point of each station, s."""
        known = self._known
        if known.weights.size:
            return np.maximum.reduceat(self.ages_s(slice(None), tick), known.begins[:-1])
        ages = np.empty(len(known))
        at = tick, self._step, self._witnesses
        oldest_ages(known.points, known.begins, self._tracked, self.last_seen, *at, ages)
        return ages
