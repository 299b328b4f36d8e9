from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.faults.nemesis import DRAWN
from patrol.scenario import Scenario, as_mapping, load_scenario, scenario_hash

OPEN: dict[str, Any] = {"terrain": {"builtin": "open"}}


def scenario(robots: int = 5, step: float = 0.5, duration: float = 300.0, **nemesis: Any) -> Scenario:
    size = {"robots": {"count": robots}, "step": step, "duration": duration}
    return load_scenario({**OPEN, **size, "nemesis": {"interval": 20, **nemesis}})


seeds = st.integers(0, 2**63 - 1)
kinds = st.lists(st.sampled_from(list(DRAWN)), min_size=1, max_size=len(DRAWN), unique=True)


@given(seeds, st.integers(1, 8), kinds, st.sampled_from([0.1, 1.0 / 3.0, 0.5, 1.7]))
def test_what_is_drawn_is_a_scenario_with_those_kinds(seed: int, robots: int, chosen: list[str], step: float) -> None:
    found = scenario(robots, step, kinds=chosen, seed=seed)
    assert found.nemesis is None
    healing = {"kill": "restart", "resume": "pause", "leave": "join"}
    allowed = {*chosen, *(healing[kind] for kind in chosen if kind in healing)}
    assert {fault.kind for fault in found.faults} <= allowed
    assert all(fault.at <= 200.0 + 1e-6 for fault in found.faults)
    again = load_scenario(as_mapping(found))
    assert again == found
    assert scenario_hash(again) == scenario_hash(found)


@given(seeds)
def test_the_same_seed_draws_the_same_faults(seed: int) -> None:
    assert scenario(seed=seed) == scenario(seed=seed)
    assert scenario(seed=seed).faults != scenario(seed=seed + 1 if seed < 2**63 - 1 else 0).faults


def test_the_seed_is_the_scenarios_unless_given() -> None:
    def drawn(seed: int, of_nemesis: int | None = None) -> object:
        return load_scenario({**OPEN, "seed": seed, "nemesis": {"interval": 300, "seed": of_nemesis}}).faults

    assert drawn(5) == drawn(7, 5)
    assert drawn(5) != drawn(7)


def test_one_fault_begins_in_each_interval() -> None:
    faults = scenario(kinds=["loss", "silence"], interval=30, duration=900, quiet=0).faults
    assert [int(fault.at // 30) for fault in faults] == list(range(30))
    assert [fault.id for fault in faults] == [f"n{place}" for place in range(1, 31)]


def test_every_kind_is_drawn_and_does_something_alone() -> None:
    drawn = {fault.kind for seed in range(20) for fault in scenario(seed=seed).faults}
    assert drawn == set(DRAWN)
    for kind in DRAWN:
        assert any(fault.kind == kind for fault in scenario(kinds=[kind], duration=3000).faults), kind


def test_the_kinds_of_all_and_their_order_stay() -> None:
    """They decide the faults, and so the trace, of every scenario with a nemesis of all kinds."""
    processes = ("kill", "restart", "pause", "resume", "join", "leave")
    frames = ("loss", "delay", "duplicate", "reorder", "partition", "silence", "range", "bandwidth", "spoof")
    assert tuple(DRAWN) == (*processes, *frames, "drift", "clock", "motion")


def test_one_robot_alone_is_only_started_again() -> None:
    process = ["kill", "restart", "pause", "resume", "join", "leave", "partition"]
    assert {fault.kind for fault in scenario(1, kinds=process).faults} == {"restart"}


def test_the_scenarios_own_faults_come_first_and_keep_their_robots() -> None:
    own = [{"kind": "join", "who": "r2", "at": 100, "id": "n1"}, {"kind": "leave", "who": ["r3"], "at": 200}]
    found = load_scenario({**OPEN, "faults": own, "nemesis": {"interval": 20, "kinds": ["kill", "pause", "leave"]}})
    assert [fault.id for fault in found.faults[:3]] == ["n1", "f2", "n1x"]
    touched = {name for fault in found.faults[2:] for name in fault.who}  # type: ignore[attr-defined]
    assert touched <= {"r1", "r4", "r5"}
    word = [{"kind": "join", "who": "one", "at": 100}]
    nobody = load_scenario({**OPEN, "faults": word, "nemesis": {"interval": 20, "kinds": ["kill"]}})
    assert len(nobody.faults) == 1


@pytest.mark.parametrize(
    ("nemesis", "expected"),
    [
        ({}, "nemesis.interval: missing; give s, length of an interval; one fault begins in each"),
        ({"interval": 0.1}, "nemesis.interval = 0.1: shorter than one step of 0.5 s; give more"),
        ({"interval": 1}, "nemesis.interval = 1: makes 3333 faults, at most 1000 fit; give more"),
        ({"interval": 60, "quiet": 5000}, "nemesis.quiet = 5000: leaves no room for faults in a run of 5000 s"),
        ({"interval": 60, "quiet": -1}, "nemesis.quiet = -1: expected a number from 0"),
        ({"interval": 60, "kinds": []}, "nemesis.kinds = []: expected 1 or more kinds of faults"),
        ({"interval": 60, "kinds": ["kil"]}, 'nemesis.kinds.0 = "kil": expected one of kill, restart'),
        ({"interval": 60, "kinds": "kill"}, 'nemesis.kinds = "kill": expected all, or a list of kinds'),
        ({"interval": 60, "quite": 1}, "nemesis.quite: unknown key; did you mean quiet?"),
        ({"interval": 60, "seed": -1}, "nemesis.seed = -1: expected a whole number from 0"),
        (3, "nemesis = 3: expected keys and values (kinds, interval, seed, quiet)"),
    ],
)
def test_a_wrong_nemesis_is_told_in_one_line(nemesis: Any, expected: str) -> None:
    with pytest.raises(BadInput) as caught:
        load_scenario({**OPEN, "nemesis": nemesis})
    assert f"scenario: {expected}" in str(caught.value)


def test_a_run_of_one_step_has_no_room() -> None:
    with pytest.raises(BadInput, match=r"scenario: nemesis\.quiet: leaves no room for faults in a run of 0\.5 s"):
        load_scenario({**OPEN, "duration": 0.5, "nemesis": {"interval": 1}})
