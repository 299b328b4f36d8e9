"""The verdict on faults that befall robots: planned ones pass, and every check can fail."""

from dataclasses import replace
from typing import Any

import pytest

from patrol.journal import Event, RobotTick, Status
from tests.worldsim.checks.judged import Result, change, checks, failures, move
from tests.worldsim.conftest import Lab
from worldsim.checks.check import CheckResult
from worldsim.faults import LOOKED_AT, STOPPED, UNSEEN

TICKS = 16
DISC = {"model": "holonomic", "radius": 0.4}
STARTS = [(3.0, 3.0, 0.0), (7.0, 11.0, 0.0), (14.0, 4.0, 0.0)]
FAULTS = [
    {"kind": "kill", "who": "r2", "at": 2.0, "wreck": "removed"},
    {"kind": "restart", "who": "r2", "at": 5.0},
    {"kind": "pause", "who": "r1", "at": 3.0, "for": 1.5},
    {"kind": "join", "who": "r3", "at": 1.0},
    {"kind": "leave", "who": "r3", "at": 6.0},
]
"""r2 is dead over ticks 4 to 9, r1 paused over 6 to 8, r3 there over 2 to 11."""

EXITS: dict[str, int | None] = {"the world": 0, "r1": 0, "r2": -9, "r2 (2)": 0, "r3": 0}


@pytest.fixture
def run(lab: Lab) -> Result:
    world = lab.world([DISC] * 3, STARTS, duration=0.5 * TICKS, faults=FAULTS)
    return world, lab.run(world, lab.fleet(world, seed=world.scenario.seed, seen=STOPPED))


def row(run: Result, k: int, number: int) -> RobotTick:
    return run[1].records[k].robots[number - 1]


def test_what_was_planned_is_valid(run: Result) -> None:
    assert failures(run, EXITS) == {}
    details = {name: check.detail for name, check in checks(run, EXITS).items()}
    assert details["statuses"] == "6 changes as planned"
    assert details["exit codes"] == "4 processes ended with 0, 1 were killed as planned"
    assert details["the down are silent"] == "in 15 ticks of robots"
    assert details["the paused stand still"] == "2 inspections found the process stopped"


@pytest.mark.parametrize(
    ("k", "number", "status", "says"),
    [
        (4, 2, Status.ALIVE, "r2 is alive at tick 4, but should be dead"),
        (10, 2, Status.DEAD, "r2 is dead at tick 10, but should be alive"),
        (3, 1, Status.DEAD, "r1 is dead at tick 3, but should be alive"),
        (7, 1, Status.DEAD, "r1 is dead at tick 7, but should be paused"),
        (1, 3, Status.ALIVE, "r3 is alive at tick 1, but should be absent"),
        (12, 3, Status.ALIVE, "r3 is alive at tick 12, but should be left"),
    ],
)
def test_another_status_than_planned_fails(run: Result, k: int, number: int, status: Status, says: str) -> None:
    move(run[1], k, number, status=status)
    assert failures(run)["statuses"] == says


@pytest.mark.parametrize(("apart", "waits"), [(0.9, True), (1.0 - 1e-9, True), (1.0, False)])
def test_a_start_is_taken_until_bodies_of_unequal_size_just_touch(lab: Lab, apart: float, waits: bool) -> None:
    faults = [{"kind": "kill", "who": "r1", "at": 0.0}, {"kind": "join", "who": "r2", "at": 1.0}]
    robots = [{**DISC, "radius": 0.25}, {**DISC, "radius": 0.75}]
    starts = [(2.0, 3.0, 0.0), (2.0 + apart, 3.0, 0.0)]
    world = lab.world(robots, starts, duration=4.0, faults=faults)
    run = world, lab.run(world)
    assert failures(run) == {}
    assert [event.detail for event in run[1].events if event.kind == "waiting"] == ["its start is taken by r1"] * waits


def test_who_appears_where_another_stands_fails(lab: Lab) -> None:
    faults = [{"kind": "kill", "who": "r1", "at": 0.0}, {"kind": "join", "who": "r2", "at": 1.0}]
    world = lab.world([DISC] * 2, [(3.0, 3.0, 0.0), (3.1, 3.0, 0.0)], duration=4.0, faults=faults)
    run = world, lab.run(world)
    assert failures(run) == {}
    move(run[1], 5, 2, status=Status.ALIVE)
    found = failures(run)
    assert found["statuses"] == "r2 is alive at tick 5, but should be absent"
    assert found["bodies apart"].startswith("r1 and r2 overlap at tick 5")


@pytest.mark.parametrize(("apart", "comes_at"), [(0.625, 16), (0.75, 4), (0.875, 4)])
def test_a_start_is_taken_while_bodies_of_two_sizes_would_overlap(
    lab: Lab, monkeypatch: pytest.MonkeyPatch, apart: float, comes_at: int
) -> None:
    """Radii 0.25 and 0.5 m; touching is no overlap. The verdict knows it without the world's code."""
    small = {"model": "holonomic", "radius": 0.25}
    starts = [(4.0, 3.0, 0.0), (4.0 + apart, 3.0, 0.0)]
    faults = [{"kind": "kill", "who": "r1", "at": 0.0}, {"kind": "join", "who": "r2", "at": 2.0}]
    settings: dict[str, Any] = {"duration": 8.0, "faults": faults}
    world = lab.world([{**small, "radius": 0.5}, small], starts, **settings)
    run = world, lab.run(world)
    assert failures(run) == {}
    assert [row(run, k, 2).status is Status.ALIVE for k in (comes_at - 1, min(comes_at, 15))] == [False, comes_at < 16]
    monkeypatch.setattr("worldsim.world.overlap", lambda _one, _a, _other, _b: comes_at < 16)
    world = lab.world([{**small, "radius": 0.5}, small], starts, **settings)
    assert "statuses" in failures((world, lab.run(world)))


def test_at_a_pace_a_robot_may_come_late_but_not_early(lab: Lab) -> None:
    faults = [{"kind": "join", "who": "r3", "at": 2.0}]
    world = lab.world([DISC] * 3, STARTS, duration=0.5 * TICKS, pace=10, faults=faults)
    run = world, lab.run(world, lab.fleet(world, late={3: 9}))
    assert failures(run) == {}
    move(run[1], 3, 3, status=Status.ALIVE)
    assert failures(run)["statuses"] == "r3 is alive at tick 3, but should be absent"


def test_a_removed_wreck_may_be_driven_over_and_one_that_stays_may_not(run: Result) -> None:
    there = row(run, 8, 1)
    for k in range(8, 10):
        move(run[1], k, 2, x=there.x, y=there.y)
    assert "bodies apart" not in failures(run)
    move(run[1], 3, 2, x=row(run, 3, 1).x, y=row(run, 3, 1).y)
    assert failures(run)["bodies apart"].startswith("r1 and r2 overlap at tick 3")


def test_who_comes_back_elsewhere_than_at_its_start_fails(run: Result) -> None:
    for k in range(10, TICKS):
        move(run[1], k, 2, x=row(run, k, 2).x + 0.5)
    assert failures(run)["moves"].startswith("r2 is at (7.5, 11.0; 0.0 rad) and not at (7.0, 11.0; 0.0 rad)")


@pytest.mark.parametrize(("k", "number", "status"), [(5, 2, "dead"), (7, 1, "paused"), (0, 3, "absent")])
def test_the_down_neither_send_hear_nor_decide(run: Result, k: int, number: int, status: str) -> None:
    record = run[1].records[k]
    frame = next(frame for _, frame in record.frames)
    variants = {
        "sends": replace(record, frames=(*record.frames, (number, frame))),
        "hears": replace(record, deliveries=(*record.deliveries, (2 if number != 2 else 3, number, k))),
    }
    for what, changed in variants.items():
        change(run[1], k, frames=changed.frames, deliveries=changed.deliveries)
        assert failures(run)["the down are silent"] == f"r{number} is {status} at tick {k} and {what}"
    for field, value in {"state": "x", "goal": (1.0, 2.0), "decision_ms": 3.0, "rejected": 0, "refused": True}.items():
        run[1].records[k] = record
        move(run[1], k, number, **{field: value})
        assert failures(run)["the down are silent"] == f"r{number} is {status} at tick {k} and decides"


@pytest.mark.parametrize(
    ("exits", "says"),
    [
        ({"r2": 0}, "r2 ended with 0, not with -9 as planned"),
        ({"r2": -9, "r2 (2)": -9}, "r2 (2) ended with -9"),
        ({"r1": -9}, "r1 ended with -9"),
        ({"r3": 130}, "r3 ended with 130"),
        ({"the world": -9}, "the world ended with -9"),
        ({"r1": None}, "r1 did not end"),
        ({"r2": None}, "r2 did not end, not with -9 as planned"),
    ],
)
def test_a_process_that_ends_otherwise_than_planned_fails(run: Result, exits: dict[str, int | None], says: str) -> None:
    assert failures(run, EXITS | exits) == {"exit codes": says}


@pytest.mark.parametrize("name", ["r1", "r2", "r2 (2)", "r3"])
def test_a_process_of_which_nobody_knows_how_it_ended_fails(run: Result, name: str) -> None:
    """A launcher that forgets a process it killed, started again, or started at the beginning."""
    told = {other: code for other, code in EXITS.items() if other != name}
    assert failures(run, told) == {"exit codes": f"the exit code of {name} is unknown"}


def test_how_a_lost_or_belated_process_ends_says_nothing(run: Result) -> None:
    assert failures(run, EXITS | {"r2 (3)": 130, "r3 (2)": 130}) == {}
    run[1].events += (Event(TICKS, "lost", 1, "its process was gone"),)
    assert list(failures(run, EXITS | {"r1": 1})) == ["nobody lost"]
    assert list(failures(run, {name: code for name, code in EXITS.items() if name != "r1"})) == ["nobody lost"]


def seen(run: Result, *details: str, k: int = 6) -> None:
    """Let the launcher have seen this of r1 when it was paused, or at tick 9 when that ended."""
    events = [event for event in run[1].events if (event.kind, event.k) != (LOOKED_AT, k)]
    place = next(place for place, e in enumerate(events) if (e.k, e.robot) == (k, 1) and e.kind in ("paused", "alive"))
    events[place + 1 : place + 1] = [Event(k, LOOKED_AT, 1, detail) for detail in details]
    run[1].events = tuple(events)


@pytest.mark.parametrize(("k", "when"), [(6, "at tick 6"), (9, "until tick 9")])
@pytest.mark.parametrize(
    ("details", "says"),
    [(("its process has the state S and does not stand still",), ""), ((), "its process was not inspected")],
)
def test_a_paused_process_that_does_not_stand_still_or_that_nobody_looked_at_fails(
    run: Result, k: int, when: str, details: tuple[str, ...], says: str
) -> None:
    seen(run, *details, k=k)
    detail = f"r1 was paused {when}, but {says or details[0]}"
    assert failures(run, EXITS) == {"the paused stand still": detail}


def test_where_nobody_can_look_it_is_not_judged(run: Result) -> None:
    seen(run)
    detail = "the run had no processes"
    assert checks(run)["the paused stand still"] == CheckResult("the paused stand still", True, detail, judged=False)
    seen(run, UNSEEN)
    detail = "in 1 of 2 inspections the state of the process was unknown"
    check = CheckResult("the paused stand still", True, detail, judged=False)
    assert checks(run, EXITS)["the paused stand still"] == check
