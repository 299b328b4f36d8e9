"""The step that follows bodies and ground, and that everything uses one value of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.grounds import write_map
from patrol.errors import BadInput
from patrol.faults.roster import tick_of
from patrol.scenario import (
    Scenario,
    as_mapping,
    changed_scenario,
    dump_scenario,
    load_scenario,
    open_scenario,
    scenario_hash,
)
from patrol.scenario.assumptions import assumption_lines
from patrol.scenario.step import PAPER_STEP, STEPS

PAPER = "car, radius 1 m, speed 4.4 m/s, turning radius 3.5 m"
BODY = {"robots.radius": 0.3, "robots.speed": 1.0}


@pytest.fixture
def corridors(tmp_path: Path) -> str:
    """Corridors of 1.1 m: the centre of a body of 0.3 m is 0.45 m from the walls in the median."""
    return _map_of(tmp_path, "corridors", 11)


@pytest.fixture
def halls(tmp_path: Path) -> str:
    """Halls of 8 m, in which a body's room is more than 1.25 m."""
    return _map_of(tmp_path, "halls", 80)


def _map_of(folder: Path, name: str, width: int) -> str:
    passable = np.zeros((3 * (width + 1) + 1, 200), dtype=np.bool_)
    for number in range(3):
        first = 1 + number * (width + 1)
        passable[first : first + width, 1:-1] = True
    return str(write_map(passable, 0.1, folder / f"{name}.yaml"))


def step_on(ground: str, **overrides: Any) -> float:
    return open_scenario(ground, {**BODY, **overrides}).step


def test_a_body_takes_shorter_steps_where_it_has_little_room(corridors: str, halls: str) -> None:
    assert step_on(halls) == 0.5
    assert step_on(corridors) == 0.1
    assert step_on(corridors, **{"robots.speed": 0.5}) == 0.25
    assert step_on(corridors, **{"robots.speed": 0.3}) == 0.5
    assert step_on(halls, **{"robots.speed": 2.0}) == 0.25
    assert step_on(halls, **{"robots.speed": 4.4}) == 0.1


def test_the_body_that_needs_the_shortest_step_decides(corridors: str) -> None:
    slow, fast = {"radius": 0.3, "speed": 0.3}, {"radius": 0.3, "speed": 1.0}
    assert load_scenario({"terrain": {"map": corridors}, "robots": [slow, slow]}).step == 0.5
    assert load_scenario({"terrain": {"map": corridors}, "robots": [slow, fast]}).step == 0.1


def test_a_changed_body_gets_a_step_of_its_own_unless_one_is_stated(corridors: str) -> None:
    source = open_scenario(corridors, BODY)
    assert changed_scenario(source, {"robots.speed": 0.5}).step == 0.25
    assert changed_scenario(source, {"duration": 10}).step == source.step == 0.1
    assert changed_scenario(source, {"robots.speed": 0.5, "step": 0.1}).step == 0.1
    stated = open_scenario(corridors, {**BODY, "step": 0.1})
    assert changed_scenario(stated, {"robots.speed": 0.5}).step == 0.1


def test_a_stride_is_at_least_a_point_and_a_step_what_the_radio_needs(corridors: str) -> None:
    assert step_on(corridors, point=0.25) == 0.25
    assert step_on(corridors, **{"radio.model": "path-loss", "radio.options.airtime": 0.15}) == 0.25
    assert step_on(corridors, **{"radio.model": "path-loss", "radio.options.airtime": 0.3}) == 0.5
    assert step_on(corridors, **{"radio.via": "direct", "pace": "realtime"}) == PAPER_STEP


@pytest.mark.parametrize("terrain", ["open", "yards", "clutter", "site"])
def test_built_in_terrains_keep_the_papers_step(terrain: str) -> None:
    assert load_scenario({"terrain": {"builtin": terrain}}).step == PAPER_STEP
    assert step_on(terrain) == PAPER_STEP


def test_a_step_that_is_named_stays(corridors: str) -> None:
    assert step_on(corridors, step=0.3) == 0.3


def test_auto_and_its_number_are_the_same_scenario(corridors: str) -> None:
    said, left_out, number = (
        open_scenario(corridors, {**BODY, **step}) for step in ({"step": "auto"}, {}, {"step": 0.1})
    )
    assert said == left_out == number
    assert len({scenario_hash(scenario) for scenario in (said, left_out, number)}) == 1
    assert "\nstep: 0.1 " in dump_scenario(left_out)
    assert load_scenario(as_mapping(left_out)) == left_out


def test_lengths_follow_the_step_that_was_chosen(corridors: str) -> None:
    assert open_scenario(corridors, {**BODY, "robots.radius": 0.1}).patrol.goal_distance == 0.55
    assert open_scenario(corridors, {**BODY, "robots.radius": 0.1, "step": 0.5}).patrol.goal_distance == 1.25


def test_the_map_of_a_scenario_that_is_only_looked_at_is_not_read(corridors: str) -> None:
    mapping = {"terrain": {"map": corridors}, "robots": {"radius": 0.3, "speed": 1.0}}
    assert load_scenario(mapping, opens_classes=False).step == PAPER_STEP


def test_a_map_that_is_not_there_is_refused_where_it_is_needed(tmp_path: Path) -> None:
    scenario = load_scenario({"terrain": {"map": str(tmp_path / "none.yaml")}})
    assert scenario.step == PAPER_STEP
    with pytest.raises(BadInput, match="no such"):
        scenario_hash(scenario)


def test_a_wrong_step_is_told_what_is_right(corridors: str) -> None:
    with pytest.raises(BadInput, match=r"step = .*fast.*: expected auto, or a number above 0"):
        open_scenario(corridors, {"step": "fast"})


@given(st.floats(1.0, 5000.0), st.floats(0.0, 5000.0), st.sampled_from(STEPS))
def test_what_happens_in_time_with_the_papers_step_does_so_with_each(
    duration_s: float, at_s: float, step_s: float
) -> None:
    """So that files which name no step still run."""
    if tick_of(at_s, PAPER_STEP) < round(duration_s / PAPER_STEP):
        assert tick_of(at_s, step_s) < round(duration_s / step_s)
    assert tick_of(PAPER_STEP * round(at_s), step_s) * step_s == pytest.approx(PAPER_STEP * round(at_s))


def lines(scenario: Scenario) -> list[str]:
    return list(assumption_lines(scenario))


def test_what_was_given_and_what_was_assumed_is_said_apart(corridors: str) -> None:
    options = {"robots.radius": 0.2, "robots.model": "differential"}
    assert lines(open_scenario(corridors, options)) == [
        "given: differential, radius 0.2 m",
        "assumed: speed 4.4 m/s, sensor of 10 m (all round, stopped by walls), points of 0.1 m, steps of 0.1 s (auto)",
    ]
    sensor = "sensor of 10 m (all round, stopped by walls)"
    assert lines(load_scenario({"terrain": {"builtin": "yards"}})) == [
        f"assumed: {PAPER}, {sensor}, points of 0.1 m, steps of 0.5 s (auto)"
    ]


def test_all_of_a_written_scenario_is_given(halls: str) -> None:
    written = load_scenario(as_mapping(open_scenario(halls, {"sensor.angle": 90, "sensor.line_of_sight": False})))
    sensor = "sensor of 10 m (90 degrees ahead, through walls)"
    assert lines(written) == [f"given: {PAPER}, {sensor}, points of 0.1 m, steps of 0.1 s"]


def test_of_several_robots_a_field_is_given_only_if_it_is_for_all() -> None:
    robots = [{"model": "car", "speed": 1.0, "radius": 1.0}, {"model": "holonomic", "radius": 0.3}]
    mixed = load_scenario({"terrain": {"builtin": "open"}, "robots": robots, "step": 0.5, "point": 0.5})
    assert lines(mixed) == [
        "given: car and holonomic, radius 0.3 and 1 m, points of 0.5 m, steps of 0.5 s",
        "assumed: speed 1 and 4.4 m/s, turning radius 3.5 m, sensor of 10 m (all round, stopped by walls)",
    ]


def test_a_scenario_that_was_changed_knows_what_its_source_said() -> None:
    source = load_scenario({"terrain": {"builtin": "open"}, "robots": {"radius": 0.5}})
    faster = changed_scenario(source, {"robots.speed": 2.0})
    assert source.assumed - faster.assumed == {"robots.speed"}
    assert changed_scenario(source, {"robots": {"radius": 0.5}}).assumed == source.assumed
    assert changed_scenario(faster, {"robots.count": 2}).assumed == faster.assumed
    assert changed_scenario(source, {"step": "auto"}).assumed >= {"step"}
