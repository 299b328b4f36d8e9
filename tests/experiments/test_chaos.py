from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.chaos import (
    IN_ONE_PROCESS,
    KEY,
    Breakage,
    Fewest,
    TimeLimit,
    TooSlow,
    WayResult,
    examine,
    fewest,
    in_process,
    narrow,
    random_scenario,
    with_faults,
)
from patrol.errors import BadInput
from patrol.pose import MODELS
from patrol.scenario import Scenario, as_mapping, load_scenario
from patrol.scenario.faults.kinds import Forgery, Partition, Spoof
from patrol.scenario.faults.nemesis_draws import DRAWN
from worldsim.faults.timeline import Timeline
from worldsim.run_record import COMPLETED, INTERRUPTED
from worldsim.verdict.common.check import CheckResult
from worldsim.verdict.judge import Verdict

GOOD = WayResult("trace", Verdict("valid", (CheckResult("complete", True, ""),)), COMPLETED)
BAD = Verdict(
    "invalid",
    (CheckResult("fog", False, "thick"), CheckResult("trace", True, ""), CheckResult("moves", False, "wild")),
)
FEW = {"terrain": {"builtin": "open"}, "point": 2, "robots": {"count": 4}, "duration": 10}
SMALL = load_scenario({"terrain": {"builtin": "open"}, "duration": 100, "nemesis": {"interval": 5}})


@pytest.fixture
def key(tmp_path: Path) -> Path:
    file = tmp_path / "fleet.key"
    file.write_bytes(KEY)
    return file


def way(ran: WayResult | Exception) -> Callable[[Scenario], WayResult]:
    def run(_: Scenario) -> WayResult:
        if isinstance(ran, Exception):
            raise ran
        return ran

    return run


# --- random scenarios ------------------------------------------------------------------------------------------------


def test_the_seed_decides_the_scenario(key: Path) -> None:
    assert random_scenario(5, key) == random_scenario(5, key)
    assert as_mapping(random_scenario(5, key)) != as_mapping(random_scenario(6, key))


def test_scenarios_differ_in_all_that_matters(key: Path) -> None:
    drawn = [random_scenario(seed, key) for seed in range(120)]
    assert {fault.kind for scenario in drawn for fault in scenario.faults} == set(DRAWN)
    assert {len(scenario.roster) - len(scenario.spares) for scenario in drawn} == {2, 3, 4, 5, 6}
    assert {len(scenario.spares) for scenario in drawn} == {0, 1}
    spoofs = [fault.payload for scenario in drawn for fault in scenario.faults if isinstance(fault, Spoof)]
    assert any(isinstance(payload, Forgery) and payload.ahead is not None for payload in spoofs)
    groups = [fault.groups for scenario in drawn for fault in scenario.faults if isinstance(fault, Partition)]
    assert {"halves", "one"} < {said if isinstance(said, str) else "named" for said in groups}
    assert {scenario.terrain.builtin for scenario in drawn} == {"open", "yards", "clutter", "site"}
    assert {scenario.patrol.paths for scenario in drawn} == {"wave", "straight", "regions"}
    assert {scenario.radio.key is None for scenario in drawn} == {True, False}
    assert {spec.model for scenario in drawn for spec in scenario.roster} == set(MODELS)
    assert max(scenario.ticks for scenario in drawn) <= 140


@pytest.mark.parametrize(
    "seed", [*range(1000, 1006), *(pytest.param(seed, marks=pytest.mark.accept) for seed in range(1006, 1012))]
)
def test_a_dozen_hold(seed: int, key: Path) -> None:
    scenario = random_scenario(seed, key)
    assert examine(scenario, IN_ONE_PROCESS) is None


# --- what breaks -----------------------------------------------------------------------------------------------------


def test_what_holds_is_nothing_to_tell() -> None:
    assert examine(SMALL, {"a": way(GOOD), "b": way(GOOD)}) is None


@pytest.mark.parametrize(
    ("ran", "kind", "detail"),
    [
        (KeyError(0), "b: KeyError", "KeyError: 0"),
        (BadInput("x = 3: no"), "b: refused", "x = 3: no"),
        (replace(GOOD, verdict=BAD), "b: invalid by fog, moves", "fog: thick\nmoves: wild"),
        (replace(GOOD, verdict=Verdict("unknown", ())), "b: unknown", ""),
        (replace(GOOD, ended=INTERRUPTED), "b: not completed", INTERRUPTED),
        (replace(GOOD, trace="other"), "traces differ", "a: trace\nb: other"),
    ],
)
def test_what_breaks_is_told(ran: WayResult | Exception, kind: str, detail: str) -> None:
    found = examine(SMALL, {"a": way(GOOD), "b": way(ran)})
    assert found is not None
    assert found.kind.startswith(kind)
    assert detail in found.detail


def test_what_takes_too_long_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.chaos.LIMIT_S", 0.0)
    with pytest.raises(TooSlow, match="in process: broken off after 0 s"):
        examine(load_scenario(FEW), IN_ONE_PROCESS)
    limit = TimeLimit()
    assert not limit.exceeded()
    limit.begin()
    assert limit.exceeded()
    limit.check(COMPLETED)
    with pytest.raises(TooSlow):
        limit.check(INTERRUPTED)


def test_a_breakage_names_where_it_was_raised() -> None:
    def broken(scenario: Scenario) -> WayResult:
        with_faults(scenario, [None])
        return GOOD

    found = examine(SMALL, {"a": broken})
    assert found is not None
    assert found.kind.startswith("a: AttributeError at experiments.chaos:")


def test_an_interruption_breaks_off() -> None:
    def interrupted(_: Scenario) -> WayResult:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        examine(SMALL, {"a": interrupted})


# --- fewer faults ----------------------------------------------------------------------------------------------------


@given(st.sets(st.integers(0, 39), max_size=5), st.integers(1, 40))
def test_delta_debugging_finds_exactly_what_it_takes(needed: set[int], count: int) -> None:
    wanted = {item for item in needed if item < count}
    tries = 0

    def breaks(part: Sequence[int]) -> bool:
        nonlocal tries
        tries += 1
        return wanted <= set(part)

    assert fewest(range(count), breaks, 10_000) == Fewest(tuple(sorted(wanted)), True)
    assert tries < 10 + 4 * (len(wanted) + 1) * 12


@given(st.integers(2, 30), st.integers(0, 10**6))
def test_of_several_reasons_one_is_left(count: int, salt: int) -> None:
    either, other = salt % count, (salt // 7) % count
    found = fewest(range(count), lambda part: either in part or other in part, 10_000)
    assert found in (Fewest((either,), True), Fewest((other,), True))


def test_it_ends_after_so_many_tries() -> None:
    tried: list[Sequence[int]] = []

    def breaks(part: Sequence[int]) -> bool:
        tried.append(part)
        return {3, 17, 29} <= set(part)

    found = fewest(range(40), breaks, 6)
    assert {3, 17, 29} <= set(found.items)
    assert not found.least
    assert len(tried) <= 6


def test_a_scenario_is_narrowed_to_the_faults_that_break_it() -> None:
    """An injected mistake: whoever suffers loss and silence at once, breaks."""
    assert len(SMALL.faults) > 8
    culprits = [SMALL.faults[1].id, SMALL.faults[6].id]
    seen: list[int] = []

    def breaks(scenario: Scenario) -> bool:
        seen.append(len(scenario.faults))
        return {SMALL.faults[1], SMALL.faults[6]} <= set(scenario.faults)

    found = narrow(SMALL, breaks)
    narrowed = found.scenario
    assert found.least
    assert found.kept == (SMALL.faults[1], SMALL.faults[6])
    assert [fault.id for fault in found.kept] == culprits
    assert narrowed == with_faults(SMALL, [SMALL.faults[1], SMALL.faults[6]])
    assert as_mapping(narrowed) | {"faults": 0} == as_mapping(SMALL) | {"faults": 0}


def test_what_is_left_out_changes_no_other_draw() -> None:
    """The robots that a word means depend on the fault's place; what stands in for another does nothing at all."""
    words = [{"kind": kind, "who": "half", "at": at} for kind, at in (("pause", 4), ("join", 6), ("kill", 8))]
    many = load_scenario({**FEW, "faults": [{"kind": "loss", "rate": 0.5}, *words, {"kind": "restart", "who": "all"}]})
    alone = with_faults(many, [many.faults[3]])
    assert [fault.kind for fault in alone.faults] == ["clock", "clock", "clock", "kill"]
    assert [fault.id for fault in alone.faults] == ["f1", "f2", "f3", "f4"]
    assert Timeline(alone).entries[3] == Timeline(many).entries[3]
    assert Timeline(alone).starts_absent == frozenset()
    nothing = with_faults(many, [])
    assert nothing.faults == ()
    assert in_process(with_faults(alone, [alone.faults[0]])).trace == in_process(nothing).trace


def test_a_mistake_in_the_fleet_is_found_and_narrowed(key: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hand that fails to pause: the run raises, and one fault is enough for that."""
    from experiments.inprocess import InProcessFleet

    def fail(_: InProcessFleet, number: int) -> None:
        raise RuntimeError(f"robot {number} does not listen")

    monkeypatch.setattr(InProcessFleet, "pause", fail)
    scenario = next(s for s in (random_scenario(seed, key) for seed in range(50)) if _pauses(s) and len(s.faults) > 5)
    ways = {"in process": in_process}
    found = examine(scenario, ways)
    assert found is not None
    assert found.kind.startswith("in process: RuntimeError at worldsim.fleet.acts:")

    def breaks(tried: Scenario) -> bool:
        again = examine(tried, ways)
        return again is not None and again.kind == Breakage(found.kind, "").kind

    narrowed = narrow(scenario, breaks)
    assert [fault.kind for fault in narrowed.kept] == ["pause"]


def _pauses(scenario: Scenario) -> bool:
    return any(fault.kind == "pause" for fault in scenario.faults)
