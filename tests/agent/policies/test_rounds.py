"""On the round: the ground is kept as fresh as the tour promises, evenly spaced, and a death is made up for."""

import itertools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from agent.policies.choice import FreeChoice
from agent.policies.committed import Committed, Comparison, OnRound
from agent.ports import State
from fogwatch.inprocess import run_in_process
from patrol.pose import MODELS, Pose
from patrol.scenario import load_scenario, open_scenario
from tests.agent.minds import STEP
from tests.agent.plans import POINT, Robots, prepared_in, two_rooms
from tests.present import present
from tests.random_building import Building
from worldsim.world import World

# Not the product's own, so that a wrong one there is noticed.
BROKEN = 1.3
PERIOD_S = 300.0
PERIODS = 6
NO_NEARER_S = 15.0

ROUND = {"robots.count": 3, "robots.model": "holonomic", "point": 1.0, "duration": 400, "sensor.range": 20}
ROUND |= {"patrol.policy": "committed"}
BASE = {"radius": 0.3, "speed": 1.0, "turning_radius": 1.0}
CORNER = Pose(2.0, 2.0, 0.0)


def mfow_by_tour(terrain: str = "yards", **changes: object) -> list[float]:
    """The MFoW after each tick of a run, in terms of what the best tour promises."""
    scenario = open_scenario(terrain, {**ROUND, **changes})
    ticks: list[float] = []
    outcome = run_in_process(scenario, progress=lambda record: ticks.append(record.mfow * scenario.step))
    assert outcome.verdict.outcome == "valid"
    tour = present(outcome.summary.best_tour_s)
    return [mfow / tour for mfow in ticks]


def test_the_fog_stays_as_fresh_as_the_tour_promises() -> None:
    late = mfow_by_tour()[200:]
    assert np.mean(late) < 1.1
    assert max(late) < 1.25


def test_vertices_are_seen_as_often_by_a_sensor_that_sees_less_far_than_a_stride() -> None:
    places = [[10, 10], [50, 10], [90, 10], [90, 78], [50, 78], [10, 78]]
    graph = {"vertices": places, "edges": [[a, (a + 1) % 6, 40] for a in range(6)]}
    facts = {"terrain.graph": graph, "terrain.patrolled": "vertices", "sensor.range": 1.2}
    assert np.mean(mfow_by_tour("open", **facts)[400:]) < 1.1


def test_the_gaps_close_within_two_tours_after_a_death() -> None:
    ratios = mfow_by_tour(faults=[{"kind": "kill", "who": "r2", "at": 150, "wreck": "removed"}], duration=700)
    # Two robots are left: their promise is half as good again.
    assert np.mean(ratios[-300:]) < 1.15 * 1.5


def test_a_robot_that_died_on_the_round_blocks_no_patrol(tmp_path: Path) -> None:
    """Two rooms, the first with five walls in it, a corridor of a body's width, and in it a robot that dies at once."""
    free = np.zeros((70, 220), dtype=np.bool_)
    free[5:65, 5:65] = free[5:65, 155:215] = free[31:39, 65:155] = True
    for col in range(10, 60, 10):
        free[5:45, col : col + 2] = False
    robots = [{**BASE, "model": "holonomic", "start": start} for start in ([11.0, 3.5], [2.0, 5.5], [4.0, 5.5])]
    facts = {"terrain": {"map": str(Building(free, 0.1).write(tmp_path))}, "point": 0.1, "duration": 200}
    faults = [{"kind": "kill", "who": "r1", "at": 1.0}]
    scenario = load_scenario({**facts, "robots": robots, "faults": faults, "patrol": {"policy": "committed"}})
    ages_s: list[float] = []

    def look(world: World, _minds: object) -> None:
        last_seen = world.truth.fog.last_seen[:, :65][free[:, :65]]
        ages_s.append((world.tick - last_seen.min()) * scenario.step)

    run_in_process(scenario, look=look)
    assert max(ages_s[200:]) < 60.0


@pytest.mark.parametrize(
    ("kind", "free"),
    [
        ({"sensor.angle": 120}, True),
        ({"sensor.quality": 0.5}, True),
        ({"robots": [{"speed": 4.4}, {"speed": 4.4}]}, False),
        ({"robots": [{"speed": 4.4}, {"speed": 2.2}]}, True),
    ],
    ids=["sector", "poor", "equal", "speeds"],
)
def test_robots_choose_freely_where_no_tour_is_seen_or_speeds_differ(kind: dict[str, object], free: bool) -> None:
    scenario = open_scenario("yards", {**ROUND, "duration": 5, **kind})

    def look(_world: object, by_number: object) -> None:
        minds = by_number.values()  # type: ignore[attr-defined]
        assert {isinstance(mind.policy.otherwise.choice, FreeChoice) for mind in minds} == {free}

    run_in_process(scenario, look=look)


@pytest.mark.parametrize("model", MODELS)
def test_a_robot_drives_on_along_the_round_while_others_see_everything(model: str) -> None:
    one = Robots(prepared_in(two_rooms(), [CORNER], {**BASE, "model": model}, patrol={"policy": "committed"}))
    fog, moved = one.minds[0].belief.fog, []
    for _ in range(200):
        before = one.bodies[0].pose
        one.tick()
        fog.last_seen[one.prepared.patrolled] = one.k
        moved.append(one.apart((before.x, before.y)) > 0.0)
    assert isinstance(one.policy(Committed).choice, OnRound)
    halts = [len(list(run)) for drives, run in itertools.groupby(moved) if not drives]
    assert max(halts, default=0) <= 5


def test_a_robot_keeps_its_place_on_the_round_while_the_way_ahead_is_blocked_for_a_short_time() -> None:
    body, patrol = {**BASE, "model": "holonomic"}, {"policy": "committed"}
    robots = Robots(prepared_in(two_rooms(), [CORNER], body, patrol=patrol, sensor={"range": 3.0}))
    policy, mind = robots.policy(Committed), robots.minds[0]
    assert isinstance(policy.choice, OnRound)
    ahead = policy.choice.ahead

    def leaves_the_room() -> bool:
        target = policy.pursuit.target
        return target is not None and target.stand[1] * POINT > 9.6 and robots.bodies[0].pose.x < 9.0

    robots.until(leaves_the_room, 100)
    place = present(ahead.cursor)
    mind.body.obstacles = lambda *_: [(11.0, 4.0, 1.5)]  # type: ignore[method-assign]
    states = set()
    for _ in range(round(NO_NEARER_S / STEP)):
        (decision,) = robots.tick()
        target = policy.pursuit.target
        states.add(decision.state)
        assert decision.state == (State.HOLDING if target is None else State.FREE)
        # Meanwhile it looks at its own room.
        assert target is None or target.stand[1] * POINT < 9.6
        assert ahead.cursor == place
    assert State.FREE in states
    robots.until(lambda: ahead.cursor != place, 100)


# --- round or free choices: what robots measure decides, and is measured again ---------------------------------------


TOUR_S, ROBOTS = 80.0, 2
PROMISED_S = TOUR_S / ROBOTS


def periods(
    round_s: float,
    free_s: float,
    number: int,
    joined: float = 0.0,
    robots: int = ROBOTS,
    lossy: bool = False,
    crowded: bool = False,
) -> str:
    """The mode of each period, R or F, for a robot that joins then; ground gets so old on the round and freely."""
    comparison = Comparison(STEP, TOUR_S, ROBOTS, crowded)
    modes = ""
    for tick in range(int(joined * PERIOD_S / STEP), int(number * PERIOD_S / STEP)):
        mfow_s = round_s if comparison.on_round else free_s
        view: Any = SimpleNamespace(tick=tick, fog=SimpleNamespace(mfow=lambda _tick, s=mfow_s: round(s / STEP)))
        comparison.note(view, robots, lossy)
        if tick % (PERIOD_S / STEP) == 1:
            modes += "R" if comparison.on_round else "F"
    return modes


@pytest.mark.parametrize("free_s", [10.0, 100.0])
def test_a_round_that_keeps_its_promise_is_followed(free_s: float) -> None:
    assert periods(0.99 * BROKEN * PROMISED_S, free_s, 6) == "RRRRRR"


def test_a_round_that_does_not_is_left_for_free_choices_if_they_are_fresher() -> None:
    assert periods(60.0, 50.0, PERIODS) == "RFFFFF"
    assert periods(60.0, 70.0, PERIODS) == "RFRRRR"


def test_crowded_robots_try_free_choices_in_any_case() -> None:
    assert periods(0.7 * PROMISED_S, 0.5 * PROMISED_S, PERIODS, crowded=True) == "RFFFFF"
    assert periods(0.7 * PROMISED_S, 0.9 * PROMISED_S, PERIODS, crowded=True) == "RFRRRR"


def test_fewer_robots_are_promised_less() -> None:
    assert periods(1.2 * TOUR_S, 50.0, 3, robots=1) == "RRR"


def test_where_many_positions_are_lost_the_round_is_kept() -> None:
    assert periods(60.0, 50.0, 3, lossy=True) == "RRR"


def test_the_round_is_tried_again() -> None:
    assert periods(60.0, 50.0, 2 * PERIODS + 2) == "RFFFFFRFFFFFRF"


@pytest.mark.parametrize("joined", [1.1, 2.4, 3.9])
def test_a_robot_that_joins_agrees_from_the_next_beginning_on(joined: float) -> None:
    """Its own fog of the period in which it joins says nothing of what the fleet keeps."""
    later = periods(60.0, 50.0, 2 * PERIODS, joined)
    assert later[-PERIODS:] == periods(60.0, 50.0, PERIODS)
    assert periods(1e4, 50.0, int(joined) + 2, joined) == "R"
