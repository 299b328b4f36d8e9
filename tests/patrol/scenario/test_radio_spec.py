from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.files.yaml_text import parse_yaml
from patrol.radio.allowance import Share
from patrol.scenario import as_mapping, dump_scenario, load_scenario, scenario_hash

YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}}
BUDGET = {"bits_per_s": 1200}
AHEAD: dict[str, Any] = {"sensor": {"angle": 90}}


def with_radio(**radio: Any) -> dict[str, Any]:
    return {**YARDS, "radio": radio}


def test_a_scenario_that_says_nothing_of_savings_means_what_it_meant() -> None:
    same = with_radio(trail_every=1, budget=None, adaptive=None)
    assert scenario_hash(load_scenario(same)) == scenario_hash(load_scenario(YARDS))
    radio = as_mapping(load_scenario(YARDS))["radio"]
    assert "budget" not in radio
    assert "adaptive" not in radio


@pytest.mark.parametrize(
    "radio",
    [
        *({"budget": BUDGET}, {"budget": {**BUDGET, "overhead": 8}}, {"budget": {**BUDGET, "frame": 40}}),
        *({"adaptive": adaptive} for adaptive in ({}, {"error": 3}, {"silence": 3})),
        *({"trail": 4, "trail_every": 3}, {"trail": 4}),
    ],
)
def test_each_saving_changes_the_hash_and_survives_being_written_down(radio: dict[str, Any]) -> None:
    scenario = load_scenario(with_radio(**radio))
    assert scenario_hash(scenario) != scenario_hash(load_scenario(YARDS))
    again = parse_yaml(dump_scenario(scenario), "again")
    assert isinstance(again, dict)
    assert load_scenario(again) == scenario


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (with_radio(budget={}), "budget.bits_per_s: missing; give bit/s on the air of all robots together"),
        (with_radio(budget=1200), "budget = 1200: expected keys and values (bits_per_s, overhead, frame)"),
        (with_radio(budget={"bit_per_s": 1}), "budget.bit_per_s: unknown key; did you mean bits_per_s?"),
        (with_radio(bits_per_s=1), "bits_per_s: unknown key; did you mean radio.budget.bits_per_s?"),
        (with_radio(adaptive={"silense": 1}), "adaptive.silense: unknown key; did you mean silence?"),
        (with_radio(budget={"bits_per_s": 0}), "budget.bits_per_s = 0: expected a number above 0"),
        (with_radio(budget={**BUDGET, "overhead": 1001}), "budget.overhead = 1001: expected a whole number from 0"),
        (with_radio(budget={**BUDGET, "frame": 65}), "budget.frame = 65: expected a whole number from 1 to 64"),
        (with_radio(budget={**BUDGET, "frame": 27}), "budget.frame = 27: less than a frame without a trail"),
        (with_radio(budget={**BUDGET, "frame": 37}, key="a"), "budget.frame = 37: less than a frame without"),
        (
            with_radio(trail=4, budget={"bits_per_s": 200}),
            "budget.bits_per_s = 200: so low that a robot may be silent for 11 s, and claims end after 10 s",
        ),
        (
            {**with_radio(budget={"bits_per_s": 200}), "intruders": [{"place": [10, 10]}]},
            "budget.bits_per_s = 200: so low that a robot may be silent for 11.5 s",
        ),
        (with_radio(adaptive={"silence": 10.5}), "adaptive.silence = 10.5: not between one step, 0.5 s, and"),
        (with_radio(adaptive={"silence": 0.4}), "adaptive.silence = 0.4: not between one step, 0.5 s, and"),
        (with_radio(adaptive={"error": -1}), "adaptive.error = -1: expected a number from 0"),
        (with_radio(trail=1, trail_every=16), "trail_every = 16: expected a whole number from 1 to 15"),
        (AHEAD | with_radio(trail=1, trail_every=2), "trail = 1: a trail has places and no headings"),
        (AHEAD | with_radio(trail=1, budget=BUDGET), "trail = 1: a trail has places and no headings"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(raw: dict[str, Any], expected: str) -> None:
    with pytest.raises(BadInput) as caught:
        load_scenario(raw)
    assert f"scenario: radio.{expected}" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("robots", "which"), [({"speed": 5.5}, ""), ([{"speed": 1}, {"speed": 5.5}], r"1\.")])
def test_a_robot_too_fast_for_a_trail_is_told(robots: Any, which: str) -> None:
    says = rf"scenario: robots\.{which}speed = 5\.5: a trail holds steps below 327\.67 m per 15 ticks"
    with pytest.raises(BadInput, match=says):
        load_scenario({**with_radio(trail=4, trail_every=15), "step": 4.0, "watchdog": 9, "robots": robots})


def test_the_share_of_a_robot() -> None:
    def share_of(raw: dict[str, Any]) -> Share:
        share = load_scenario(raw).radio_share
        assert share is not None
        return share

    assert load_scenario(YARDS).radio_share is None
    share = share_of(with_radio(trail=2, budget={**BUDGET, "overhead": 8}))
    assert (share.per_tick, share.frame, share.most) == (120.0, 28 + 1 + 2 * 6, 8 * (41 + 8 + 28 + 8))
    assert share.cost(20) == 224
    spare = share_of({**with_radio(budget=BUDGET), "robots": {"count": 4, "spare": 2}})
    assert spare.per_tick == 100.0, "a robot that joins later takes nothing from the others"
    assert share_of(with_radio(budget={"bits_per_s": 50_000})).most == 10_000.0
