"""Whole fleets among doors and boxes that close."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fogwatch.inprocess import Outcome, run_in_process
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from tests.monitor.conftest import DOORS, run_of

ELLIPSE = Path(__file__).parents[3] / "examples" / "elliptic_sensor.py"
WALL = {"name": "wall", "polygon": [[48, 0], [50, 0], [50, 88], [48, 88]]}
BOX = {"name": "box", "polygon": [[20, 20], [26, 20], [26, 26], [20, 26]], "closes": 0.05, "opens": 0.05}


def ran(*closures: dict[str, Any], duration: float = 150.0, count: int = 3, **more: Any) -> Outcome:
    robots = {"count": count, "model": "holonomic", "radius": 0.4, "speed": 4.0, "turning_radius": 1.5}
    given: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": duration, "robots": robots}
    given["robots"] |= more.pop("robots", {})
    return run_in_process(prepare(load_scenario(given | {"closures": list(closures)} | more)))


@pytest.mark.parametrize("model", ["holonomic", "differential", "car"])
def test_bodies_of_all_models_keep_out_and_go_on(model: str) -> None:
    outcome = ran({**WALL, "closed": [[20, 60], [90, 110]]}, BOX, robots={"model": model})
    assert outcome.verdict.valid, outcome.verdict.failed
    summary = outcome.summary
    assert summary.closures["wall"].closings == 2
    assert summary.closures["wall"].closed_s <= 60.0
    assert summary.closures["box"].closings > 0
    assert summary.seen_share is not None
    assert summary.seen_share > 0.99
    assert not [line for line in outcome.verdict.warnings if "trapped" in line]


@pytest.mark.parametrize("model", ["holonomic", "car"])
def test_a_sensor_of_ones_own_sees_what_is_closed(model: str, tmp_path: Path) -> None:
    """An ellipse sees little to the sides; the only robot believes what it truly sees."""
    sensor = {"kind": f"{ELLIPSE}:Ellipse", "range": 12.0, "options": {"across": 4.0}}
    boxes = [
        [(x + dx, y + dy) for dx, dy in ((0, 0), (3, 0), (3, 3), (0, 3))] for x, y in ((10, 30), (60, 40), (15, 60))
    ]
    closures = [{**BOX, "name": f"box{number}", "polygon": box} for number, box in enumerate(boxes)]
    robots = {"count": 1, "model": model}
    seen = run_of(tmp_path, {**DOORS, "duration": 100, "robots": robots, "sensor": sensor, "closures": closures})
    verdict = seen.open().stated.verdict
    assert verdict is not None
    assert verdict.valid
    assert sum(facts.closings for facts in seen.open().stated.closures.values()) > 3
    assert all(np.array_equal(believed, seen.truth[k]) for (k, _), believed in seen.beliefs.items())
    outcome = ran({**WALL, "closed": [[20, 60], [90, 110]]}, BOX, robots={"model": model}, sensor=sensor)
    assert outcome.verdict.valid, outcome.verdict.failed
    assert outcome.summary.closures["wall"].closings == 2
    assert not [line for line in outcome.verdict.warnings if "trapped" in line]


def test_ground_behind_a_wall_is_closed_out_and_reported() -> None:
    outcome = ran({**WALL, "closed": [[0, 230]]}, robots={"starts": [[8, 10], [8, 80], [10, 44]]}, duration=240.0)
    assert outcome.verdict.valid, outcome.verdict.failed
    summary = outcome.summary
    assert summary.closed_out_share is not None
    assert summary.mfow_reachable_max_s is not None
    assert summary.mfow_max_s is not None
    assert 0.3 < summary.closed_out_share < 0.7
    assert summary.mfow_max_s > 230.0
    assert summary.best_tour_s is not None
    assert summary.mfow_reachable_max_s < 4.0 * summary.best_tour_s
    assert not outcome.verdict.warnings
    said = next(check.detail for check in outcome.verdict.checks if check.name == "progress")
    assert "are closed out at the end" in said


@pytest.mark.parametrize("policy", ["potential-field", "sebs", "cr", "even-tour"])
def test_other_policies_keep_going_too(policy: str) -> None:
    outcome = ran({**WALL, "closed": [[20, 60]]}, BOX, patrol={"policy": policy}, duration=120.0)
    assert outcome.verdict.valid, outcome.verdict.failed
    assert not [line for line in outcome.verdict.warnings if "trapped" in line]
    assert min(robot.distance_m for robot in outcome.summary.robots.values()) > 40.0


def test_a_closure_that_never_closes_changes_nothing_but_what_is_shared() -> None:
    """For a policy without a plan: one with a plan has none where doors may close."""
    never, patrol = {**BOX, "closes": 1e-9, "opens": 1.0}, {"policy": "potential-field"}
    open_run, closures_run = ran(patrol=patrol), ran(never, patrol=patrol)
    traces = [outcome.journal.end.trace_hash for outcome in (open_run, closures_run) if outcome.journal.end]
    assert traces[0] == traces[1]
