"""The paper's policy: stale points pull, near ones more than far ones, and the strongest direction wins.

Except for belief and goal, this is the paper's "Final algorithm": forces along paths, summed over all points (steps 4
and 5), the direction (step 6), and the methods that keep robots apart.

The paper leaves open that two robots drift onto the same path, and found repulsion harmful. Positions alone allow
better: *claims* scale the force of each point by 1 / (1 + exp((d - d') / s)), where d is this robot's way to the point,
d' the way of the nearest other robot, and s a width. A point that is 2 s farther away counts 0.12, one that is 2 s
nearer 0.88. Nothing more is sent, and without communication the factor is 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.belief.posts import Posts
from agent.kernels.force import gather
from agent.policies.forces import ForceLaw, FuzzySectors, bearings_by_force, bearings_by_vector, repel, sector_table
from agent.policies.separation import RandomSteps, Separation
from agent.ports import Bearing, Intent, PolicySetup, Stay
from agent.routes.ground import Ground
from agent.routes.path_window import CENTRE, Aside, PathWindow, Place
from agent.routes.wave import Wave
from agent.view import View
from patrol.ground.fields import StaticFields
from patrol.kernels.elementary import exp
from patrol.radio.peers import places_of
from patrol.random import Purpose
from patrol.scenario import BodyLengths, PotentialFieldOptions
from patrol.scenario.lengths import PAPER_LENGTHS
from patrol.scenario.policies import Ties

if TYPE_CHECKING:
    from patrol.regions.split import RegionSplit


FIRST_LOOK = 20.0
"""Path length in m of the first look, whose forces determine the horizon of the second."""

MARGIN = 1.02
"""Factor by which paths are followed beyond the last tick's horizon, so that few ticks take a second look."""

CLOSE_ENOUGH = 0.5
"""A place close by is worth a stop when it pulls with at least this share of the strongest force."""

UNCLAIMED = np.zeros(0)

WIDTHS = 40.0
"""Number of widths beyond which a claim is decided; e^-40 of the force is left, so that there is always some pull."""


@dataclass(frozen=True, slots=True)
class Pull:
    """The forces on a robot."""

    sums: NDArray[np.float64]
    """Of moduli, float64 (sectors,); for the vector method float64 (3,), the sum's x and y, and the sum of moduli."""
    near: tuple[int, int] | None
    """The open element (row, col) of the ground, in sight of the robot, where it should stop because a place close by
    pulls about as hard as any other (see `Field.pull`)."""
    bend: tuple[int, int] | None = None  # the element where the path to the strongest single force first bends


class Field:
    """Sums the forces on a robot over sectors (mode) or as a vector (paper, steps 4 and 5).

    The forces along near paths determine the horizon up to which farther ones can still change the result (see
    `ForceLaw`).
    """

    def __init__(
        self,
        options: PotentialFieldOptions,
        fields: StaticFields,
        posts: Posts,
        point: float,
        scratch: dict[str, PathWindow],
        regions: RegionSplit | None = None,
        *,
        lengths: BodyLengths = PAPER_LENGTHS,
        team: int = 1,
    ) -> None:
        height, width = fields.reach.shape
        sources = int(np.count_nonzero(fields.patrolled))
        self.law = ForceLaw(options, point, sources, longest=400 * (height + width), team=team)
        span = min(max(height, width), -(-self.law.limit // 100))
        ties = options.ties if "first-step" in options.paper_rules else None
        sizes = (height, width, span)
        self.paths = window_of(options.paths, sizes, scratch, fields.patrolled, regions, ties)
        self._point = point
        self._nearby = min(self.law.limit, round(100.0 * lengths.goal_distance / point))
        self._posts = posts
        self._share = share_table(options.claim_width, point) if "claims" in options.separations else UNCLAIMED
        self._as_vector = options.direction == "vector"
        self._sector = sector_table(options.sectors, span + 1)
        self._sectors = options.sectors
        self._expected = round(100.0 * FIRST_LOOK / point)
        self._settled = 0
        self._clear = int(np.count_nonzero(self._share == 1.0)) - self._share.size // 2
        self._first = min(self.law.limit, self._expected)

    def pull(
        self,
        ground: Ground,
        row: int,  # of the robot's open element in `Ground.state`
        col: int,
        seen: NDArray[np.int32],  # (h, w), last-seen ticks before dilatation
        dilated: Callable[[int], NDArray[np.int32]],  # the same after it, for so many rows and columns around the robot
        tick: int,
        mfow: int,  # age of the stalest point, ticks
        rivals: Sequence[Place] = (),  # elements of the static ground; with claims only
        looked: NDArray[np.int32] | None = None,  # ticks when last in view, for looks that leave some age
        aside: Aside = CENTRE,  # from the element's centre to where straight paths begin
        key: int = 0,  # of the draws between equally long paths
    ) -> Pull:
        """Return the forces on a robot.

        Dilatation attracts a robot to a small stale place, and close to it pulls equally from all sides. So where a
        path of at most the goal distance leads to a place that pulls, without dilatation, at least `CLOSE_ENOUGH` times
        as hard as the strongest one does with it, the result also names that place, or the first bend on the way to it.
        """
        by_age = self.law.pull(mfow)
        self._claim_points(ground, row, col, rivals)
        self.paths.begin(ground, row, col, aside, key)
        # Paths as long as at the last tick are likely to be asked for again: one wave is faster than three.
        self._settled = min(self.law.limit, self._expected)
        self.paths.extend(self._settled)
        nearby = self._make_forces()
        self._gather_forces(0, self._nearby, seen, seen, tick, by_age, nearby, looked)
        forces = self._make_forces()
        first = self._first
        self._gather_forces(0, first, dilated(self._find_span(first)), seen, tick, by_age, forces)
        horizon = self._find_horizon(forces, by_age)
        self._expected = round(horizon * MARGIN)
        if horizon > first:
            self._gather_forces(first, horizon, dilated(self._find_span(horizon)), seen, tick, by_age, forces)
        close = nearby.strongest[0] >= CLOSE_ENOUGH * forces.strongest[0]
        return Pull(forces.sums, self._find_bend(nearby) if close else None, self._find_bend(forces))

    def _find_horizon(self, forces: _Forces, by_age: NDArray[np.float64]) -> int:
        """Return the longest path to be followed, by the forces of the first look; see `ForceLaw`."""
        exerted = float(forces.sums[2] if self._as_vector else forces.sums.sum())
        return max(self._first, self.law.horizon(exerted, float(by_age[-1])))

    def _find_span(self, length: int) -> int:
        """Return the most rows and columns that a path reaches, by its length in hundredths of a point."""
        return min(self.paths.span, -(-length // 100))

    def _find_bend(self, forces: _Forces) -> tuple[int, int] | None:
        """Return the element of the ground where the path to the strongest of some forces first bends."""
        if forces.strongest[0] <= 0.0:
            return None
        up, across = divmod(int(self.paths.bend.reshape(-1)[forces.source[0]]), self.paths.state.shape[1])
        return up + self.paths.row0 + 1, across + self.paths.col0 + 1

    def _claim_points(self, ground: Ground, row: int, col: int, rivals: Sequence[Place]) -> None:
        """Compute how near the rivals are to every point, before the window is used for the robot's own paths.

        The rivals' paths ignore ground closed to this robot, above all a disc around the rival itself. They are
        followed until they leave the whole of each force.
        """
        self._contest = _Contest(self.paths.length, UNCLAIMED)
        if self._share.size and rivals:
            limit = min(self.law.limit, self.law.limit - self._clear + 1)
            lengths = self.paths.lengths_from(ground.static, row, col, rivals, limit)
            self._contest = _Contest(lengths, self._share)

    def _make_forces(self) -> _Forces:
        return _Forces(np.zeros(3 if self._as_vector else self._sectors), np.zeros(1), np.zeros(1, dtype=np.int64))

    def _gather_forces(
        self,
        first: int,
        last: int,
        standing: NDArray[np.int32],
        beyond: NDArray[np.int32],
        tick: int,
        by_age: NDArray[np.float64],
        forces: _Forces,
        looked: NDArray[np.int32] | None = None,
    ) -> None:
        """Add the forces along paths longer than ``first`` and at most as long as ``last``, in hundredths of a point.

        Points where the body fits take their last-seen ticks from ``standing``, the others from ``beyond``. Those are
        never dilated: a point that looks stale because its neighbour is would attract the robot to the wrong post.
        """
        paths = self.paths
        if last > self._settled:
            paths.extend(last)
            self._settled = last
        span = self._find_span(last)
        grids = (paths.state, paths.length, paths.bend)
        window = (paths.start_row, paths.start_col, *paths.aside, paths.row0, paths.col0)
        law = (tick, by_age, self.law.decay, *self._contest, self._sector, self._as_vector)
        here = paths.row0 + paths.start_row
        posts = self._posts.between(here - span, here + span)
        parts = [(None, standing), (posts, beyond)] if len(posts) else [(None, standing)]
        for points, last_seen in parts:
            gather(
                points,
                *grids,
                first,
                last,
                span,
                *window,
                last_seen,
                last_seen if looked is None else looked,
                *law,
                *forces,
            )


class _Contest(NamedTuple):
    """Path lengths from the rivals, and the shares that they leave (`gather` in `kernels/force.py`)."""

    rival: NDArray[np.int32]
    share: NDArray[np.float64]


class _Forces(NamedTuple):
    """The sums that the kernels add to: see `agent.kernels.force.gather`."""

    sums: NDArray[np.float64]
    strongest: NDArray[np.float64]
    source: NDArray[np.int64]


def share_table(width_m: float, point: float) -> NDArray[np.float64]:
    """Return the share that is left of a force, by how much farther away the robot is than its nearest rival.

    It is float64 (2 m + 1,). The index is the difference of the path lengths, d - d', in hundredths of a point, plus m.
    """
    width = 100.0 * width_m / point
    reach = round(WIDTHS * width)
    return 1.0 / (1.0 + exp(np.arange(-reach, reach + 1) / width))


def window_of(
    paths: str,  # name of the path method
    sizes: tuple[int, int, int],  # the terrain's height and width, and the window's span, in points
    scratch: dict[str, PathWindow],
    patrolled: NDArray[np.bool_],  # (h, w), for straight paths
    regions: RegionSplit | None,  # for paths through regions
    ties: Ties | None = None,  # for a wave that gives first steps in place of first bends
) -> PathWindow:
    """Return the window of a path method: one from ``scratch``, or a new one, which is added there."""
    key = f"{paths} {sizes} {ties}"
    make: Callable[[], PathWindow] = partial(Wave, *sizes, ties)
    # A window holds a reference to the object whose id is in its key, so no other object can get that id.
    if paths == "regions":
        if regions is None:
            raise ValueError("paths through regions need a split")
        from agent.routes.region_paths import Regions

        key, make = f"{key} {id(regions.parts)}", partial(Regions, *sizes, regions)
    elif paths == "straight":
        from agent.routes.straight import Straight

        key, make = f"{key} {id(patrolled)}", partial(Straight, *sizes, patrolled)
    if key not in scratch:
        scratch[key] = make()
    return scratch[key]


class PotentialField:
    """One robot's social potential field (paper, "Final algorithm")."""

    Options = PotentialFieldOptions

    def __init__(self, setup: PolicySetup) -> None:
        """Tabulate the law of attraction and find the critical areas."""
        options, spec, ground, lengths = setup.options, setup.robot.spec, setup.ground, setup.robot.lengths
        self._options = options
        self._tries_others = "one-direction" not in options.paper_rules
        self._stops = "no-stop" not in options.paper_rules
        self._separation = Separation(setup)
        self._random_steps = RandomSteps(options.random_move)
        self._fuzzy = FuzzySectors(ground.terrain, options.sectors, lengths.fuzzy_distance) if options.fuzzy else None
        self._field = Field(
            options,
            ground.fields,
            ground.posts,
            ground.terrain.point,
            ground.scratch,
            ground.prepared.regions.get(spec.number),
            lengths=lengths,
            team=setup.fleet.team,
        )
        sectors = tuple(f"sector {i}" for i in range(options.sectors))
        self._names = ("x", "y", "total") if options.direction == "vector" else sectors

    def decide(self, view: View) -> Intent:
        """Return the strongest direction, and now and then a random one."""
        self._separation.keep_apart(view)
        start = view.start
        wander = self._random_steps.draw(view)
        if start is None:
            # The body has to find its way back to the reachable ground first.
            return Bearing((), wander=wander)
        pull = self._find_pull(view, start)
        bearings = self._list_bearings(pull)
        figures = dict(zip(self._names, pull.sums.tolist(), strict=True))
        if not bearings:
            return Stay(figures=figures) if wander is None else Bearing((), wander=wander, figures=figures)
        centre = view.ground.centre
        near = centre(*pull.near) if self._stops and pull.near is not None else None
        if not self._tries_others:
            return Bearing(bearings[:1], near, wander=wander, figures=figures)
        bend = None if pull.bend is None or pull.bend == start else centre(*pull.bend)
        return Bearing(bearings, near, bend, wander, figures=figures)

    def _find_pull(self, view: View, start: tuple[int, int]) -> Pull:
        """Return the forces at this tick, modified by other robots and by close obstacles."""
        rivals: list[Place] = []
        if "claims" in self._options.separations:
            rivals = [(row, col) for row, col in view.ground.static.join_each(places_of(view.peers)).tolist()]
        fog = view.fog
        dilated = partial(fog.dilated_around, (start[0] - 1, start[1] - 1))
        aside, key = CENTRE, 0
        if self._options.origin == "robot":
            (x, y), point = view.ground.centre(*start), view.ground.terrain.point
            aside = (view.pose.y - y) / point, (view.pose.x - x) / point
        if self._options.ties == "drawn":
            key = int(view.draw(0, Purpose.TIES) * 2.0**53)
        now = (view.tick, view.mfow)
        pull = self._field.pull(view.ground, *start, fog.last_seen, dilated, *now, rivals, fog.looked, aside, key)
        if self._fuzzy is not None:
            np.multiply(pull.sums, self._fuzzy.coefficients(start[0] - 1, start[1] - 1), out=pull.sums)
        if "repulsion" in self._options.separations:
            repel(pull.sums, view.pose, view.peers, self._options)
        return pull

    def _list_bearings(self, pull: Pull) -> tuple[float, ...]:
        """Return the bearings to try, rad, best first."""
        if self._options.direction == "vector":
            return tuple(bearings_by_vector(float(pull.sums[0]), float(pull.sums[1]), self._options.sectors))
        return tuple(bearings_by_force(pull.sums))
