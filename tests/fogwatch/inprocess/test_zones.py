"""Whole fleets on ground with zones."""

import gc
from pathlib import Path
from typing import Any

import pytest

from agent.policies.common_plan.stations import KnownStations
from fogwatch.inprocess import Outcome, run_in_process
from patrol.journal import TickRecord
from patrol.measures.best_tour import best_tour
from patrol.measures.zoned import MOST_KEPT
from patrol.prepare import prepare
from patrol.scenario import load_scenario

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"

VAULT = {"name": "vault", "polygon": [[0, 0], [40, 0], [40, 30], [0, 30]], "weight": 10}
ROBOTS: dict[str, Any] = {"count": 4, "model": "holonomic", "radius": 0.4, "speed": 4.0}
ROBOT = {key: value for key, value in ROBOTS.items() if key != "count"}
STAIRS = {"name": "stairs", "polygon": [[44, 30], [56, 30], [56, 50], [44, 50]], "keep_out": True}


def ran(*zones: dict[str, Any], faults: tuple[dict[str, Any], ...] = (), duration: float = 200.0) -> Outcome:
    robots = {**ROBOTS, "count": 6}
    given = {"terrain": {"builtin": "yards"}, "point": 0.5, "duration": duration, "robots": robots}
    return run_in_process(prepare(load_scenario(given | {"zones": list(zones), "faults": list(faults)})), keep=False)


def test_a_vault_is_seen_more_often_and_as_often_as_its_tours_allow() -> None:
    zoned = ran(VAULT)
    assert zoned.verdict.valid
    summary = zoned.summary
    assert summary.best_weighted_s is not None
    assert summary.mfow_weighted_late_mean_s is not None
    assert summary.mfow_weighted_late_mean_s <= 2.0 * summary.best_weighted_s
    assert summary.zones["vault"].mfow_late_mean_s < 0.3 * summary.zones["elsewhere"].mfow_late_mean_s


@pytest.mark.parametrize(
    ("corner", "age", "most_shared"),
    [([16.2, 8.2], 60.0, 1.3), ([20.5, 12.0], 60.0, 1.3), ([20.5, 12.0], 20.0, 1.5)],
    ids=["room", "nook", "nook often"],
)
def test_a_wanted_age_is_kept_and_no_better_than_wanted(corner: list[float], age: float, most_shared: float) -> None:
    """The rest gets about as old as two robots keep all of the office."""
    (left, low), (right, high) = corner, (23.8, 13.8)
    vault = {"name": "vault", "polygon": [[left, low], [right, low], [right, high], [left, high]], "age": age}
    given = {"terrain": {"map": str(EXAMPLES / "maps/office.yaml")}, "point": 0.2, "duration": 600, "zones": [vault]}
    robots = {"count": 2, "model": "holonomic", "radius": 0.3, "speed": 1.0}
    prepared = prepare(load_scenario(given | {"robots": robots}))
    outcome = run_in_process(prepared, keep=False)
    both_s = best_tour(prepared).bound_of_fleet_s(prepared.scenario)
    assert outcome.verdict.valid
    assert both_s is not None
    zones = outcome.summary.zones
    assert (zones["vault"].kept_share or 0.0) >= 0.95
    assert zones["elsewhere"].mfow_mean_s <= most_shared * both_s
    assert not [line for line in outcome.verdict.warnings if "trapped" in line]


@pytest.mark.parametrize(
    "faults",
    [
        ({"kind": "loss", "rate": 0.9},),
        ({"kind": "silence", "who": "all"},),
        ({"kind": "loss", "rate": 0.5}, *({"kind": "kill", "who": f"r{k}", "at": 50 + 10 * k} for k in (1, 4))),
    ],
    ids=["loss", "silence", "deaths"],
)
def test_nobody_enters_a_keep_out_and_nobody_is_trapped_under_faults(faults: tuple[dict[str, Any], ...]) -> None:
    """A robot that hears nobody would come back to a vault of weight 10 for most of the time."""
    outcome = ran(VAULT | {"weight": 3}, STAIRS, faults=faults, duration=300.0)
    assert outcome.verdict.valid
    (kept,) = (check for check in outcome.verdict.checks if check.name == "keep-outs")
    assert kept.judged
    assert outcome.summary.seen_share == 1.0
    assert not [line for line in outcome.verdict.warnings if "trapped" in line]


def test_few_weights_are_kept_and_the_trace_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vault's weight comes back after others, and one robot is paused meanwhile."""
    turns = [[5.0 * n, weight] for n, weight in enumerate((2, 3, 4, 5, 2, 6, 7), start=1)]
    given = {"terrain": {"builtin": "open"}, "point": 2.0, "duration": 60, "robots": ROBOTS}
    given |= {"zones": [VAULT | {"weight": 0.5, "weights": turns}]}
    given |= {"faults": [{"kind": "pause", "who": "r2", "at": 7, "for": 19}]}
    hashes = []
    for most in (32, 1):
        monkeypatch.setattr("patrol.measures.zoned.MOST_KEPT", most)
        monkeypatch.setattr("agent.policies.stochastic.MOST_KEPT", most)
        outcome = run_in_process(prepare(load_scenario(given)))
        assert outcome.verdict.valid, outcome.verdict.failed
        assert outcome.journal.end is not None
        hashes.append(outcome.journal.end.trace_hash)
    assert hashes[0] == hashes[1]


def test_spare_robots_change_nothing_until_they_join() -> None:
    battery = {"capacity": 6.0, "idle": 10.0, "drive": 30.0, "charge": 130.0}
    robot = {"model": "holonomic", "radius": 0.4, "speed": 2.0, "battery": battery}
    zone = {**VAULT, "polygon": [[2, 2], [34, 2], [34, 22], [2, 22]]}
    docks = [{"place": [10.5, 10.5]}, {"place": [12.5, 80.5]}]
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 200.0, "zones": [zone], "docks": docks}
    fleets = [[robot] * 4, [robot] * 4 + [{**robot, "spare": True}] * 2]
    few, more = (run_in_process(prepare(load_scenario({**given, "robots": fleet})), keep=False) for fleet in fleets)
    assert few.summary.mfow_mean_s == more.summary.mfow_mean_s
    driven = [outcome.summary.robots[name].distance_m for outcome in (few, more) for name in ("r1", "r2", "r3", "r4")]
    assert driven[:4] == driven[4:]
    figures = [robot.battery for robot in few.summary.robots.values()]
    assert any(battery is not None and battery.charges > 0 for battery in figures)


def test_robots_look_after_a_vault_while_it_weighs() -> None:
    """Late means are those of the second half of the time in force, once the robots have changed their rounds."""
    weighing, counted = (ran(VAULT | {"weight": weight, "times": [[80, 200]]}) for weight in (10, 1.0))
    assert weighing.verdict.valid
    assert weighing.summary.zones["vault"].mfow_late_mean_s < 0.7 * counted.summary.zones["vault"].mfow_late_mean_s
    over = ran(VAULT | {"times": [[0, 50]]})
    assert over.summary.zones["elsewhere"].mfow_late_mean_s < 0.6 * weighing.summary.zones["elsewhere"].mfow_late_mean_s


@pytest.mark.parametrize("policy", ["stochastic", "committed", "potential-field", "greedy"])
def test_bodies_are_slow_in_slow_zones_with_every_policy(policy: str) -> None:
    ward = {"name": "ward", "polygon": [[40, 0], [60, 0], [60, 88], [40, 88]], "speed": 1.0, "times": [[20, 200]]}
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 60.0, "robots": ROBOTS, "zones": [ward]}
    outcome = run_in_process(prepare(load_scenario(given | {"patrol": {"policy": policy}})), keep=False)
    assert outcome.verdict.valid, outcome.verdict.failed
    (kept,) = (check for check in outcome.verdict.checks if check.name == "slow zones")
    assert int(kept.detail.split()[0]) > 20


@pytest.mark.parametrize("policy", ["stochastic", "committed"])
def test_a_robot_that_guards_a_zone_is_not_trapped(policy: str) -> None:
    """Two slow robots: a wanted age of 60 s keeps one of them in the vault."""
    vault = {"name": "vault", "polygon": [[2, 2], [14, 2], [14, 12], [2, 12]], "age": 60}
    robots = {"count": 2, "model": "holonomic", "radius": 0.3, "speed": 1.0}
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 300, "robots": robots, "zones": [vault]}
    outcome = run_in_process(load_scenario({**given, "seed": 1, "patrol": {"policy": policy}}), keep=False)
    assert outcome.verdict.valid
    assert not outcome.verdict.warnings
    assert outcome.summary.zones["vault"].mfow_late_mean_s < 60.0 < outcome.summary.zones["elsewhere"].mfow_late_mean_s


@pytest.mark.parametrize(
    "more",
    [
        {"robots": [{**ROBOT, "speed": speed} for speed in (2.0, 4.0, 5.0)]},
        {"robots": [{**ROBOT, "radius": radius} for radius in (0.3, 0.5, 0.3)]},
        {"robots": {**ROBOTS, "count": 18, "speed": 2.0}},
        {"robots": ROBOTS, "faults": [{"kind": "loss", "rate": 0.5}]},
    ],
    ids=["speeds", "radii", "groups", "loss"],
)
@pytest.mark.parametrize("policy", ["stochastic", "committed"])
def test_any_fleet_comes_by_a_vault_more_often(more: dict[str, Any], policy: str) -> None:
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 240.0, "patrol": {"policy": policy}}
    outcome = run_in_process(load_scenario({**given, "zones": [VAULT], **more}), keep=False)
    assert outcome.verdict.valid, outcome.verdict.failed
    zones = outcome.summary.zones
    assert zones["vault"].mfow_late_mean_s < 0.5 * zones["elsewhere"].mfow_late_mean_s


def test_weights_that_are_no_longer_in_force_are_forgotten() -> None:
    """The vault weighs something else every 2 s."""
    gc.collect()
    before = sum(type(thing) is KnownStations for thing in gc.get_objects())
    turns = [[2.0 * n, 2.0 + n] for n in range(1, 29)]
    given = {"terrain": {"builtin": "open"}, "point": 2.0, "duration": 58.0, "robots": ROBOTS}
    kept = []

    def count(record: TickRecord) -> None:
        if record.k % 20 == 0:
            gc.collect()
            kept.append(sum(type(thing) is KnownStations for thing in gc.get_objects()) - before)

    zone = VAULT | {"weight": 2.0, "weights": turns}
    run_in_process(load_scenario({**given, "zones": [zone]}), keep=False, progress=count)
    assert 4 < max(kept) <= MOST_KEPT + 1
