"""The lines in which a run's summary is printed."""

from __future__ import annotations

import pytest

from fogwatch.terminal.summary_text import measures
from patrol.summary.model import Summary

SIGHT = "all ground stays in sight, so no robot has to move; give --sensor-range if the sensor sees less"


@pytest.mark.parametrize(
    ("late_s", "seen_share", "said"),
    [(0.0, 1.0, True), (0.1, 1.0, False), (0.0, 0.19, False)],  # the last one: a run that ended at its first tick
)
def test_a_fleet_that_had_nothing_to_do_is_named(late_s: float, seen_share: float, said: bool) -> None:
    lines = measures(Summary(ticks=9, mfow_mean_s=0.2, mfow_late_mean_s=late_s, mfow_max_s=1.0, seen_share=seen_share))
    assert (SIGHT in " ".join(lines)) is said
