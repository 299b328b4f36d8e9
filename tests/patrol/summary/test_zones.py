"""Words about zones at the end of a run."""

from __future__ import annotations

import pytest

from patrol.summary.model import Summary, ZoneFigures
from patrol.summary.zones import zone_lines
from patrol.zones.spec import ELSEWHERE


@pytest.mark.parametrize(
    ("zone_s", "wanted_s", "rest_s", "tour_s", "warns"),
    [
        (15.0, 60.0, 500.1, 400.0, True),
        (15.1, 60.0, 500.1, 400.0, False),
        (15.0, 60.0, 500.0, 400.0, False),
        (15.0, None, 500.1, 400.0, False),
        (15.0, 60.0, 500.1, None, False),
    ],
)
def test_a_zone_that_is_seen_far_more_than_wanted_at_the_rests_cost_is_warned_of(
    zone_s: float, wanted_s: float | None, rest_s: float, tour_s: float | None, warns: bool
) -> None:
    zones = {
        "vault": ZoneFigures(mfow_late_mean_s=zone_s, wanted_s=wanted_s, kept_share=1.0),
        ELSEWHERE: ZoneFigures(mfow_late_mean_s=rest_s),
    }
    lines = zone_lines(Summary(mfow_weighted_mean_s=100.0, mfow_weighted_max_s=200.0, best_tour_s=tour_s, zones=zones))
    warning = (
        "            warning: vault was 15.0 s old where 60 s are wanted, and the rest 500.1 s where the best tour "
        "keeps 400.0 s: want a higher age, or add a robot"
    )
    assert [line for line in lines if "warning" in line] == ([warning] if warns else [])
