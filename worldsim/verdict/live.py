"""The verdict of a run that is still going on: read from its journal as that grows, and ready soon after its end.

It is the verdict that `worldsim.verdict.judge.judge` gives of the finished journal, for the same reasons:

- A tick is judged once the record after it has come: by then the journal holds all events that the checks of this tick
  look at, which are those before the next tick.
- Operators add faults while the run goes on, and checks are chosen and prepared by all faults of a run. So when an
  operator has changed the scenario, or an event comes too late for its tick, judging begins anew, with all events.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.journal import Event, TickRecord
from patrol.journal.file import GrowingJournal
from patrol.scenario.controls import OPERATOR
from worldsim.verdict.judge import Judge, Verdict

if TYPE_CHECKING:
    from patrol.prepare import Prepared


class LiveJudge:
    """Judges a run of processes while it goes on.

    `prepared` is the scenario with what operators have added so far, `judged` the number of ticks judged.
    """

    def __init__(self, path: Path, prepared: Prepared) -> None:
        """Open the journal, which must have its header, with no tick judged."""
        self.journal = GrowingJournal(path)
        self.prepared = prepared
        self.judged = 0
        self._loaded = prepared
        self._exit_codes: dict[str, int | None] = {"the world": None}  # it has not been seen to end
        self._judge: Judge | None = None
        self._waiting: TickRecord | None = None
        self._ticks = 0

    def read_on(self, progress: Callable[[int], None] = lambda _: None) -> None:
        """Judge the ticks that have been recorded since the last call, except the newest.

        `progress` is called after each tick with the number of ticks judged.
        """
        for record in self.journal.read_on():
            if isinstance(record, TickRecord):
                self._ticks += 1
                if self._judge is not None:
                    self._judge_waiting(progress)
                    self._waiting = record
            elif isinstance(record, Event) and (record.k <= self.judged or self._changes_scenario(record)):
                self._judge = None
        if self._judge is None:
            self._begin_anew(progress)

    def verdict(
        self, exit_codes: Mapping[str, int | None], progress: Callable[[int], None] = lambda _: None
    ) -> Verdict:
        """Judge the rest of the finished journal and return the verdict.

        `exit_codes` are as for `worldsim.verdict.judge.judge`, but must not be empty.
        """
        self.read_on(progress)
        self._judge_waiting(progress)
        self._exit_codes.clear()
        self._exit_codes.update(exit_codes)
        assert self._judge is not None
        return self._judge.verdict()

    def _begin_anew(self, progress: Callable[[int], None]) -> None:
        """Judge all ticks that were read, but the last, with all events that were read."""
        self.prepared = self._loaded.as_operated(self.journal.events)
        self._judge = Judge(self.journal, self._exit_codes, self.prepared)
        self.judged, self._waiting = 0, None
        for record in islice(self.journal.ticks, self._ticks):
            self._judge_waiting(progress)
            self._waiting = record

    def _changes_scenario(self, event: Event) -> bool:
        """Return True if an operator has added to the scenario, and not just paused the run, for example."""
        if event.kind != OPERATOR:
            return False
        return self._loaded.as_operated(self.journal.events).scenario != self.prepared.scenario

    def _judge_waiting(self, progress: Callable[[int], None]) -> None:
        if self._waiting is not None and self._judge is not None:
            self._judge.tick(self._waiting)
            self._waiting = None
            self.judged += 1
            progress(self.judged)
