"""The scenario's closures in the world: when they close and open, and how robots see them.

A closure never closes on a body: it waits until all bodies are clear of its points, and the journal says so.

Of the faults `close` and `open` in force on a closure, the one that began last decides. Without one its own times do,
or its draws. These go on meanwhile, so a fault that ends leaves no trace in them.
"""

from __future__ import annotations

import math
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from patrol.areas import is_in_one_of
from patrol.changing.ground import IN_IT, WAITING, WAITS, ChangingFootprint, ClosedPoints, faces
from patrol.exchange import MOST_BLOCKED
from patrol.faults.kinds import Close, OnGround
from patrol.journal import Event
from patrol.journal.records import CLOSED, OPENED, STAYS_OPEN
from patrol.radio.message import as_received
from patrol.random import Purpose, draw

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from patrol.closures.spec import ClosureSpec
    from patrol.prepare import Prepared
    from worldsim.faults import Timeline
    from worldsim.robots.bodies import Body


class Closures:
    """The closures of a world, tick by tick.

    `timeline` may be replaced between ticks by one with the same past.
    """

    def __init__(self, prepared: Prepared, timeline: Timeline) -> None:
        """Begin with all of them open."""
        scenario, self._terrain = prepared.scenario, prepared.terrain
        self.timeline = timeline
        self._specs = scenario.closures
        self._seed, self._step = scenario.seed, scenario.step
        self._closed = ClosedPoints(prepared.closable, prepared.terrain)
        self._drawn = [False] * len(scenario.closures)

    @property
    def closed(self) -> frozenset[str]:
        """Names of the closures that are closed."""
        return frozenset(self._closed.names)

    def tick(self, k: int, bodies: Mapping[int, Body], footprint: ChangingFootprint) -> Iterator[Event]:
        """Close and open what is due before a tick, and yield what happened; call it once for each tick.

        The footprint, on the ground where bodies move, is changed accordingly.
        """
        # All are found before the first takes effect, so that their order does not matter.
        happened = list(self._due_changes(k, bodies))
        for event in happened:
            self._closed.take(event)
        footprint.close(self._closed.grid)
        yield from happened

    def blocked(self, body: Body, footprint: ChangingFootprint) -> tuple[int, ...]:
        """Return what a robot sees blocked or has bumped into: `Sensed.blocked`."""
        grid = self._closed.grid
        if not self._closed.names:
            return ()
        shown = faces(footprint.visible(as_received(body.pose)), grid)
        if body.bumped:
            reach = body.spec.radius + body.spec.speed * self._step + self._terrain.point
            points = np.flatnonzero(grid)
            felt = points[self._point_gaps(points, body) <= reach]
            # What it has bumped into comes first, in case not all fit.
            shown = np.concatenate([felt, np.setdiff1d(shown, felt)])
        return tuple(sorted(shown[:MOST_BLOCKED].tolist()))

    def _due_changes(self, k: int, bodies: Mapping[int, Body]) -> Iterator[Event]:
        held_closed = self._held(k)
        for number, spec in enumerate(self._specs):
            by_itself = self._closes_by_itself(number, spec, k)
            is_closed, is_waiting = spec.name in self._closed.names, spec.name in self._closed.waiting
            if not held_closed.get(spec.name, by_itself):
                if is_closed or is_waiting:
                    yield Event(k, OPENED if is_closed else STAYS_OPEN, None, spec.name)
            elif not is_closed:
                points = self._closed.points[spec.name]
                in_the_way = [body for body in bodies.values() if body.present and self._overlaps_body(points, body)]
                if not in_the_way:
                    yield Event(k, CLOSED, None, spec.name)
                elif not is_waiting:
                    names = ", ".join(body.spec.name for body in in_the_way)
                    yield Event(k, WAITING, in_the_way[0].spec.number, f"{spec.name}{WAITS}{names}{IN_IT}")

    def _held(self, k: int) -> dict[str, bool]:
        """Return whether each closure that a fault decides on in a tick is to be closed, by name."""
        faults = [(entry.begin, entry.fault) for entry in self.timeline.at(k) if isinstance(entry.fault, OnGround)]
        return {fault.part: isinstance(fault, Close) for _, fault in sorted(faults, key=itemgetter(0))}

    def _closes_by_itself(self, number: int, spec: ClosureSpec, k: int) -> bool:
        """Return True if a closure is to be closed in a tick by its times or draws; call it once for each tick."""
        if spec.closed is not None:
            return is_in_one_of(spec.closed, k * self._step)
        if spec.closes is None or spec.opens is None:
            return False
        rate = spec.opens if self._drawn[number] else spec.closes
        if draw(self._seed, Purpose.GROUND, number, k) < -math.expm1(-rate * self._step):
            self._drawn[number] = not self._drawn[number]
        return self._drawn[number]

    def _overlaps_body(self, points: NDArray[np.int64], body: Body) -> bool:
        return bool((self._point_gaps(points, body) < body.spec.radius).any())

    def _point_gaps(self, points: NDArray[np.int64], body: Body) -> NDArray[np.float64]:
        """Return the distance of each point's square from a body's centre, m.

        For example, 0.4 for a point of 0.2 m whose centre is 0.5 m away along x, and 0 for the point under the centre.
        """
        terrain = self._terrain
        rows, cols = np.divmod(points, terrain.width)
        half = 0.5 * terrain.point
        across = np.abs(terrain.origin[0] + cols * terrain.point + half - body.pose.x) - half
        up = np.abs(terrain.origin[1] + rows * terrain.point + half - body.pose.y) - half
        return np.hypot(np.maximum(across, 0.0), np.maximum(up, 0.0))
