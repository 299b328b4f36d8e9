"""The paper's policy: stale points pull, near ones more than far ones, and the strongest direction wins.

Except for belief and goal, this is the paper's "Final algorithm": forces along paths (steps 4 and 5), the direction
(step 6), and the methods that keep robots apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.policies.potential_field.pull.direction import bearings_by_force, bearings_by_vector
from agent.policies.potential_field.pull.fuzzy import FuzzySectors
from agent.policies.potential_field.pull.windows import window_of
from agent.policies.potential_field.separation import (
    artificial_obstacles,
    critical_areas,
    numbered,
    occupied_areas,
    repel,
)
from agent.policies.potential_field.targets.commitment import Commitment
from agent.ports import Bearing, Intent, PolicySetup, Stay
from agent.routes.ground import Area, Disc
from agent.view import View
from patrol.pose import TAU
from patrol.radio.peers import places_of
from patrol.random import Purpose

if TYPE_CHECKING:
    from agent.policies.potential_field.pull.field import Field, Pull

NOBODY: NDArray[np.int64] = np.zeros((0, 2), dtype=np.int64)


class PotentialField:
    """One robot's social potential field (paper, "Final algorithm")."""

    def __init__(self, setup: PolicySetup) -> None:
        """Tabulate the law of attraction and find the critical areas."""
        patrol, lengths, terrain = setup.patrol, setup.lengths, setup.terrain
        self._patrol = patrol
        self._lengths = lengths
        self._point = terrain.point
        self._separations = frozenset(patrol.separations)
        semaphores, reach = "semaphores" in self._separations, setup.fields.reach
        found = critical_areas(patrol, terrain, reach, lengths.critical_width) if semaphores else []
        self._areas = [Area(area) for area in found]
        self._numbered = numbered(found, terrain.shape) if found else None
        self._wanders = patrol.random_move_for == "all" or setup.spec.model == "holonomic"
        self._commitment: Commitment | None = None
        if patrol.commitment == "target":
            height, width = terrain.shape
            sizes = height, width, height + width
            whole = None
            if patrol.paths != "wave":
                whole = window_of(patrol.paths, sizes, setup.scratch, setup.fields.patrolled, setup.regions)
            claims = patrol.claim_width if "claims" in self._separations else 0.0
            self._commitment = Commitment(setup, whole, claims)
        # A committed robot never asks for sums of forces, whose tables, window and kernels are large.
        self._field: Field | None = None
        self._fuzzy: FuzzySectors | None = None
        if self._commitment is None:
            if patrol.avoidance == "fuzzy":
                self._fuzzy = FuzzySectors(terrain, patrol.sectors, lengths.fuzzy_distance)
            from agent.policies.potential_field.pull.field import Field

            self._field = Field(
                patrol,
                setup.fields,
                setup.posts,
                terrain.point,
                setup.scratch,
                setup.regions,
                lengths=lengths,
                team=setup.team,
            )
        names = ("x", "y", "total") if patrol.direction == "vector" else (f"sector {i}" for i in range(patrol.sectors))
        self._names = tuple(names)

    def decide(self, view: View) -> Intent:
        """The strongest direction, and now and then a random one."""
        if not view.contacts:
            # Robots that surround an intruder have to stand near each other.
            self._keep_apart(view)
        start = view.start
        if self._commitment is not None and start is not None:
            intent = self._commitment.decide(view, start, self._rivals, self._random_step(view))
            return Stay() if intent is None else intent
        if start is None:
            # The body has to find its way back to the reachable ground first.
            return Bearing((), wander=self._random_step(view))
        pull, bearings = self._ranked(view, start)
        wander = self._random_step(view)
        figures = dict(zip(self._names, pull.sums.tolist(), strict=True))
        if not bearings:
            return Stay(figures=figures) if wander is None else Bearing((), wander=wander, figures=figures)
        centre = view.ground.centre
        near = None if pull.near is None else centre(*pull.near)
        bend = None if pull.bend is None or pull.bend == start else centre(*pull.bend)
        return Bearing(bearings, near, bend, wander, figures=figures)

    def _random_step(self, view: View) -> float | None:
        """The direction of a random step in rad, now and then; otherwise None."""
        if self._wanders and view.draw(0, Purpose.RANDOM_MOVE) < self._patrol.random_move:
            return TAU * view.draw(1, Purpose.RANDOM_MOVE)
        return None

    def _rivals(self, view: View) -> NDArray[np.int64]:
        """The elements of the static ground where other robots stand, where claims are used."""
        if "claims" not in self._separations:
            return NOBODY
        return view.ground.static.join_each(places_of(view.peers))

    def _keep_apart(self, view: View) -> None:
        """Close artificial obstacles and occupied critical areas for this tick."""
        discs: list[Disc] = []
        if "artificial-obstacles" in self._separations:
            discs = artificial_obstacles(view.pose, view.peers, self._lengths.obstacle_radius, self._point)
        areas = []
        if self._numbered is not None:
            taken = occupied_areas(self._numbered, view.ground.terrain, view.pose, view.peers)
            areas = [self._areas[number - 1] for number in taken]
        if discs or areas:
            view.ground.close(discs, areas)

    def _ranked(self, view: View, start: tuple[int, int]) -> tuple[Pull, Sequence[float]]:
        """The forces at this tick, and the bearings to try, rad, best first."""
        pull = self._pull(view, start)
        return pull, self._bearings(pull)

    def _pull(self, view: View, start: tuple[int, int], *, lead: bool = False) -> Pull:
        """The forces at this tick, modified by other robots and by close obstacles.

        Args:
            view: Of this tick.
            start: The element of the ground on which the robot stands.
            lead: Whether those may be left out that cannot change which way it goes first.
        """
        rivals = [(row, col) for row, col in self._rivals(view).tolist()]
        fog = view.fog
        assert self._field is not None
        dilated = partial(fog.dilated_around, (start[0] - 1, start[1] - 1))
        asked = (view.ground, *start, fog.last_seen, dilated, view.tick, view.mfow, rivals, fog.looked)
        if lead and self._fuzzy is None and "repulsion" not in self._separations:
            return self._field.lead(*asked, fog.blocks)
        pull = self._field.pull(*asked)
        if self._fuzzy is not None:
            np.multiply(pull.sums, self._fuzzy.coefficients(start[0] - 1, start[1] - 1), out=pull.sums)
        if "repulsion" in self._separations:
            repel(pull.sums, view.pose, view.peers, self._patrol)
        return pull

    def _bearings(self, pull: Pull) -> tuple[float, ...]:
        """The bearings to try where no force was left out, rad, best first."""
        if self._patrol.direction == "vector":
            return tuple(bearings_by_vector(float(pull.sums[0]), float(pull.sums[1]), self._patrol.sectors))
        return tuple(bearings_by_force(pull.sums))
