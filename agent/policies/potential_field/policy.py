"""The paper's policy: stale points pull, near ones more than far ones, and the strongest direction wins.

Except for belief and goal, this is the paper's "Final algorithm": forces along paths (steps 4 and 5), the direction
(step 6), and the methods that keep robots apart.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from agent.policies.potential_field.direction import FuzzySectors, bearings_by_force, bearings_by_vector, repel
from agent.policies.potential_field.field import Field, Pull
from agent.policies.random_steps import RandomSteps
from agent.policies.separation import Separation
from agent.ports import Bearing, Intent, PolicySetup, Stay
from agent.routes.path_window import CENTRE
from agent.view import View
from patrol.random import Purpose
from patrol.scenario import PotentialFieldOptions


class PotentialField:
    """One robot's social potential field (paper, "Final algorithm")."""

    Options = PotentialFieldOptions

    def __init__(self, setup: PolicySetup) -> None:
        """Tabulate the law of attraction and find the critical areas."""
        options, terrain = setup.options, setup.terrain
        self._options = options
        self._tries_others = "one-direction" not in options.paper_rules
        self._stops = "no-stop" not in options.paper_rules
        self._separation = Separation(setup)
        makes_random_steps = options.random_move_for == "all" or setup.spec.model == "holonomic"
        self._random_steps = RandomSteps(options.random_move if makes_random_steps else 0.0)
        self._fuzzy = FuzzySectors(terrain, options.sectors, setup.lengths.fuzzy_distance) if options.fuzzy else None
        self._field = Field(
            options,
            setup.fields,
            setup.posts,
            terrain.point,
            setup.scratch,
            setup.regions,
            lengths=setup.lengths,
            team=setup.team,
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
        pull = self._pull(view, start)
        bearings = self._bearings(pull)
        figures = dict(zip(self._names, pull.sums.tolist(), strict=True))
        if not bearings:
            return Stay(figures=figures) if wander is None else Bearing((), wander=wander, figures=figures)
        centre = view.ground.centre
        near = centre(*pull.near) if self._stops and pull.near is not None else None
        if not self._tries_others:
            return Bearing(bearings[:1], near, wander=wander, figures=figures)
        bend = None if pull.bend is None or pull.bend == start else centre(*pull.bend)
        return Bearing(bearings, near, bend, wander, figures=figures)

    def _pull(self, view: View, start: tuple[int, int]) -> Pull:
        """Return the forces at this tick, modified by other robots and by close obstacles."""
        rivals = [(row, col) for row, col in view.ground.static.join_each(self._separation.rivals(view)).tolist()]
        fog = view.fog
        dilated = partial(fog.dilated_around, (start[0] - 1, start[1] - 1))
        seen = fog.last_seen if fog.left_out is None else np.where(fog.left_out, np.int32(view.tick), fog.last_seen)
        aside, key = CENTRE, 0
        if self._options.origin == "robot":
            (x, y), point = view.ground.centre(*start), view.ground.terrain.point
            aside = (view.pose.y - y) / point, (view.pose.x - x) / point
        if self._options.ties == "drawn":
            key = int(view.draw(0, Purpose.TIES) * 2.0**53)
        now = (view.tick, view.mfow)
        pull = self._field.pull(view.ground, *start, seen, dilated, *now, rivals, fog.looked, aside, key)
        if self._fuzzy is not None:
            np.multiply(pull.sums, self._fuzzy.coefficients(start[0] - 1, start[1] - 1), out=pull.sums)
        if "repulsion" in self._options.separations:
            repel(pull.sums, view.pose, view.peers, self._options)
        return pull

    def _bearings(self, pull: Pull) -> tuple[float, ...]:
        """Return the bearings to try, rad, best first."""
        if self._options.direction == "vector":
            return tuple(bearings_by_vector(float(pull.sums[0]), float(pull.sums[1]), self._options.sectors))
        return tuple(bearings_by_force(pull.sums))
