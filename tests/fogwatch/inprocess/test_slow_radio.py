"""Fleets that save on their radio: what robots believe, how they predict each other, and that runs repeat."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from agent.mind import Mind
from fogwatch.inprocess import Outcome, run_in_process
from patrol.journal import TickRecord
from patrol.scenario import Scenario, load_scenario
from worldsim.world import World

SAVINGS: dict[str, Any] = {"trail": 4, "trail_every": 3, "budget": {"bits_per_s": 900, "overhead": 8}}
SAVINGS["adaptive"] = {"error": 2, "silence": 4}
FAULTS: list[dict[str, Any]] = [
    {"kind": "loss", "rate": 0.3},
    {"kind": "duplicate", "rate": 0.2},
    {"kind": "kill", "at": 20, "who": "r2"},
    {"kind": "restart", "at": 30, "who": "r2"},
    {"kind": "pause", "at": 25, "for": 6, "who": "r3"},
]
LATE: list[dict[str, Any]] = [*FAULTS, {"kind": "delay", "delay": {"uniform": [0, 3]}}]
INTRUDERS = [{"place": [40, 22], "at": 10, "for": 20}]


def scenario(radio: Mapping[str, Any], **more: Any) -> Scenario:
    robots = {"count": 4, "model": "car"}
    described = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 60, "robots": robots, **more}
    return load_scenario({**described, "radio": dict(radio)})


@pytest.mark.parametrize("model", ["car", "holonomic"])
@pytest.mark.parametrize("faults", [[], FAULTS], ids=["calm", "faults"])
def test_nobody_believes_a_place_fresher_than_it_is(model: str, faults: list[dict[str, Any]]) -> None:
    """But for frames that are late: a position counts at the tick at which it comes."""
    compared = staler = 0

    def look(world: World, minds: Mapping[int, Mind]) -> None:
        nonlocal compared, staler
        true = np.maximum(world.truth.fog.last_seen, 0)
        for number in world.living:
            fog = minds[number].belief.fog
            own = fog.patrolled.view(np.bool_)
            later = np.maximum(fog.last_seen[own], 0) - true[own]
            assert later.max() <= 0, f"r{number} at tick {world.tick}"
            compared += 1
            staler += int(np.count_nonzero(later))

    chosen = scenario(SAVINGS, faults=faults, robots={"count": 4, "model": model})
    outcome = run_in_process(chosen, look=look)
    assert outcome.verdict.valid, outcome.verdict.failed
    assert compared > 400
    assert staler > 0, "what nobody was told of stays stale"


def test_a_trail_tells_of_all_looks_but_those_between_its_places() -> None:
    """With a look of every tick told sooner or later, the fogs agree as soon as everybody has sent."""
    told = {"trail": 4, "trail_every": 1, "adaptive": {"error": 1e6, "silence": 2}}
    differ: list[int] = []

    def look(world: World, minds: Mapping[int, Mind]) -> None:
        # Everybody sends in ticks 0, 4, 8, ... and tells of the ticks in between; `look` comes after the tick.
        if (world.tick - 1) % 4:
            return
        true = world.truth.fog.last_seen
        for number in world.living:
            fog = minds[number].belief.fog
            own = fog.patrolled.view(np.bool_)
            differ.append(int(np.count_nonzero(fog.last_seen[own] != true[own])))

    outcome = run_in_process(scenario(told), look=look)
    assert outcome.verdict.valid, outcome.verdict.failed
    assert len(differ) == 4 * 30
    assert set(differ) == {0}


def test_nobody_is_farther_from_where_the_others_expect_it_than_the_error() -> None:
    """Without a budget, and while nothing is lost."""
    records: list[TickRecord] = []
    apart: list[float] = []

    def look(_world: World, minds: Mapping[int, Mind]) -> None:
        record = records[-1]
        for hearer, mind in minds.items():
            expected = mind.belief.peers_at(record.k, mind.facts.sending.predictor)
            for row in record.robots:
                if row.number != hearer:
                    pose = expected[row.number].pose
                    apart.append(math.hypot(pose.x - row.x, pose.y - row.y))

    adaptive = {"trail": 1, "adaptive": {"error": 2, "silence": 4}}
    outcome = run_in_process(scenario(adaptive), progress=records.append, look=look)
    assert outcome.verdict.valid, outcome.verdict.failed
    assert len(apart) == 4 * 3 * 120
    assert max(apart) <= 2.0 + 0.01
    assert outcome.summary.messages.frames < 0.6 * 4 * 120


def trace(outcome: Outcome) -> str:
    assert outcome.journal.end is not None
    return outcome.journal.end.trace_hash


def test_a_fleet_that_saves_repeats_itself() -> None:
    seeds = (1, 1, 2)
    runs = [run_in_process(scenario(SAVINGS, faults=LATE, seed=seed, intruders=INTRUDERS)) for seed in seeds]
    first, again, other = runs
    assert first.verdict.valid, first.verdict.failed
    assert trace(first) == trace(again) != trace(other)


def test_a_budget_that_never_bites_changes_only_the_first_tick() -> None:
    plain = run_in_process(scenario({}))
    rich = run_in_process(scenario({"budget": {"bits_per_s": 100_000}}))
    assert rich.verdict.valid, rich.verdict.failed
    sent = plain.summary.messages.frames - rich.summary.messages.frames
    assert sent == 4, "nobody has earned anything before the first tick"


def test_closures_that_only_one_robot_knows_change_no_prediction() -> None:
    """A sender must foresee what the others make of its last frame, and they may not have seen the closed door."""
    corners = [(x, y) for x in (8, 26, 46, 66, 86) for y in (20, 45, 70)]
    boxes = [[[x, y], [x + 8, y], [x + 8, y + 8], [x, y + 8]] for x, y in corners]
    closures = [{"name": f"c{n}", "polygon": box, "closed": [[0, 1000]]} for n, box in enumerate(boxes)]
    robots = {"count": 3, "speed": 3.0}
    chosen = scenario({"trail": 2, "adaptive": {"error": 2.0}}, closures=closures, robots=robots, seed=1)
    outcome = run_in_process(chosen)
    assert outcome.verdict.valid, outcome.verdict.failed
