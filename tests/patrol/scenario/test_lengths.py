from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.scenario import (
    PatrolSpec,
    PotentialFieldOptions,
    as_mapping,
    dump_scenario,
    load_scenario,
    parse_overrides,
    scenario_hash,
    with_spares,
)
from patrol.scenario.controls import amended, read_control
from patrol.scenario.lengths import FIELDS, PAPER_LENGTHS, BodyLengths
from patrol.scenario.policies import OPTION_LENGTHS

OPEN: dict[str, Any] = {"terrain": {"builtin": "open"}}
PAPER = {"policy": "potential-field"}
SMALL = {"model": "holonomic", "radius": 0.3, "speed": 1.0}
MIXED: dict[str, Any] = {
    **OPEN,
    "robots": [{"radius": 1.2}, {**SMALL, "name": "scout-1"}, {**SMALL, "name": "scout-2"}],
}


NAMES = (
    *("goal_distance", "refine_side", "refine_reach", "dilatation", "obstacle_radius", "fuzzy_distance"),
    *("surround_distance", "critical_width"),
)


def options(**settings: Any) -> dict[str, Any]:
    return {**PAPER, "options": settings}


def lengths_for(robots: dict[str, Any], **more: Any) -> BodyLengths:
    scenario = load_scenario({**OPEN, "robots": robots, **more})
    return scenario.lengths[1]


@pytest.mark.parametrize("robots", [{}, {"count": 1}, {"count": 16}, {"model": "holonomic", "count": 3, "spare": 2}])
def test_the_papers_body_gets_the_papers_numbers_exactly(robots: dict[str, Any]) -> None:
    assert lengths_for(robots) == PAPER_LENGTHS
    assert tuple(asdict(PAPER_LENGTHS).items()) == tuple(
        zip(NAMES, (5.5, 2.0, 10.0, 5.0, 5.0, 5.5, 8.0, 8.0), strict=True)
    )


def test_a_small_slow_body_gets_small_lengths() -> None:
    assert tuple(asdict(lengths_for(SMALL)).values()) == (1.65, 0.6, 3.0, 1.5, 1.5, 1.65, 2.4, 2.4)


def test_the_goal_lies_two_and_a_half_strides_ahead_and_no_length_is_below_a_point() -> None:
    assert lengths_for({"radius": 0.3, "speed": 3.0}).goal_distance == 3.75
    assert lengths_for({"radius": 0.3, "speed": 3.0}, step=1.0).goal_distance == 7.5
    tiny = lengths_for({"radius": 0.02, "speed": 0.1}, point=0.5)
    assert (tiny.goal_distance, tiny.refine_reach) == (0.5, 0.5)


def test_the_ring_around_an_intruder_holds_the_team_and_lies_in_view() -> None:
    assert lengths_for({**SMALL, "count": 12}).surround_distance == pytest.approx(12 * 1.6 / 6.2832, abs=1e-3)
    assert lengths_for({**SMALL, "count": 60}).surround_distance == 8.0
    assert lengths_for({}, sensor={"range": 5}).surround_distance == 4.0


def test_every_field_that_may_be_auto_is_so_by_default() -> None:
    for section, names in ((PatrolSpec, FIELDS), (PotentialFieldOptions, OPTION_LENGTHS)):
        assert {name for name, field in section.model_fields.items() if field.default == "auto"} == set(names)


def test_stating_a_number_means_the_same_as_leaving_it_to_auto(tmp_path: Path) -> None:
    scenario = load_scenario({**OPEN, "robots": SMALL, "patrol": PAPER})
    lengths = asdict(lengths_for(SMALL))
    options = {name: lengths.pop(name) for name in OPTION_LENGTHS}
    stated = load_scenario({**OPEN, "robots": SMALL, "patrol": {**PAPER, **lengths, "options": options}})
    assert stated == scenario
    assert scenario_hash(stated) == scenario_hash(scenario)
    file = tmp_path / "open.yaml"
    file.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(file) == scenario


def test_a_number_stays_whatever_the_body() -> None:
    found = lengths_for(SMALL, patrol={**options(dilatation=0), "goal_distance": 4})
    assert (found.dilatation, found.goal_distance, found.refine_side) == (0.0, 4.0, 0.6)
    assert lengths_for({}, patrol={"goal_distance": 0.7}).refine_side == 1.4, "a short one cuts an automatic square"


def test_auto_can_be_asked_for() -> None:
    given_ = {**OPEN, "robots": SMALL, "patrol": options(dilatation=2)}
    auto = load_scenario(given_, parse_overrides(["patrol.options.dilatation=auto"]))
    assert auto.lengths[1].dilatation == 1.5
    wider = load_scenario(given_, {"robots.radius": 0.4, "patrol.options.dilatation": "auto"})
    assert wider.lengths[1].dilatation == 2.0
    assert load_scenario(OPEN, {"robots.radius": 0.3, "robots.speed": 1}).patrol.goal_distance == 1.65


def test_spare_robots_and_controls_keep_the_lengths() -> None:
    scenario = load_scenario({**OPEN, "robots": SMALL})
    assert with_spares(scenario, 40).patrol == scenario.patrol
    for given_ in ({**OPEN, "robots": SMALL}, MIXED):
        scenario = load_scenario(given_)
        more, _ = amended(scenario, 3, read_control({"do": "intruder", "place": [45.0, 40.0]}))
        assert more.patrol == scenario.patrol


def test_robots_of_a_mixed_team_have_their_own_lengths_and_agree_on_the_ring() -> None:
    scenario = load_scenario(MIXED)
    assert scenario.patrol.goal_distance == "auto"
    assert {number: found.goal_distance for number, found in scenario.lengths.items()} == {1: 6.6, 2: 1.65, 3: 1.65}
    assert load_scenario(as_mapping(scenario)) == scenario
    assert load_scenario(MIXED).patrol.surround_distance == 8.0
    assert load_scenario(MIXED, {"sensor.range": 20}).patrol.surround_distance == 9.6


def test_robots_that_differ_in_other_ways_share_the_numbers() -> None:
    robots = [{"model": "car", "turning_radius": 2.0}, {"model": "holonomic"}]
    assert load_scenario({**OPEN, "robots": robots}).patrol == load_scenario(OPEN).patrol


def test_the_file_of_a_mixed_team_says_what_each_robot_has_or_a_few_of_many(tmp_path: Path) -> None:
    scenario = load_scenario(MIXED)
    text = dump_scenario(scenario)
    (line,) = [line for line in text.splitlines() if line.startswith("  goal_distance: auto ")]
    assert line.endswith("; here 6.6 for r1, 1.65 for scout-1 and scout-2")
    file = tmp_path / "mixed.yaml"
    file.write_text(text, encoding="utf-8")
    assert load_scenario(file).patrol == scenario.patrol
    many = load_scenario({**OPEN, "robots": [{"radius": 2.0}, *[{} for _ in range(20)]]})
    assert "here 10 for r1, 5 for r2, r3, r4, r5, r6, r7, r8, r9 and 12 more" in dump_scenario(many)


@pytest.mark.parametrize(
    ("robots", "patrol", "expected"),
    [
        ({}, {"refine_side": 12}, "refine_side = 12: the square must not reach behind the robot: patrol.goal_"),
        ({}, {"refine_side": 12}, "goal_distance is 5.5 m (auto), so at most 11"),
        ({}, {"refine_side": 3, "goal_distance": 1}, "refine_side = 3: the square must not reach behind the ro"),
        ({}, {"refine_side": 3, "goal_distance": 1}, "goal_distance is 1 m, so at most 2"),
        (MIXED["robots"], {"refine_side": 4}, "goal_distance is 1.65 m (auto, for scout-1), so at most 3.3"),
        ({}, {"goal_distance": 0.01}, "goal_distance = 0.01: shorter than one point of 0.1 m"),
        ({}, {"goal_distance": 0}, "goal_distance = 0: expected auto, or a number above 0 and at most 1e9 (m, "),
        (
            {},
            options(dilatation="Auto"),
            'options.dilatation = "Auto": expected auto, or a number from 0 to 1e9 (m, how far',
        ),
        ({}, options(reach="far"), 'options.reach = "far": expected paper or area'),
    ],
)
def test_a_wrong_length_is_named(robots: Any, patrol: dict[str, Any], expected: str) -> None:
    with pytest.raises(BadInput) as refused:
        load_scenario({**OPEN, "robots": robots, "patrol": patrol})
    assert f"patrol.{expected}" in str(refused.value)
    assert "\n" not in str(refused.value)


@given(
    radius=st.floats(1e-9, 1e9),
    speed=st.floats(1e-9, 1e9),
    point=st.floats(1e-3, 1e3),
    goal=st.just("auto") | st.floats(1e3, 1e9),
)
def test_whatever_the_body_its_lengths_can_be_stated(radius: float, speed: float, point: float, goal: Any) -> None:
    given_ = {**OPEN, "point": point, "sensor": {"range": 1e9}, "robots": {"radius": radius, "speed": speed}}
    scenario = load_scenario({**given_, "patrol": {"goal_distance": goal}})
    assert load_scenario(as_mapping(scenario)) == scenario


def test_the_widest_body_of_a_team_decides_wherever_it_is_listed() -> None:
    for robots in (MIXED["robots"], MIXED["robots"][::-1]):
        assert load_scenario({**MIXED, "robots": robots}).patrol.surround_distance == 8.0
