"""Zones that an operator switches: when they act, what is refused, what robots learn, and the same trace again."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fogwatch.inprocess import run_in_process
from patrol.errors import BadInput
from patrol.journal.records import IN_FORCE, OUT_OF_FORCE, Event
from patrol.prepare import prepare
from patrol.scenario import Scenario, dump_scenario, load_scenario
from patrol.scenario.controls import OPERATOR, amended, as_detail, described, read_control
from patrol.zones.spec import zones_in_force
from tests.fleets import COARSE, end_of
from tests.worldsim.test_operator import again, failed_without_operator, run
from worldsim.verdict.judge import judge
from worldsim.world import World

VAULT = {"name": "vault", "polygon": [[0, 0], [40, 0], [40, 40], [0, 40]], "weight": 8}
WARD = {"name": "ward", "polygon": [[0, 0], [100, 0], [100, 100], [0, 100]], "speed": 0.5, "times": []}
STAIRS = {"name": "stairs", "polygon": [[60, 60], [62, 60], [62, 62], [60, 62]], "keep_out": True}
ROBOTS = {"count": 4, "model": "holonomic", "radius": 0.4, "speed": 4.0}
SITE: dict[str, Any] = {**COARSE, "duration": 30, "robots": ROBOTS, "zones": [VAULT, WARD, STAIRS]}


def switch(name: str, on: bool) -> dict[str, Any]:
    return {"do": "zone", "name": name, "on": on}


def weigh(name: str, weight: float) -> dict[str, Any]:
    return {"do": "zone", "name": name, "weight": weight}


def after(scenario: Scenario, controls: Mapping[int, Sequence[dict[str, Any]]]) -> Scenario:
    """The scenario with what an operator asked for, by tick."""
    for k, some in controls.items():
        for control in some:
            scenario, _ = amended(scenario, k, read_control(control))
    return scenario


SWITCHES = {9: [switch("vault", False)], 20: [switch("ward", True)], 21: [switch("ward", False)]}
SWITCHES |= {30: [switch("vault", True), switch("ward", True)], 44: [switch("vault", False), switch("vault", True)]}


def test_what_is_switched_is_judged_and_gives_the_same_trace_again() -> None:
    prepared = prepare(load_scenario(SITE))
    journal, requests, *_ = run(prepared, SWITCHES)
    assert [answer.text for _, answer in requests.answers if not answer.done] == []
    verdict = judge(journal, {}, prepared)
    assert verdict.valid, verdict.failed
    (slow,) = (check for check in verdict.checks if check.name == "slow zones")
    assert slow.detail == "120 steps in 1 slow zones, none too fast"  # of the last of 30 + 1 ticks nothing follows
    turns = [(event.k, event.kind, event.detail) for event in journal.events if event.kind in (IN_FORCE, OUT_OF_FORCE)]
    off, on = OUT_OF_FORCE, IN_FORCE
    ward = [(20, on, "ward"), (21, off, "ward"), (30, on, "ward")]
    assert turns == [(9, off, "vault"), *ward[:2], (30, on, "vault"), ward[2]]
    again(prepared, journal)
    assert end_of(run_in_process(prepared).journal) != end_of(journal)


WEIGHTS = {10: [weigh("vault", 0.2)], 24: [weigh("vault", 30.0)], 40: [switch("vault", False), weigh("vault", 8.0)]}


def test_a_weight_that_is_changed_is_judged_and_gives_the_same_trace_again() -> None:
    prepared = prepare(load_scenario(SITE))
    journal, requests, *_ = run(prepared, WEIGHTS)
    assert [answer.text for _, answer in requests.answers] == [
        "vault counts 0.2 times from tick 10 on",
        "vault counts 30 times from tick 24 on",
        "vault is out of force from tick 40 on",
        "vault counts 8 times from tick 40 on",
    ]
    verdict = judge(journal, {}, prepared)
    assert verdict.valid, verdict.failed
    assert verdict.zones is not None
    np.testing.assert_equal(vars(verdict.zones), vars(again(prepared, journal).verdict.zones))
    without = run_in_process(prepared)
    assert end_of(without.journal) != end_of(journal)
    assert without.verdict.zones is not None
    assert verdict.zones.figures["mfow_weighted_max_s"] != without.verdict.zones.figures["mfow_weighted_max_s"]


def test_a_scenario_of_changed_weights_comes_back_from_its_file(tmp_path: Path) -> None:
    scenario = after(load_scenario(SITE), WEIGHTS)
    (vault, *_) = scenario.zones
    assert (vault.weight, vault.weights) == (8.0, ((5.0, 0.2), (12.0, 30.0), (20.0, 8.0)))
    assert [vault.weight_at(time_s) for time_s in (0.0, 4.9, 5.0, 12.0, 30.0)] == [8.0, 8.0, 0.2, 30.0, 8.0]
    assert [vault.label_at(time_s) for time_s in (0.0, 6.0)] == ["vault x8", "vault x0.2"]
    (tmp_path / "timeline.yaml").write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(tmp_path / "timeline.yaml") == scenario


def test_robots_learn_a_weight_from_the_world() -> None:
    world = World(prepare(load_scenario(SITE)), operated=True)
    assert {sensed.weights for sensed in world.begin_tick().values()} == {()}
    world.end_tick({})
    for k, weight in ((1, 3.0), (2, 4.0)):
        world.amend(after(world.scenario, {k: [weigh("vault", weight)]}))
        assert {(sensed.zones, sensed.weights) for sensed in world.begin_tick().values()} == {((0, 2), ((0, weight),))}
        world.end_tick({})


def test_of_two_weights_before_one_tick_the_last_holds() -> None:
    asked = {0: [weigh("vault", 4.0)], 4: [weigh("vault", weight) for weight in (3.0, 8.0, 5.0)]}
    scenario = after(load_scenario(SITE), asked)
    assert scenario.zones[0].weights == ((0.0, 4.0), (2.0, 5.0))


def test_an_operators_weight_outlasts_those_of_the_scenario() -> None:
    scenario = load_scenario(SITE | {"zones": [VAULT | {"weights": [[5.0, 3.0], [10.1, 7.0]]}, WARD, STAIRS]})
    held = after(scenario, {15: [weigh("vault", 3.0)]})
    assert held.zones[0].weights == ((5.0, 3.0), (7.5, 3.0))
    later = after(scenario, {21: [weigh("vault", 2.0)]})  # 10.1 s is in the same tick
    assert later.zones[0].weights == ((5.0, 3.0), (10.5, 2.0))
    with pytest.raises(BadInput, match="already"):
        amended(held, 16, read_control(weigh("vault", 3.0)))


def test_a_verdict_that_knows_nothing_of_the_operator_does_not_see_slow_zones_kept() -> None:
    """The ward is, by its times, in force up to tick 19, and robots are fast from tick 9 on."""
    prepared = prepare(load_scenario(SITE | {"zones": [VAULT, WARD | {"times": [[0, 10]]}, STAIRS]}))
    journal, *_ = run(prepared, {9: [switch("ward", False)]})
    assert judge(journal, {}, prepared).valid
    assert failed_without_operator(prepared, journal) == {"slow zones", "zone times"}


def test_the_zones_in_force_follow_the_switches_and_keep_their_past() -> None:
    scenario = after(load_scenario(SITE), SWITCHES)
    held = [zones_in_force(scenario.zones, k * scenario.step) for k in range(scenario.ticks)]
    assert [k for k in range(60) if "vault" in held[k]] == [*range(9), *range(30, 60)]
    assert [k for k in range(60) if "ward" in held[k]] == [20, *range(30, 60)]
    assert all("stairs" in names for names in held)


def test_robots_learn_of_it_from_the_world() -> None:
    world = World(prepare(load_scenario(SITE)), operated=True)
    assert {sensed.zones for sensed in world.begin_tick().values()} == {None}  # by their own scenario
    world.end_tick({})
    scenario, text = amended(world.scenario, 1, read_control(switch("ward", True)))
    assert text == "ward is in force from tick 1 on"
    world.amend(scenario)
    assert {sensed.zones for sensed in world.begin_tick().values()} == {(0, 1, 2)}
    world.end_tick({})
    scenario, text = amended(world.scenario, 2, read_control(switch("vault", False)))
    assert text == "vault is out of force from tick 2 on"
    world.amend(scenario)
    assert {sensed.zones for sensed in world.begin_tick().values()} == {(1, 2)}


def test_a_switch_outlasts_the_zones_times() -> None:
    """An operator can also keep a zone in force that would end, and keep one away that would begin."""
    scenario = load_scenario(SITE | {"zones": [VAULT | {"times": [[1, 4], [6, 9]]}, WARD | {"times": [[5, 8]]}]})
    for name, on in (("vault", True), ("ward", False)):
        scenario, _ = amended(scenario, 4, read_control(switch(name, on)))
        with pytest.raises(BadInput, match="already" if on else "will not be"):
            amended(scenario, 9, read_control(switch(name, on)))
    assert [zone.times for zone in scenario.zones] == [((1.0, scenario.duration),), ()]


@pytest.mark.parametrize(
    ("control", "problem"),
    [
        (switch("stairs", False), "name = stairs: a keep-out always holds; only other zones can be switched"),
        (switch("vault", True), "name = vault: is in force to the end already"),
        (switch("ward", False), "name = ward: is not in force, and will not be"),
        (switch("valt", False), "name = valt: did you mean vault?"),
        ({"do": "zone", "name": "vault"}, "exactly one is needed: on, or a weight"),
        ({**switch("vault", True), "weight": 3.0}, "exactly one is needed: on, or a weight"),
        (weigh("vault", 8.0), "weight = 8: vault counts so many times already"),
        (weigh("ward", 2.0), "name = ward: is no zone with a weight"),
        (weigh("stairs", 2.0), "name = stairs: is no zone with a weight"),
        (weigh("vault", 0.0), "weight = 0.0: expected a number from 0.001 to 1000"),
        (weigh("vault", 1e4), "weight = 10000.0: expected a number from 0.001 to 1000"),
        ({"do": "zone", "name": "vault", "on": 1}, "on = 1: expected true or false"),
        ({"do": "zone", "name": "vault", "on": True, "off": True}, "off: unknown key; known are name, on, weight"),
    ],
)
def test_what_is_refused_in_one_line(control: dict[str, Any], problem: str) -> None:
    with pytest.raises(BadInput) as caught:
        amended(load_scenario(SITE), 5, read_control(control))
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("zones", "name", "problem"), [([], "vault", "control: name = vault: this run has no zones")])
def test_other_sites_are_refused_too(zones: list[dict[str, Any]], name: str, problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        amended(load_scenario(SITE | {"zones": zones}), 5, read_control(switch(name, False)))


def test_what_people_read_of_it() -> None:
    for on, words in ((True, "switches vault on"), (False, "switches vault off")):
        assert described(Event(3, OPERATOR, None, as_detail(read_control(switch("vault", on))))) == words
    control = read_control(weigh("vault", 0.5))
    assert described(Event(3, OPERATOR, None, as_detail(control))) == "lets vault count 0.5 times"
