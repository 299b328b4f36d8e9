"""Manoeuvres: how a body gets where no single arc leads, with three-point turns and ways out in reverse.

A body that drives towards the next bend with its nose ends up facing walls that it cannot turn away from. So a car or a
differential robot on its way to a place searches over the arcs that it can drive, forward and in reverse (hybrid A*),
guided by the length of the way that is left, and drives what it has found to the end. Every search brings it nearer to
the place. A differential robot's search has turns on the spot besides, and its tighter arcs are slower, because the
wheels share their speed between driving and turning.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from agent.kernels.manoeuvre import CLEARANCE, search
from agent.kernels.wave import FAR
from agent.routes.ground import NO_PATHS, BoxPaths
from agent.routes.wave import LONGEST, box_around, paths_in
from patrol.ground.swept_path import advance
from patrol.pose import Command, Drive, Twist
from patrol.radio.message import CM_PER_M

if TYPE_CHECKING:
    from agent.routes.ground import Ground, Spot
    from agent.view import View
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.scenario import RobotSpec

LEAST_TURN = 0.25
"""Least angle that the tightest arc of a search turns by, rad; a shorter step is taken several times."""

TIGHTNESS = (0.0, 1.0, -1.0, 0.5, -0.5)
"""Curvatures of the arcs, as shares of the tightest."""

TURNS = (0.125, -0.125, 0.25, -0.25, 0.5, -0.5)
"""Turns on the spot, as shares of half a circle."""

TIGHTEST_RADII = 2.0
"""Radius of a differential robot's tightest arcs, in radii of its body."""

REVERSE = 1.1
"""Cost of driving in reverse, relative to driving forward. It takes the same time, but the nose should lead."""

REVERSE_BLIND = 3.0
"""The same for a car whose sensor does not look all round, and so sees little that is new meanwhile."""

GEAR_CHANGE = 0.3
"""Cost of a change between forward and reverse, in turning radii. It takes no time, but a plan of many is fragile."""

TURNING = 1.05
"""Cost of an arc, relative to driving straight."""

SHORT = 0.4
"""Length of the short arcs, as a share of the long ones; they fit where those do not."""

AHEAD = 5.0
"""Progress after which a search ends, in turning radii."""

MOST_NODES = 12_000
"""Poses that one search looks at."""

MOST_ARCS = 256
"""Arcs that one search may find."""

OFF_COURSE = 0.1
"""Largest distance of a body from where its last step should have brought it, in strides."""

ASKEW = 0.05
"""Largest difference of its heading from the expected one, rad."""

MOST_KEPT, MOST_POINTS = 64, 2**16
"""Goals to which the robots of a process keep paths, since they search again and again, and points of each box."""

MARGIN = 8.0
"""Length beyond twice the direct way, in turning radii, up to which ways to a place count."""

NEAR = 0.5
"""A search ends where at most so many strides of the way are left."""

FACING = 0.35
"""By how much the heading may be off at the end of a search for arcs that end in one, rad."""

ON_IT = 0.25
"""The way left on the point of a place, in points: less than to a neighbour."""

OFF_CENTRES = 1.5
"""Sum of the distances of two places from the centres of their points, in points; rounded up."""


@dataclass(frozen=True, slots=True)
class Move:
    """A command that a search may choose, and for how long."""

    command: Command
    ticks: int
    # length (m, negative in reverse), curvature (1/m), turn on the spot (rad), cost (m)
    arc: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Moves:
    """The moves of a body, and their common values."""

    each: list[Move]
    turning: float  # radius of the tightest arcs, m
    cell: float  # side of the grid that tells poses apart, m; arcs that end in their first cell are left out


def car_moves(spec: RobotSpec, step: float, point: float, *, sees_all_round: bool) -> Moves:
    """Return the moves of a car; `step` is in s per tick, `point` is the side of the terrain's points in m."""
    stride = spec.speed * step
    ticks = max(1, math.ceil(LEAST_TURN * spec.turning_radius / stride))
    # A body that turns sideways by less than a cell would never leave its first one.
    moves = _arcs(spec.speed, spec.turning_radius, ticks, step, REVERSE if sees_all_round else REVERSE_BLIND)
    return Moves(moves, spec.turning_radius, max(0.5 * stride * ticks * SHORT, point))


def wheel_moves(spec: RobotSpec, step: float, *, reverses: bool) -> Moves:
    """Return the moves of a differential robot: arcs as a car's, as fast as the wheels allow, and turns on the spot."""
    stride, turning = spec.speed * step, TIGHTEST_RADII * spec.radius
    slowest = 1.0 / (1.0 + spec.radius / turning)
    ticks = max(1, math.ceil(LEAST_TURN * turning / (slowest * stride)))
    moves = []
    for move in _arcs(spec.speed, turning, ticks, step, REVERSE):
        length, curvature, _, cost = move.arc
        slower = 1.0 / (1.0 + spec.radius * abs(curvature))
        speed = slower * length / (ticks * step)
        if length > 0.0 or reverses:
            twist = Twist(speed, speed * curvature)
            moves.append(Move(twist, ticks, (slower * length, curvature, 0.0, cost)))
    fastest = spec.speed / spec.radius * step
    for share in TURNS:
        turn = share * math.pi
        needed = max(1, math.ceil(abs(turn) / fastest))
        cost = stride * needed * TURNING
        moves.append(Move(Twist(0.0, turn / (needed * step)), needed, (0.0, 0.0, turn, cost)))
    return Moves(moves, turning, 0.5 * stride * ticks * SHORT)


def _arcs(speed: float, turning: float, ticks: int, step: float, reverse: float) -> list[Move]:
    """Return a car's arcs. All take the same time, however short they are, so they cost the same."""
    moves = []
    for share in (1.0, SHORT):
        for sense in (1.0, -1.0):
            for bend in TIGHTNESS:
                drive = Drive(sense * share * speed, bend * (1.0 / turning))
                length = ticks * step
                cost = speed * length * (reverse if sense < 0.0 else 1.0) * (TURNING if bend != 0.0 else 1.0)
                moves.append(Move(drive, ticks, (drive.speed * length, drive.curvature, 0.0, cost)))
    return moves


class Manoeuvres:
    """Arcs to be driven one after the other.

    A body no farther than `parking` (m) from a place, with nothing in between, parks there.
    """

    def __init__(
        self, moves: Moves, spec: RobotSpec, terrain: Terrain, is_free: Callable[[Pose, Any], bool], step: float
    ) -> None:
        """Lay out the arcs of the search; `step` is in s per tick.

        `is_free` is called with a pose and a command, and returns True if the next step touches no wall.
        """
        self._moves = moves.each
        self._turning = moves.turning
        self._radius = spec.radius
        self._terrain = terrain
        self._is_free = is_free
        self._step = step
        stride = spec.speed * step
        self._tolerance = OFF_COURSE * stride
        self._near = max(NEAR * stride, terrain.point)
        # Ways are measured between the centres of points, so the body may be this much farther away.
        self.parking = self._near + OFF_CENTRES * terrain.point
        self._arcs = np.array([move.arc for move in moves.each])
        self._cell = moves.cell
        self._plan: deque[Command] = deque()
        self._place: Spot | None = None
        self._exact = False
        self._facing: float | None = None
        self._expected: Pose | None = None

    def drop(self) -> None:
        """Forget the arcs that were found."""
        self._plan.clear()
        self._place = None

    def next(self, view: View, place: Spot, *, exact: bool = False, facing: float | None = None) -> Command | None:
        """Return the next step towards a place; None where no arc brings the body nearer.

        With `exact` the body has to end on the very point of the place, as others hear it. It has to end about in the
        heading `facing`, rad, if arcs are found that do.
        """
        if facing != self._facing:
            self.drop()
            self._facing = facing
        # A place that has moved by less than a search ends before it needs no new search.
        off = math.inf if self._place is None or exact != self._exact else math.dist(self._place, place)
        if off > (0.0 if exact else self._near):
            self.drop()
        if not self._goes_on(view.pose) or self._is_closed_ahead(view):
            self.drop()
            self._search_near_place(view, place, exact=exact)
        return self._take_first_step(view.pose)

    def proceed(self, pose: Pose) -> Command | None:
        """Return the next step of the arcs that were found before, wherever it leads.

        It is None where nothing was found, or the body cannot go on with it.
        """
        return self._take_first_step(pose) if self._goes_on(pose) else None

    def _goes_on(self, pose: Pose) -> bool:
        """Return True if the body is where the last step should have brought it, and can take the next one."""
        expected = self._expected
        return (
            expected is not None
            and math.dist((pose.x, pose.y), (expected.x, expected.y)) <= self._tolerance
            and abs(math.remainder(pose.heading - expected.heading, math.tau)) <= ASKEW
            and bool(self._plan)
            and self._is_free(pose, self._plan[0])
        )

    def _is_closed_ahead(self, view: View) -> bool:
        """Return True if the next step leads from open ground onto a point that has been closed since the search."""
        pose, ground = view.pose, view.ground
        if not self._plan or ground.static is ground or ground.is_closed(*view.point_of((pose.x, pose.y))):
            return False
        # Half-way too: a step may pass over a closed point and end beyond it.
        ends = (advance(pose, self._plan[0], share * self._step) for share in (0.5, 1.0))
        return any(ground.is_closed(*view.point_of((end.x, end.y))) for end in ends)

    def _take_first_step(self, pose: Pose) -> Command | None:
        """Return the first step of the plan; None without one that is free."""
        if not self._plan or not self._is_free(pose, self._plan[0]):
            self.drop()
            return None
        drive = self._plan.popleft()
        self._expected = advance(pose, drive, self._step)
        return drive

    def _search_near_place(self, view: View, place: Spot, *, exact: bool) -> None:
        """Look for arcs that bring the body nearer to a place; none where no way leads there.

        A search ends near the place, or on its very point (`exact`), or where it has made progress. The longest ways
        that count are twice the direct way and a margin; where the body's own way winds more than that, its length and
        a margin.
        """
        turning, pose, start, ground = self._turning, view.pose, view.start, view.ground
        end = ground.join(*place)
        if end is None:
            # Robots do stand on what is closed at this tick.
            ground = ground.static
            end = ground.join(*place)
        if start is None or end is None:
            return
        point, here, goal = ground.terrain.point, (start[0] - 1, start[1] - 1), (end[0] - 1, end[1] - 1)
        margin = MARGIN * turning
        # A bound, since a search over the whole terrain would take long and a detour is seldom longer.
        within = 2.0 * math.dist((pose.x, pose.y), place) + margin
        paths = _paths_to(goal, ground, within)
        if paths.length_to(*here) == FAR:
            paths = _paths_to(goal, ground, math.inf)
        if paths.length_to(*here) == FAR:
            return
        first = paths.length_to(*here) * (point / 100.0)
        # A way that winds needs room for ways around it, or no arc off the shortest way would count.
        if paths.limit < LONGEST and first + margin > within:
            paths = _paths_to(goal, ground, first + margin)
        # The search measures where arcs end from the point of the pose as others hear it. Measured from another point,
        # where the body is might be no nearer than where it began, search after search.
        reported = view.point_of((view.reported.x, view.reported.y))
        if paths.length_to(*reported) < FAR:
            first = paths.length_to(*reported) * (point / 100.0)
        else:
            # It is not known from there: by way of the centre of the point that it joins, which is never too short.
            first = max(first + math.dist(ground.centre(*start), (pose.x, pose.y)), point)
        self._place, self._exact = place, exact
        # Half of the way at most, or a search from close by would end where it begins.
        near = ON_IT * point if exact else min(self._near, 0.5 * first)
        self._search_arcs(view, paths, first, paths.limit, near=near, progress=AHEAD * turning)

    def _search_arcs(
        self, view: View, paths: BoxPaths, first: float, limit: int, *, near: float, progress: float
    ) -> None:
        """Look for arcs that bring the body nearer.

        `first` is the way left from where the body is, m; `limit` is the longest way that counts, in hundredths of a
        point. The way left has to become at most `near`, or else shorter by `progress`, both in m.
        """
        pose, terrain = view.pose, self._terrain
        arcs = np.zeros(MOST_ARCS, dtype=np.int64)
        closed = self._find_closed_points(view)
        # The body may stand nearer to a wall than the clearance, so its first step is judged without it.
        begins = np.array([self._is_free(pose, move.command) for move in self._moves], dtype=np.uint8)
        count = 0
        # A gap that is exactly as wide as the body leaves no clearance.
        for clearance in (CLEARANCE, 0.0):
            if count == 0:
                count = search(
                    terrain.blocked,
                    terrain.room,
                    closed,
                    paths.length,
                    paths.row0,
                    paths.col0,
                    limit,
                    terrain.point,
                    *terrain.origin,
                    pose.x,
                    pose.y,
                    pose.heading,
                    first,
                    self._arcs,
                    begins,
                    GEAR_CHANGE * self._turning,
                    self._cell,
                    self._radius,
                    clearance,
                    self._turning,
                    near,
                    progress,
                    CM_PER_M,
                    0.0 if self._facing is None else self._facing,
                    math.pi if self._facing is None else FACING,
                    MOST_NODES,
                    arcs,
                )
        for index in arcs[:count]:
            move = self._moves[index]
            self._plan.extend([move.command] * move.ticks)

    def _find_closed_points(self, view: View) -> NDArray[np.uint8]:
        """The points that are closed at this tick; of size 0 where there are none or the body is on one of them."""
        ground, here = view.ground, self._terrain.point_at(view.pose.x, view.pose.y)
        closed = None if ground.static is ground else ground.static.open_now & ~ground.open_now
        # A body on a closed point must be able to leave it.
        if closed is None or (self._terrain.inside(*here) and closed[here]):
            return np.zeros((0, 0), dtype=np.uint8)
        return closed.view(np.uint8)


def _paths_to(point: tuple[int, int], ground: Ground, within: float) -> BoxPaths:
    """Find the paths of at most `within` m to a point of the terrain; they are kept where nothing is closed."""
    limit = round(min(LONGEST, 100.0 * within / ground.terrain.point))
    known_paths = ground.kept
    known = known_paths.get(point, NO_PATHS)
    if limit <= known.limit:
        return known._replace(limit=limit)
    box = box_around(point, limit // 100 + 1, ground.terrain.shape)
    paths = paths_in(ground, [point], box, limit)
    if paths.length.size <= MOST_POINTS:
        if len(known_paths) >= MOST_KEPT:
            del known_paths[next(iter(known_paths))]
        known_paths[point] = paths
    return paths
