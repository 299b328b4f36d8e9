"""Whole fleets on a ring whose corridors are one-way."""

from __future__ import annotations

from typing import Any

import pytest

from agent.routes.visits import Visits
from fogwatch.inprocess import Outcome, run_in_process
from patrol.ground.terrain import Terrain
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from tests.ring import LOWER, UPPER, ring, zone
from worldsim.checks.check import CheckResult

RIGHT_ROUND = (zone("aisle", LOWER, 0), zone("back", UPPER, 180))


def ran(
    model: str,
    *zones: dict[str, Any],
    duration: float = 600.0,
    on: Terrain | None = None,
    policy: str = "committed",
    faults: tuple[dict[str, Any], ...] = (),
    starts: list[list[float]] | None = None,
) -> Outcome:
    robots: dict[str, Any] = {"count": 3, "model": model, "radius": 0.3, "speed": 1.0}
    if starts is not None:
        robots |= {"count": len(starts), "starts": starts}
    if model == "car":
        robots["turning_radius"] = 0.8
    given = {"terrain": {"builtin": "open"}, "point": 0.5, "duration": duration, "robots": robots, "zones": list(zones)}
    given |= {"sensor": {"range": 3}, "patrol": {"policy": policy}, "faults": list(faults)}
    return run_in_process(prepare(load_scenario(given), on or ring(*zones)), keep=True)


def check_of(outcome: Outcome) -> CheckResult:
    (check,) = (check for check in outcome.verdict.checks if check.name == "one-way zones")
    return check


def passages(outcome: Outcome) -> tuple[int, int]:
    """The number of times that robots passed the lower corridor, with its direction and against it."""
    counts = {1: 0, -1: 0}
    came_in: dict[int, int] = {}
    for record in outcome.journal.ticks:
        for row in record.robots:
            if row.y > 3.5:
                came_in.pop(row.number, None)
            elif not 8.0 < row.x < 12.0:
                side = -1 if row.x < 10.0 else 1
                if came_in.setdefault(row.number, side) != side:
                    counts[side] += 1
                came_in[row.number] = side
    return counts[1], counts[-1]


@pytest.mark.parametrize(
    ("model", "policy"),
    [("holonomic", "committed"), ("differential", "committed"), ("car", "committed"), ("car", "stochastic")],
)
def test_robots_go_round_the_right_way(model: str, policy: str) -> None:
    outcome = ran(model, *RIGHT_ROUND, policy=policy)
    assert outcome.verdict.valid, outcome.verdict.failed
    assert not outcome.verdict.warnings
    assert outcome.summary.seen_share == 1.0
    along, against = passages(outcome)
    assert along > 10
    assert against == 0
    check = check_of(outcome)
    assert check.judged
    assert int(check.detail.split()[0]) > 20
    assert float(check.detail.split()[-4]) <= 0.6
    assert outcome.summary.best_tour_s is not None
    assert outcome.summary.mfow_late_mean_s is not None
    assert outcome.summary.mfow_late_mean_s <= 1.5 * outcome.summary.best_tour_s


def test_robots_that_know_of_no_direction_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ground that they plan on has no one-way zones, and nothing holds their bodies back."""
    monkeypatch.setattr(Visits, "allow", lambda *_: True)
    outcome = ran("holonomic", zone("aisle", LOWER, 0), zone("back", UPPER, 0), duration=120.0, on=ring())
    assert not outcome.verdict.valid
    assert {check.name for check in outcome.verdict.failed} == {"one-way zones"}
    assert " went " in check_of(outcome).detail


@pytest.mark.parametrize("model", ["holonomic", "car"])
def test_a_robot_that_finds_the_corridor_blocked_backs_out_where_it_came_in(model: str) -> None:
    """The other one, ahead of it in the corridor, dies after a few steps."""
    kill = {"kind": "kill", "who": ["r2"], "at": 2}
    starts = [[4.75, 2.25, 0.0], [10.25, 2.25, 0.0]]
    outcome = ran(model, zone("aisle", LOWER, 0), duration=150.0, faults=(kill,), starts=starts)
    assert outcome.verdict.valid, outcome.verdict.failed
    places = [(record.robots[0].x, record.robots[0].y) for record in outcome.journal.ticks]
    first_in = next(k for k, (x, y) in enumerate(places) if 7.0 < x < 12.0 and y < 3.5)
    out = next(k for k, (x, _) in enumerate(places) if k > first_in and not 6.0 <= x <= 14.0)
    assert places[out][0] < 6.0
