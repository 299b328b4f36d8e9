"""A run as the terminal shows it while it goes on: its measures, and the robots that are trapped."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from patrol.changing.open_ground import by_driver
from patrol.measures.progress import Trap, Traps
from runtime.messages.telemetry import FREE, TRAPPED, Metrics, Notice, Watcher

if TYPE_CHECKING:
    from patrol.journal import Event, TickRecord
    from worldsim.world import World


class LiveProgress:
    """Turns a world's ticks and events into what is shown of them. It changes nothing."""

    def __init__(self, world: World, now: Callable[[], float]) -> None:
        """Watch a world from its first tick on."""
        scenario = world.scenario
        self._world = world
        self._names = {spec.number: spec.name for spec in scenario.roster}
        self._watcher = Watcher(self._names, world.truth.fog.points, scenario.step, scenario.ticks, now)
        self._open_ground = world.prepared.open_ground()
        self._traps = Traps(world.prepared, self._open_ground)

    def tick(self, record: TickRecord) -> tuple[Metrics | None, list[Notice]]:
        """Take in the next tick; return the measures, when they are due, and notices.

        There is a notice for each robot that is found to be trapped, or no longer is.
        """
        fog = self._world.truth.fog
        here = [row for row in record.robots if not self._world.bodies[row.number].away]
        ground = self._world.truth.footprint.terrain
        self._open_ground.tick(record.k, ground, self._world.closed, *by_driver(here))
        # As a function: the fog is looked at only when a robot may be trapped.
        traps = self._traps.tick(record, lambda: fog.last_seen)
        # A robot that has already stayed long in the next circle is still trapped.
        still_trapped = {trap.robot for trap in traps if trap.until is None}
        notices = [
            self._make_notice(record.k, trap) for trap in traps if trap.until is None or trap.robot not in still_trapped
        ]
        return self._watcher.take(record, self._stalest_place), notices

    def event(self, event: Event) -> Notice:
        """Return an event of the journal as a notice."""
        return self._watcher.notice(event)

    def _stalest_place(self) -> tuple[float, float]:
        return self._world.terrain.centre(*self._world.truth.fog.stalest())

    def _make_notice(self, k: int, trap: Trap) -> Notice:
        kind = TRAPPED if trap.until is None else FREE
        return Notice(k, kind, self._names[trap.robot], trap.told(self._world.step))
