"""Fleets in one process: the trace depends on the scenario alone."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from agent.build import Shared, build_mind
from agent.mind import Mind
from agent.view import View
from fogwatch.inprocess import InProcessFleet, Outcome, fault_free_mfow, fleet_of, run_in_process
from patrol.errors import BadInput
from patrol.exchange import Sensed
from patrol.journal import Event, RobotTick, TickRecord, read_journal
from patrol.pose import wrap
from patrol.prepare import prepare, sensor_footprint
from patrol.scenario import Scenario, load_scenario
from tests.fleets import end_of
from worldsim.fleet.loop import run_ticks
from worldsim.output.summary import summarise
from worldsim.run_record import INTERRUPTED
from worldsim.verdict.judge import judge
from worldsim.world import World

CARS = {"count": 3, "model": "car"}
DISCS = {"count": 3, "model": "holonomic"}
BASES = {"count": 3, "model": "differential"}


def scenario(terrain: str = "yards", robots: dict[str, Any] = CARS, ticks: int = 30, **more: Any) -> Scenario:
    given = {"terrain": {"builtin": terrain}, "point": 0.5, "robots": robots, "duration": 0.5 * ticks}
    return load_scenario({**given, **more})


def trace(outcome: Outcome) -> str:
    assert outcome.verdict.valid, outcome.verdict.failed
    assert outcome.journal.end
    return outcome.journal.end.trace_hash


@pytest.mark.parametrize("robots", [CARS, DISCS, BASES], ids=["cars", "holonomic", "differential"])
def test_the_same_seed_gives_the_same_trace_whatever_the_workers_and_another_does_not(robots: dict[str, Any]) -> None:
    first, again, other, three = (
        trace(run_in_process(scenario(robots=robots, seed=seed), workers=workers))
        for seed, workers in ((1, 1), (1, 1), (2, 1), (1, 3))
    )
    assert three == first == again != other


def test_with_a_key_the_seed_tells_nobody_where_the_robots_go(tmp_path: Path) -> None:
    def places(key: str | None, **more: Any) -> list[tuple[float, float]]:
        keyed = scenario("open", DISCS, 60, radio={"key": key}, patrol={"policy": "potential-field"})
        outcome = run_in_process(keyed, **more)
        assert outcome.verdict.valid, outcome.verdict.failed
        return [(row.x, row.y) for record in outcome.journal.ticks for row in record.robots]

    for name in ("a", "b"):
        (tmp_path / name).write_text(f"the key of fleet {name}", encoding="ascii")
    first, other = str(tmp_path / "a"), str(tmp_path / "b")
    assert places(first) == places(first, workers=3) == places(first, share=False)
    assert places(first) != places(other) != places(None) != places(first)


def test_the_secret_of_a_running_fleet_can_be_replaced() -> None:
    def places(secret: bytes | None) -> list[tuple[float, float]]:
        prepared = prepare(scenario("open", DISCS, 60, patrol={"policy": "potential-field"}))
        world, records = World(prepared), list[TickRecord]()
        fleet = fleet_of(world, sensor_footprint(prepared.scenario, prepared.terrain))

        def take(record: TickRecord) -> None:
            records.append(record)
            if record.k == 30:
                assert fleet.chance is not None
                fleet.chance.key = secret

        run_ticks(world, fleet, take, lambda _: None)
        return [(row.x, row.y) for record in records for row in record.robots]

    same, other = places(None), places(b"another secret")
    assert same[: 3 * 31] == other[: 3 * 31]
    assert same != other


def test_a_narrow_view_turns_with_a_robot_that_turns_on_the_spot() -> None:
    faults = [{"kind": "drift", "who": "r1", "at": 10, "for": 20, "growth": [0.02, 0.01]}]
    narrow = {"angle": 90, "range": 6}
    outcome = run_in_process(scenario("clutter", BASES, 120, sensor=narrow, faults=faults))
    assert outcome.verdict.valid, outcome.verdict.failed
    turned = 0
    before: dict[int, RobotTick] = {}
    for record in outcome.journal.ticks:
        for row in record.robots:
            last = before.get(row.number)
            if last is not None and last.c0 == 0.0 != last.c1:
                turned += 1
                assert (row.x, row.y) == (last.x, last.y)
                assert row.heading == pytest.approx(wrap(last.heading + 0.5 * last.c1))
            before[row.number] = row
    assert turned > 10


def test_the_journal_on_disk_holds_the_same_run(tmp_path: Path) -> None:
    in_memory = run_in_process(scenario())
    on_disk = run_in_process(scenario(), journal=tmp_path / "journal", started="2000-01-01T00:00:00+00:00")
    assert trace(in_memory) == trace(on_disk)
    assert read_journal(tmp_path / "journal").header.started == "2000-01-01T00:00:00+00:00"
    for key in ("scenario_hash", "mfow_mean_s", "fog_mean_s", "messages", "seen_share"):
        assert getattr(in_memory.summary, key) == getattr(on_disk.summary, key)


def test_the_fog_of_a_run_can_be_recomputed() -> None:
    prepared = prepare(scenario(robots=DISCS))
    outcome = run_in_process(prepared)
    assert summarise(outcome.journal, judge(outcome.journal, {}, prepared), prepared)[1] == outcome.verdict
    assert "fog" in [check.name for check in outcome.verdict.checks]
    unverified = run_in_process(prepared, keep=False, verify_fog=False)
    assert "fog" not in [check.name for check in unverified.verdict.checks]
    assert unverified.verdict.valid


def test_everyone_patrols_and_hears_everyone() -> None:
    seen: list[TickRecord] = []
    outcome = run_in_process(scenario(patrol={"policy": "potential-field"}), progress=seen.append)
    assert [record.k for record in seen] == list(range(30))
    assert outcome.summary.messages.delivered == 30 * 3 * 2
    assert outcome.summary.messages.rejected == 0
    assert outcome.summary.seen_share > 0.3
    for facts in outcome.summary.robots.values():
        assert facts.decisions == 30
        assert facts.distance_m > 10.0


def test_a_run_can_be_stopped() -> None:
    answers = iter([False, False, True])
    outcome = run_in_process(scenario(), stop=lambda: next(answers))
    assert outcome.summary.ended == INTERRUPTED
    assert outcome.summary.ticks == 2
    assert outcome.verdict.valid


def test_a_mind_that_fails_ends_the_run_and_the_journal_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    decide = Mind.decide

    def failing(mind: Mind, sensed: Sensed, view: View | None) -> Any:
        if sensed.k == 4:
            raise RuntimeError("no idea")
        return decide(mind, sensed, view)

    monkeypatch.setattr(Mind, "decide", failing)
    events: list[Event] = []
    prepared = prepare(scenario())
    with pytest.raises(RuntimeError, match="no idea"):
        run_in_process(prepared, journal=tmp_path / "journal", events=events.append)
    journal = read_journal(tmp_path / "journal")
    assert journal.end
    assert journal.end.reason == "failed: RuntimeError: no idea"
    verdict = judge(journal, {}, prepared)
    assert verdict.outcome == "invalid"
    assert [check.name for check in verdict.failed] == ["complete"]
    assert events == []


def test_a_run_that_keeps_no_records_is_summed_up_and_judged_all_the_same() -> None:
    kept, let_go = run_in_process(scenario()), run_in_process(scenario(), keep=False)
    assert list(let_go.journal.ticks) == []
    assert trace(kept) == trace(let_go)
    assert kept.verdict == let_go.verdict
    for key in ("mfow_mean_s", "mfow_max_s", "fog_mean_s", "messages", "seen_share", "ticks"):
        assert getattr(kept.summary, key) == getattr(let_go.summary, key)


def test_direct_radio_needs_processes() -> None:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 1.0, "pace": 1.0, "radio": {"via": "direct"}})
    with pytest.raises(BadInput, match=r"radio\.via = direct: .* run as processes"):
        run_in_process(scenario)


PROCESS_FAULTS = [
    {"kind": "kill", "who": "r1", "at": 2, "wreck": "removed"},
    {"kind": "restart", "who": "r1", "at": 6},
    {"kind": "pause", "who": "r2", "at": 3, "for": 5},
    {"kind": "join", "who": "r3", "at": 4},
]


@pytest.mark.parametrize("robots", [CARS, DISCS, BASES], ids=["cars", "holonomic", "differential"])
def test_process_faults_repeat_whatever_the_workers_and_are_judged_as_they_go(robots: dict[str, Any]) -> None:
    faulty = scenario(robots=robots, faults=PROCESS_FAULTS)
    first = run_in_process(faulty)
    assert trace(first) == trace(run_in_process(faulty, workers=3)) == trace(run_in_process(faulty, keep=False))
    assert trace(first) != trace(run_in_process(scenario(robots=robots)))
    assert [facts.status for facts in first.summary.robots.values()] == 3 * ["alive"]


def test_a_restarted_mind_is_a_new_one() -> None:
    prepared = prepare(scenario(robots=DISCS))
    fleet = InProcessFleet({}, partial(build_mind, Shared(prepared)))
    fleet.start(1, 1)
    first = fleet.minds[1]
    fleet.kill(1)
    assert not fleet.arrived(1)
    fleet.start(1, 2)
    assert fleet.minds[1] is not first


def test_recovery_is_judged_by_the_run_without_faults() -> None:
    faults = [{"kind": "silence", "who": "all", "at": 5, "for": 10}]
    wide = {"range": 200, "line_of_sight": False}
    mapping = {"terrain": {"builtin": "open"}, "point": 2.0, "duration": 30, "sensor": wide, "faults": faults}
    prepared = prepare(load_scenario(mapping))
    calm = run_in_process(load_scenario({**mapping, "faults": []}))
    baseline_s = fault_free_mfow(prepared)
    assert baseline_s == calm.summary.mfow_mean_s
    for keep in (True, False):
        outcome = run_in_process(prepared, keep=keep, baseline_s=baseline_s)
        (check,) = [check for check in outcome.verdict.checks if check.name == "recovery"]
        assert (check.ok, check.judged) == (True, True)
        assert check.detail.startswith("every point was seen again in 0 s; ")
    assert fault_free_mfow(prepared, stop=lambda: True) is None


FAILING = """
import time

from pydantic import BaseModel

from agent.ports import Bearing, Stay


class Failing:
    class Options(BaseModel):
        how: str = "raise"

    def __init__(self, setup):
        self.number = setup.robot.spec.number
        self.how = setup.options.how

    def decide(self, view):
        if self.number == 2 and view.tick == 4:
            if self.how == "raise":
                raise RuntimeError("no idea")
            if self.how == "rubbish":
                return "patrolling"
            if self.how == "torn":
                return Bearing(Torn((1.0,)))
            while True:
                time.sleep(0.01)
        return Stay("resting")


class Torn(tuple):
    def __iter__(self):
        raise KeyError("gone")
"""


def failing(folder: Path, **options: str) -> Scenario:
    path = folder / "failing.py"
    path.write_text(FAILING, encoding="utf-8")
    return scenario(robots=DISCS, patrol={"policy": f"{path}:Failing", "options": options}, ticks=12)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("raise", "its policy failed at tick 4: raised RuntimeError: no idea (failing.py:20)"),
        ("rubbish", "its policy failed at tick 4: returned str; return Bearing, Place, Stay or Steer"),
        ("torn", "its policy failed at tick 4: raised KeyError: 'gone' (failing.py:32)"),
        ("hang", "its policy failed at tick 4: took longer than 3 s to decide"),
    ],
)
def test_a_policy_that_fails_loses_its_robot_and_the_others_go_on(
    how: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if how == "hang":
        monkeypatch.setattr("agent.build.DECISION_LIMIT_S", 3.0)
    events: list[Event] = []
    outcome = run_in_process(failing(tmp_path, how=how), events=events.append)
    assert [(event.robot, event.kind, event.detail) for event in events] == [(2, "lost", says)]
    assert [facts.status for facts in outcome.summary.robots.values()] == ["alive", "lost", "alive"]
    assert outcome.summary.ended == "completed"
    assert [check.name for check in outcome.verdict.failed] == ["nobody lost"]
    assert outcome.summary.robots["r1"].decisions == 12
    assert outcome.summary.robots["r2"].decisions == 4


def test_a_policy_that_cannot_be_made_is_bad_input(tmp_path: Path) -> None:
    path = tmp_path / "failing.py"
    path.write_text(FAILING.replace("self.how = ", 'self.how = {}["two\\nlines"] or '), encoding="utf-8")
    made = scenario(robots=DISCS, patrol={"policy": f"{path}:Failing"})
    with pytest.raises(BadInput, match=r"failing\.py:Failing: cannot be made for r1: KeyError: 'two"):
        run_in_process(made)


def test_a_failure_repeats_whatever_the_workers(tmp_path: Path) -> None:
    ends = [end_of(run_in_process(failing(tmp_path), workers=workers).journal) for workers in (1, 3)]
    assert ends[0] == ends[1]


def test_a_robot_whose_policy_has_failed_can_be_started_again(tmp_path: Path) -> None:
    restart = {"kind": "restart", "who": "r2", "at": 4}
    faulty = failing(tmp_path).model_dump(mode="json")
    outcome = run_in_process(load_scenario({**faulty, "faults": [restart]}))
    assert outcome.summary.robots["r2"].status == "alive"
    assert [check.name for check in outcome.verdict.failed] == ["nobody lost"]
