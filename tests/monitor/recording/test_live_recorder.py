"""A fleet that is recorded while it goes on: when that ends, and when what happened is said to have been."""

import math
from collections.abc import Mapping
from pathlib import Path

from monitor.observation.source import State
from monitor.recording.live_recorder import GONE_S, record_live
from runtime.messages.feed import Batch
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed
from tests.present import present

ENOUGH_S = 300.0
"""Time after which a recorder that does not end is told to."""


class Script(FakeFeed):
    """A wire whose world tells so many records at these times, and is away for a while."""

    def __init__(
        self, seen: Seen, script: Mapping[float, int], away: tuple[float, float] = (math.inf, math.inf)
    ) -> None:
        super().__init__(seen)
        self._script = dict(script)
        self._away = away

    def batch(self, timeout_s: float) -> Batch | None:
        over = self.number == len(self.records)
        self.present = not (over or self._away[0] <= self.now < self._away[1])
        for at in [at for at in self._script if at <= self.now]:
            self.send(self._script.pop(at))
        return super().batch(timeout_s)


def record(wire: FakeFeed, out: Path) -> tuple[State, list[str]]:
    """Record a feed by its own clock; return the last state, and what was said."""
    said: list[str] = []
    end, started = wire.now + ENOUGH_S, "2026-01-02T03:04:05+00:00"
    last = record_live(wire.source(), out, started, lambda: wire.now > end, said.append, lambda: wire.now)
    return present(last), said


def test_a_world_that_comes_back_is_recorded_to_its_end(quiet: Seen, tmp_path: Path) -> None:
    back = 102.0 + 0.8 * GONE_S
    wire = Script(quiet, {100.0: 9, back: 1, back + 2.0 * GONE_S: 10_000}, (102.0, back))
    last, said = record(wire, tmp_path / "out.mcap")
    assert last.ended == "completed"
    assert said[0] == "the world has disconnected"
    assert not any("the recording ends" in line for line in said)
