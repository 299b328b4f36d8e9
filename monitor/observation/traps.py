"""The trapped robots, as a page shows them: a mark with the time since when, and events.

`patrol.measures.progress` decides. It is given each tick's positions and, when it asks, the fog.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from monitor.observation.source import Trapped
from patrol.changing.ground import ChangingTerrain
from patrol.changing.open_ground import by_driver
from patrol.journal.records import Event
from patrol.measures.progress import Trap, Traps
from patrol.measures.stays import SAMPLE_S
from runtime.messages.telemetry import FREE, TRAPPED

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.changing.ground import Closings
    from patrol.journal.records import TickRecord
    from patrol.prepare import Prepared


class TrapWatch:
    """Follows a patrol tick by tick and finds the trapped robots.

    Ticks may be missing, such as those before a page was opened. A robot that is within the circle of its stay before
    and after a gap counts as having stayed.
    """

    def __init__(self, prepared: Prepared, *, from_start: bool = True) -> None:
        """Start before the first tick.

        With `from_start` the robots start at tick 0; otherwise the first tick is only the first that is known.
        """
        self._open_ground = prepared.open_ground()
        self._ground, self._closed = ChangingTerrain(prepared.terrain), frozenset[str]()
        self._traps = Traps(prepared, self._open_ground)
        self._step = prepared.scenario.step
        self._from_start = from_start
        self._known: int | None = None

    @property
    def open(self) -> dict[int, Trapped]:
        """The robots that are trapped now, by number."""
        return {number: self._trapped_since(trap) for number, trap in self._traps.open.items()}

    def trapped(self, number: int) -> Trapped | None:
        """Return since when a robot has been trapped; None for one that is not."""
        trap = self._traps.open.get(number)
        return None if trap is None else self._trapped_since(trap)

    def tick(
        self, record: TickRecord, last_seen: Callable[[], NDArray[np.int32]], closings: Closings | None = None
    ) -> list[Event]:
        """Process a tick; return an event for each robot found to be trapped in it, or no longer trapped.

        `last_seen` gives the fog after the tick's observations, int32 (h, w), and is called only when needed.
        `closings` is None where it is unknown what is closed.
        """
        if self._known is None:
            self._known = record.k
        # Closing the ground makes its grids anew, so only on a change.
        if closings is not None and closings.names(record.k) != self._closed:
            self._closed = closings.names(record.k)
            self._ground.close(closings.grid(record.k))
        # Whether a wreck was removed is not known here, so each is taken to stand.
        self._open_ground.tick(record.k, self._ground, self._closed, *by_driver(record.robots))
        return [self._make_event(record.k, trap) for trap in self._traps.tick(record, last_seen)]

    def needs_fog(self, k: int) -> bool:
        """Return whether `tick` may ask for the fog of tick k: a robot is trapped, or has stayed for long."""
        return self._traps.needs_fog(k)

    def _trapped_since(self, trap: Trap) -> Trapped:
        first_known = self._known or 0
        exact = (self._from_start and first_known == 0) or (trap.since - first_known) * self._step > SAMPLE_S
        return Trapped(trap.since * self._step, exact)

    def _make_event(self, k: int, trap: Trap) -> Event:
        kind = TRAPPED if trap.until is None else FREE
        return Event(k, kind, trap.robot, trap.told(self._step, "" if self._trapped_since(trap).exact else "before "))
