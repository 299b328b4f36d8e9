"""Features in fleets of processes: what robots sense of them goes over the wire; the trace is that of one process."""

from pathlib import Path
from typing import Any

import pytest

import fogwatch
from tests.fleets import COARSE, one_and_many

pytestmark = pytest.mark.processes

DISCS: dict[str, Any] = {"count": 2, "model": "holonomic", "radius": 0.4, "speed": 2.0}
SITE: dict[str, Any] = {
    **COARSE,
    "robots": {**DISCS, "count": 3, "speed": 4.0},
    "zones": [
        {"name": "vault", "polygon": [[0, 0], [40, 0], [40, 40], [0, 40]], "weight": 8, "times": [[10, 30]]},
        {"name": "ward", "polygon": [[40, 40], [100, 40], [100, 88], [40, 88]], "speed": 0.5, "times": [[20, 50]]},
    ],
}
BATTERY = {"capacity": 1.0, "idle": 10, "drive": 30, "charge": 200, "start": 0.6}
CLOSURES = [
    {"name": "wall", "polygon": [[50, 0], [51, 0], [51, 88], [50, 88]], "closed": [[5, 40]]},
    {"name": "box", "polygon": [[20, 40], [24, 40], [24, 44], [20, 44]], "closes": 0.1, "opens": 0.1},
]

CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "batteries": (
        {
            "robots": {**DISCS, "speed": 1.5, "battery": BATTERY},
            "docks": [{"place": [30.5, 30.5]}, {"place": [70.5, 60.5]}],
            "faults": [{"kind": "pause", "who": "r2", "at": 10, "for": 5}],
        },
        {"robots": {**DISCS, "speed": 1.5}, "docks": []},
    ),
    "closures": ({"robots": DISCS, "closures": CLOSURES}, {"closures": []}),
    "intruders": (
        {
            "point": 0.5,
            "duration": 40,
            "robots": {"count": 3, "model": "holonomic"},
            "intruders": [{"place": [50.0, 40.0], "for": 30.0}, {"place": [52.0, 43.0]}],
        },
        {"intruders": []},
    ),
    "zones that begin and end": (SITE, {"zones": []}),
}
"""A scenario, and the settings without the feature."""


@pytest.mark.parametrize("feature", CASES)
def test_a_feature_leaves_the_same_trace_and_another_one_than_without(feature: str, tmp_path: Path) -> None:
    given, without = CASES[feature]
    scenario = {**COARSE, "duration": 60, **given}
    one, many = one_and_many(scenario, tmp_path)
    assert many.summary["messages"] == one.summary["messages"]
    assert one.summary["messages"]["rejected"] == 0
    plain = fogwatch.run({**scenario, **without}, out=tmp_path / "plain", picture=False)
    assert plain.trace_hash != one.trace_hash
    if feature == "batteries":
        figures = {name: facts["battery"] for name, facts in many.summary["robots"].items()}
        assert figures == {name: facts["battery"] for name, facts in one.summary["robots"].items()}
        assert any(battery["patrol_share"] < 1.0 for battery in figures.values())
    if feature == "intruders":
        assert one.summary["messages"]["frames"] > 3 * 80
