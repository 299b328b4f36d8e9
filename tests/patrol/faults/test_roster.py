"""Times in ticks, and faults at the edges of what roster and duration allow."""

from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.faults.roster import tick_of, ticks_of
from patrol.scenario import load_scenario


@pytest.mark.parametrize(
    ("at", "step", "tick"),
    [(0.0, 0.5, 0), (1.0, 0.5, 2), (1.01, 0.5, 3), (0.99, 0.5, 2), (0.3, 0.1, 3), (0.7, 0.1, 7), (0.001, 0.5, 1)],
)
def test_a_time_means_the_first_tick_that_is_not_before_it(at: float, step: float, tick: int) -> None:
    assert tick_of(at, step) == tick


@pytest.mark.parametrize(
    ("lasts", "step", "ticks"),
    [(0.01, 0.5, 1), (0.74, 0.5, 1), (0.75, 0.5, 2), (1.24, 0.5, 2), (1.25, 0.5, 3), (0.15, 0.1, 2), (60.0, 0.5, 120)],
)
def test_a_duration_is_rounded_half_up_to_at_least_one_tick(lasts: float, step: float, ticks: int) -> None:
    assert ticks_of(lasts, step) == ticks


def loaded(fault: dict[str, Any], robots: Any = 3, **more: Any) -> None:
    group = {"count": robots} if isinstance(robots, int) else robots
    load_scenario(
        {"terrain": {"builtin": "open"}, "step": 0.5, "duration": 10, "robots": group, "faults": [fault], **more}
    )


@pytest.mark.parametrize(
    ("sound", "wrong", "says"),
    [
        ({"kind": "kill", "who": "one", "at": 9.5}, {"at": 9.51}, "the run ends at 10 s"),
        ({"kind": "kill", "who": {"count": 3}}, {"who": {"count": 4}}, "there are 3 robots; give at most 3"),
        ({"kind": "partition", "groups": [["r1", "r2"]]}, {"groups": [["r1", "r2", "r3"]]}, "nobody is cut off"),
        ({"kind": "partition", "groups": [["r1"], ["r2", "r3"]]}, {"groups": [["r1"], ["r2", "r1"]]}, "in group 0 too"),
        ({"kind": "spoof", "by": "r1", "as": ["r1", "r2"], "payload": "random"}, {"as": "r1"}, "victim is r1"),
        ({"kind": "spoof", "by": "r1", "as": ["r1", "r2"], "payload": "freeze"}, {"as": ["r1"]}, "victim is r1"),
    ],
)
def test_a_fault_is_refused_only_beyond_the_edge(sound: dict[str, Any], wrong: dict[str, Any], says: str) -> None:
    loaded(sound)
    with pytest.raises(BadInput, match=says):
        loaded(sound | wrong)


def test_one_robot_alone_may_invent_others_and_cannot_be_cut_off() -> None:
    loaded({"kind": "spoof", "by": "r1", "as": "r1", "payload": {"invented": 1}}, 1)
    loaded({"kind": "kill", "who": "half"}, 1)
    for fault in ({"kind": "partition", "groups": "halves"}, {"kind": "kill", "who": "minority"}):
        loaded(fault, 2)
        with pytest.raises(BadInput, match="there is one robot"):
            loaded(fault, 1)


def test_spare_robots_are_in_no_size() -> None:
    robots = {"count": 2, "spare": 2}
    loaded({"kind": "kill", "who": {"count": 2}}, robots)
    loaded({"kind": "join", "who": "r4"}, robots)
    with pytest.raises(BadInput, match="there are 2 robots; give at most 2"):
        loaded({"kind": "kill", "who": {"count": 3}}, robots)


def test_of_a_closure_only_a_name_that_there_is() -> None:
    closures = [{"name": "gate", "polygon": [[48, 40], [50, 40], [50, 44], [48, 44]]}]
    loaded({"kind": "close", "closure": "gate"}, closures=closures)
    with pytest.raises(BadInput, match="there is no closure gat; did you mean gate"):
        loaded({"kind": "close", "closure": "gat"}, closures=closures)
    with pytest.raises(BadInput, match="the scenario has none; list it in closures"):
        loaded({"kind": "open", "closure": "gate"})
