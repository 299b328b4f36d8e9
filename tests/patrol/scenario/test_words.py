"""Words about a scenario: what was given and assumed, what patrols cost, what operators ask for, and its marks."""

import json
from typing import Any

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.journal import Event
from patrol.scenario import load_scenario
from patrol.scenario.assumptions import assumption_lines
from patrol.scenario.controls import OPERATOR, as_detail, described, intruder_name, read_control, worded
from patrol.scenario.marks import looks_at, marks_of
from patrol.scenario.patrols import PREDICTABLE, describe_patrol, patrol_name, patrol_settings

OPEN: dict[str, Any] = {"terrain": {"builtin": "open"}}


def test_all_that_is_given_is_told_with_its_unit() -> None:
    given = {
        **OPEN,
        "point": 0.25,
        "step": 1.0,
        "robots": [
            {"model": "car", "speed": 2.0, "radius": 0.5, "turning_radius": 1.5},
            {"model": "holonomic", "speed": 1.0, "radius": 0.25, "turning_radius": 9.0},
            {"model": "holonomic", "speed": 1.0, "radius": 0.5, "turning_radius": 9.0},
        ],
        "sensor": {"range": 7.5, "angle": 359.5, "line_of_sight": False},
    }
    (line,) = assumption_lines(load_scenario(given))
    assert line == (
        "given: car and holonomic, radius 0.25 and 0.5 m, speed 1 and 2 m/s, turning radius 1.5 m, sensor of 7.5 m "
        "(359.5 degrees ahead, through walls), points of 0.25 m, steps of 1 s"
    )


def test_all_that_is_left_out_is_told_as_assumed() -> None:
    (line,) = assumption_lines(load_scenario(OPEN))
    assert line == (
        "assumed: car, radius 1 m, speed 4.4 m/s, turning radius 3.5 m, sensor of 10 m (all round, stopped by walls), "
        "points of 0.1 m, steps of 0.5 s (auto)"
    )
    first, second = assumption_lines(load_scenario({**OPEN, "robots": {"model": "holonomic", "radius": 0.2}}))
    assert first == "given: holonomic, radius 0.2 m"
    assert second.startswith("assumed: speed 4.4 m/s, sensor of 10 m")


@pytest.mark.parametrize(
    ("policy", "name", "words"),
    [
        ("stochastic", "stochastic", "stochastic"),
        ("potential-field", "paper", "paper"),
        ("committed", "tour", f"tour, {PREDICTABLE}"),
        ("hpcc", "policy hpcc", "policy hpcc"),
    ],
)
def test_a_patrol_is_named_and_the_tour_warned_of(policy: str, name: str, words: str) -> None:
    assert (patrol_name(policy), describe_patrol(policy)) == (name, words)


def test_a_named_patrol_is_a_policy_unless_another_is_given() -> None:
    assert patrol_settings(None, {"patrol": 1}) == {}
    for name, policy in (("stochastic", "stochastic"), ("paper", "potential-field"), ("tour", "committed")):
        assert patrol_settings(name, {"seed": 1}) == {"patrol.policy": policy}
    for field in ("patrol", "patrol.policy"):
        with pytest.raises(BadInput, match=f"patrol tour: {field} is set as well"):
            patrol_settings("tour", {field: 1})
    with pytest.raises(BadInput, match="patrol papier: no such patrol; did you mean paper"):
        patrol_settings("papier", {})


@pytest.mark.parametrize(
    ("control", "words"),
    [
        ({"do": "pause"}, "pause"),
        ({"do": "go"}, "go"),
        ({"do": "step", "ticks": 7}, "step 7"),
        ({"do": "pace", "factor": 2.5}, "pace 2.5"),
        ({"do": "pace", "factor": None}, "as fast as it goes"),
        ({"do": "fault", "fault": {"kind": "loss", "rate": 0.5, "who": "r1"}}, "loss: rate 0.5, who r1"),
        ({"do": "fault", "fault": {"kind": "kill"}, "instead": "op1"}, "kill: instead of op1"),
        ({"do": "fault", "fault": {"kind": "kill"}}, "kill"),
        ({"do": "heal", "id": "op1"}, "ends op1"),
        ({"do": "intruder", "place": [1.5, 2.0]}, "places an intruder at (1.5, 2)"),
        ({"do": "intruder", "place": [1.5, 2.0], "for": 30.0}, "places an intruder at (1.5, 2) for 30 s"),
        ({"do": "zone", "name": "vault", "on": True}, "switches vault on"),
        ({"do": "zone", "name": "vault", "on": False}, "switches vault off"),
        ({"do": "zone", "name": "vault", "weight": 5.0}, "lets vault count 5 times"),
    ],
)
def test_a_control_is_described_in_one_line_and_read_back(control: dict[str, Any], words: str) -> None:
    read = read_control(control)
    event = Event(3, OPERATOR, None, as_detail(read))
    assert described(event) == worded(event).detail == words
    assert read_control(json.loads(event.detail)) == read
    other = Event(3, "dead", 1, event.detail)
    assert described(other) == worded(other).detail == event.detail


@pytest.mark.parametrize(
    ("sound", "wrong"),
    [
        *(({"do": "step", "ticks": good}, {"ticks": bad}) for good, bad in ((1, 0), (100_000, 100_001), (1, 1.0))),
        *(({"do": "pace", "factor": good}, {"factor": bad}) for good, bad in ((0.001, 0.00099), (1e6, 1.1e6))),
        ({"do": "zone", "name": "z", "on": True}, {"weight": 2.0}),
        ({"do": "zone", "name": "z", "on": True}, {"on": None}),
        ({"do": "intruder", "place": [1.0, 2.0], "for": 1e-9}, {"for": 0.0}),
    ],
)
def test_a_control_is_refused_only_beyond_its_limits(sound: dict[str, Any], wrong: dict[str, Any]) -> None:
    read_control(sound)
    with pytest.raises(BadInput, match=r"^control: "):
        read_control(sound | wrong)


def test_intruders_are_named_from_one() -> None:
    assert [intruder_name(place) for place in (0, 1, 9)] == ["intruder1", "intruder2", "intruder10"]


def square(left: float, low: float) -> list[list[float]]:
    return [[left, low], [left + 2, low], [left + 2, low + 2], [left, low + 2]]


def test_each_section_marks_its_own_ground_and_what_lies_off_it_is_not_marked() -> None:
    given = {
        **OPEN,
        "zones": [
            {"name": "vault", "polygon": square(2, 2), "weight": 4.0, "times": [[5, 10]]},
            {"name": "far", "polygon": square(90, 80), "weight": 2.0},
        ],
        "closures": [{"name": "gate", "polygon": square(6, 2), "closed": [[1, 2]]}],
        "robots": {"battery": {"capacity": 10.0, "idle": 1.0, "drive": 1.0, "charge": 50.0}},
        "docks": [{"place": [3.0, 7.0], "radius": 1.5}],
    }
    scenario = load_scenario(given)
    terrain = Terrain("corner", np.ones((20, 20), dtype=np.bool_), 0.5)
    marks = {(mark.section, mark.name): mark for mark in marks_of(scenario, terrain)}
    assert {("zones", "vault"), ("closures", "gate")} <= marks.keys()
    assert ("zones", "far") not in marks
    vault, gate = marks["zones", "vault"], marks["closures", "gate"]
    for mark, left in ((vault, 4), (gate, 12)):
        expected = np.zeros((20, 20), dtype=np.bool_)
        expected[4:8, left : left + 4] = True
        assert mark.points is not None
        assert np.array_equal(mark.points, expected)
        assert mark.at == terrain.centre(*terrain.point_at(*mark.at))
    assert (vault.closes, gate.closes) == (False, True)
    (dock,) = (mark for (section, _), mark in marks.items() if section == "docks")
    assert (dock.at, dock.radius, dock.points) == ((3.0, 7.0), 1.5, None)
    looks = [looks_at(scenario, k)["zones"]["vault"].holds for k in (0, 9, 10, 19, 20)]
    assert looks == [False, False, True, True, False]  # from 5 to 10 s, with steps of half a second
    assert looks_at(scenario, 10)["zones"]["vault"].weight == 4.0
    assert not looks_at(scenario, 3)["closures"]["gate"].filled
