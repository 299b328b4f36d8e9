"""Notes on a scenario that are shown before a run, and the map check's lines about closures."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.grounds import write_map
from fogwatch.grounds.scenario_notes import closure_lines, scenario_notes
from patrol.prepare import prepare
from patrol.scenario import load_scenario

GROUND = {"terrain": {"builtin": "open"}, "point": 1.0}
FREE = "chooses its next place freely, without a plan"


@pytest.mark.parametrize("policy", ["stochastic", "committed"])
@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"closures": [{"name": "shut", "polygon": [[1, 1], [9, 1], [9, 9]], "closed": [[4, 12]]}]}, "doors may close"),
        ({"sensor": {"kind": "sector", "angle": 90.0}}, "its sensor does not look all around"),
    ],
)
def test_a_patrol_without_a_plan_says_why(settings: dict[str, Any], why: str, policy: str) -> None:
    (note,) = scenario_notes(prepare(load_scenario({**GROUND, **settings, "patrol": {"policy": policy}})))
    assert note.startswith(f"patrol.policy {policy}: each robot {FREE}: {why}")


def test_the_best_plan_is_no_draw() -> None:
    options = {"policy": "stochastic", "options": {"unpredictability": 0.0}}
    (note,) = scenario_notes(prepare(load_scenario({**GROUND, "patrol": options})))
    assert note.startswith("patrol.options.unpredictability = 0: the best plan is followed, and nothing is drawn")


@pytest.mark.parametrize("policy", ["stochastic", "committed", "even-tour"])
def test_a_patrol_with_a_plan_says_nothing(policy: str) -> None:
    assert not scenario_notes(prepare(load_scenario({**GROUND, "patrol": {"policy": policy}})))


SIGHT = "all ground is in sight from the starts (sensor.range = "
SEEING: dict[str, Any] = {**GROUND, "patrol": {"policy": "potential-field"}, "robots": {"count": 1}}


def test_robots_that_see_all_ground_from_their_starts_have_nothing_to_do() -> None:
    (note,) = scenario_notes(prepare(load_scenario({**SEEING, "sensor": {"range": 140.0}})))
    assert note == f"{SIGHT}140 m), so no robot has to move; give --sensor-range if it is less"
    assert not scenario_notes(prepare(load_scenario({**SEEING, "sensor": {"range": 40.0}})))


def test_a_range_that_nobody_gave_is_named_as_the_default(tmp_path: Path) -> None:
    hall = write_map(np.ones((12, 12), dtype=np.bool_), 1.0, tmp_path / "hall.yaml")
    robots = {"count": 1, "radius": 0.3, "starts": [[6, 6]]}
    (note,) = scenario_notes(prepare(load_scenario({**SEEING, "terrain": {"map": str(hall)}, "robots": robots})))
    assert note.startswith(f"{SIGHT}10 m, the default), so")


@pytest.mark.parametrize(
    "settings",
    [
        {"robots": {"count": 1, "spare": 1}, "sensor": {"range": 60.0}},
        {"sensor": {"range": 140.0, "quality": 0.5}},
        {"sensor": {"range": 140.0}, "closures": [{"name": "bay", "polygon": [[5, 5], [9, 5], [9, 9]]}]},
    ],
)
def test_what_gets_old_again_is_not_called_seen(settings: dict[str, Any]) -> None:
    """The spare robot does not look, a look leaves an age, and what is closed is not seen."""
    assert not [note for note in scenario_notes(prepare(load_scenario({**SEEING, **settings}))) if SIGHT in note]


def test_each_closure_says_what_it_closes_out_and_whom_it_shuts_in() -> None:
    robots = {"count": 2, "model": "holonomic", "radius": 0.4, "starts": [[8, 10], [8, 60]]}
    apart = robots | {"starts": [[8, 10], [80, 60]]}
    wall = {"name": "wall", "polygon": [[50, 0], [51, 0], [51, 88], [50, 88]], "closed": [[10, 20]]}
    pen = {"name": "pen", "polygon": [[0, 20], [20, 20], [20, 0], [21, 0], [21, 21], [0, 21]], "closed": [[10, 20]]}
    given = {"terrain": {"builtin": "open"}, "point": 1.0, "robots": robots, "closures": [wall, pen]}
    head, about_wall, about_pen = closure_lines(prepare(load_scenario(given)))
    assert head == "closures: 2"
    assert about_wall.startswith("  wall: 88.0 m², ")
    assert float(about_wall.split("closes out ")[1].split()[0]) > 4000.0
    assert about_pen.endswith("shuts in r1 at the start")
    # Robots on both sides: what lies behind the wall is said all the same.
    _, about_wall, _ = closure_lines(prepare(load_scenario(given | {"robots": apart})))
    assert float(about_wall.split(" m² behind")[0].split()[-1]) > 4000.0
    assert "closes out 88.0 m² from the starts, as robots start on both sides" in about_wall
