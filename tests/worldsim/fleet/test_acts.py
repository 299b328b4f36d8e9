"""Faults of robots between ticks: which take part, which stand in the way, where they come back."""

from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.exchange import FIRST_INCARNATION
from patrol.journal import Status, TickRecord
from patrol.journal.records import Event
from tests.worldsim.checks.judged import failures
from tests.worldsim.conftest import Lab
from worldsim.fleet.acts import Acts
from worldsim.fleet.loop import act_between_ticks, begin_tick, end_tick, run_ticks
from worldsim.run_record import COMPLETED, DESERTED, MemoryJournal

DISC = {"model": "holonomic", "radius": 0.4}
STARTS = [(3.0, 3.0, 0.0), (7.0, 11.0, 0.0), (14.0, 4.0, 0.0)]
A, P, D, L, G, X = Status.ALIVE, Status.PAUSED, Status.DEAD, Status.LOST, Status.LEFT, Status.ABSENT
NEVER = -1


def fault(kind: str, who: Any, k: int, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "who": who, "at": 0.5 * k, **more}


def run(lab: Lab, faults: list[dict[str, Any]], ticks: int = 12, **fleet: Any) -> tuple[MemoryJournal, list[Any]]:
    """A valid run of three robots; its journal, and what the hands were asked for."""
    world = lab.world([DISC] * 3, STARTS, duration=0.5 * ticks, faults=faults)
    driven = lab.fleet(world, **fleet)
    journal = lab.run(world, driven)
    assert set(failures((world, journal))) <= {"nobody lost"}
    return journal, driven.done


def statuses(journal: MemoryJournal, number: int) -> list[Status]:
    return [record.robots[number - 1].status for record in journal.records]


def news(journal: MemoryJournal) -> list[tuple[int, str, int | None, str]]:
    return [(e.k, e.kind, e.robot, e.detail) for e in journal.events if e.kind != "fault"]


def test_a_killed_robot_is_silent_and_its_wreck_stays(lab: Lab) -> None:
    journal, done = run(lab, [fault("kill", "r2", 4)])
    assert statuses(journal, 2) == [A] * 4 + [D] * 8
    assert done == [("kill", 2)]
    assert news(journal) == [(4, "dead", 2, "f1 kill")]
    last = [(r.robots[1].x, r.robots[1].y) for r in journal.records[4:]]
    assert len(set(last)) == 1
    assert {source for record in journal.records[4:] for source, _ in record.frames} == {1, 3}


@pytest.mark.parametrize("wreck", ["stays", "removed"])
def test_a_restarted_robot_wakes_up_in_its_wreck_or_at_its_start(lab: Lab, wreck: str) -> None:
    journal, done = run(lab, [fault("kill", "r2", 4, wreck=wreck), fault("restart", "r2", 7)])
    assert statuses(journal, 2) == [A] * 4 + [D] * 3 + [A] * 5
    assert done == [("kill", 2), ("start 2", 2)]
    dead, woken = (journal.records[k].robots[1] for k in (6, 7))
    assert (dead.x, dead.y) != STARTS[1][:2]
    place = (dead.x, dead.y, dead.heading) if wreck == "stays" else STARTS[1]
    assert (woken.x, woken.y, woken.heading) == place
    assert news(journal)[-1] == (7, "alive", 2, "f2 restart: process 2")


def test_a_living_robot_is_restarted_at_once(lab: Lab) -> None:
    journal, done = run(lab, [fault("restart", "r2", 4), fault("restart", "r2", 8)])
    assert statuses(journal, 2) == [A] * 12
    assert done == [("kill", 2), ("start 2", 2), ("kill", 2), ("start 3", 2)]


def test_a_paused_robot_stands_still_and_goes_on(lab: Lab) -> None:
    journal, done = run(lab, [fault("pause", "r2", 4), fault("resume", "r2", 7)])
    assert statuses(journal, 2) == [A] * 4 + [P] * 3 + [A] * 5
    assert done == [("pause", 2), ("resume", 2)]
    assert len({(r.robots[1].x, r.robots[1].y) for r in journal.records[4:8]}) == 1
    assert {dropped[3] for r in journal.records[4:7] for dropped in r.dropped if dropped[1] == 2} == {"receiver paused"}


def test_those_still_paused_at_the_end_are_let_go(lab: Lab) -> None:
    _, done = run(lab, [fault("pause", ["r1", "r3"], 4), fault("kill", "r3", 6)])
    assert done[-1] == ("release", 1)


def test_a_robot_that_joins_was_not_there_before(lab: Lab) -> None:
    journal, done = run(lab, [fault("join", "r3", 5)])
    assert statuses(journal, 3) == [X] * 5 + [A] * 7
    assert done == [("start 1", 3)]
    row = journal.records[5].robots[2]
    assert (row.x, row.y, row.heading) == STARTS[2]


def test_it_waits_until_its_place_is_free(lab: Lab) -> None:
    """The wreck of r1 lies where r2 is to appear, until it wakes up and drives away."""
    faults = [fault("kill", "r1", 0), fault("join", "r2", 5), fault("restart", "r1", 7)]
    world = lab.world([DISC, DISC], [(3.0, 3.0, 0.0), (3.1, 3.0, 0.0)], duration=6.0, faults=faults)
    journal = lab.run(world)
    told = [entry for entry in news(journal) if entry[2] == 2]
    assert told[0] == (5, "waiting", 2, "its start is taken by r1")
    assert [entry[1] for entry in told] == ["waiting", "alive"]
    assert told[1][0] > 7
    assert statuses(journal, 2) == [X] * told[1][0] + [A] * (12 - told[1][0])
    assert failures((world, journal)) == {}


def test_each_wait_for_its_start_is_told(lab: Lab) -> None:
    """r2 has come and left; when it joins again, r1 has just appeared at the same place, and r2 waits a second time."""
    faults = [
        fault("kill", "r1", 0),
        fault("join", "r2", 2),
        fault("restart", "r1", 4),
        fault("leave", "r2", 14),
        fault("kill", "r1", 15, wreck="removed"),
        fault("restart", "r1", 16),
        fault("join", "r2", 16),
    ]
    world = lab.world([DISC, DISC], [(3.0, 3.0, 0.0), (3.1, 3.0, 0.0)], duration=11.0, faults=faults)
    told = [entry for entry in news(lab.run(world)) if entry[2] == 2]
    assert [entry[1] for entry in told] == ["waiting", "alive", "left", "waiting", "alive"]
    assert [entry[0] for entry in told if entry[1] == "waiting"] == [2, 16]


def test_a_robot_that_leaves_is_gone_and_may_join_again(lab: Lab) -> None:
    journal, done = run(lab, [fault("leave", "r2", 3)])
    assert statuses(journal, 2) == [A] * 3 + [G] * 9
    assert done == [("leave", 2)]
    journal, done = run(lab, [fault("join", "r2", 2), fault("leave", "r2", 4), fault("join", "r2", 8)])
    assert statuses(journal, 2) == [X] * 2 + [A] * 2 + [G] * 4 + [A] * 4
    assert done == [("start 1", 2), ("leave", 2), ("start 2", 2)]


@pytest.mark.parametrize(
    ("before", "then", "state"),
    [
        ([("kill", 2)], "kill", "dead"),
        ([("kill", 2)], "pause", "dead"),
        ([("kill", 2)], "leave", "dead"),
        ([], "resume", "alive"),
        ([("pause", 2)], "pause", "paused"),
        ([("leave", 2)], "restart", "gone"),
        ([("join", 8)], "kill", "not there yet"),
    ],
)
def test_what_makes_no_sense_is_skipped_and_told(
    lab: Lab, before: list[tuple[str, int]], then: str, state: str
) -> None:
    faults = [fault(kind, "r2", k) for kind, k in before]
    journal, done = run(lab, [*faults, fault(then, "r2", 4)])
    assert (4, "skipped", 2, f"f{len(faults) + 1} {then}: r2 is {state}") in news(journal)
    assert (then, 2) not in done[1:] or before == []


def test_at_a_pace_a_robot_takes_part_when_its_process_is_there(lab: Lab) -> None:
    faults = [fault("join", "r3", 3), fault("kill", "r3", 5)]
    world = lab.world([DISC] * 3, STARTS, duration=6.0, pace=10, faults=faults)
    journal = lab.run(world, lab.fleet(world, late={3: 7}))
    assert statuses(journal, 3) == [X] * 7 + [A] * 5
    assert (5, "skipped", 3, "f2 kill: r3 is being started") in news(journal)
    assert failures((world, journal)) == {}


def test_a_robot_whose_process_never_comes_is_lost(lab: Lab) -> None:
    journal, _ = run(lab, [fault("kill", "r2", 3), fault("restart", "r2", 6)], late={2: NEVER})
    assert statuses(journal, 2) == [A] * 3 + [D] * 3 + [L] * 6
    assert news(journal)[-1] == (6, "lost", 2, "it did not come")


def test_a_lost_robot_can_be_restarted(lab: Lab) -> None:
    journal, done = run(lab, [fault("restart", "r2", 6)], killed={2: (2, Status.LOST)})
    assert statuses(journal, 2) == [A] * 3 + [L] * 3 + [A] * 6
    assert done == [("kill", 2), ("start 2", 2)]


def test_the_world_goes_on_with_nobody_in_it(lab: Lab) -> None:
    journal, _ = run(lab, [fault("kill", "all", 3), fault("restart", "r2", 9)])
    assert len(journal.records) == 12
    assert [record.mfow for record in journal.records] == list(range(12))
    journal, _ = run(lab, [fault("kill", "all", 3)])
    assert len(journal.records) == 12


def test_a_world_that_everybody_was_lost_from_waits_for_those_who_are_to_come(lab: Lab) -> None:
    def ended(faults: list[dict[str, Any]]) -> tuple[str, int]:
        world = lab.world([DISC] * 2, STARTS[:2], duration=6.0, faults=faults)
        fleet = lab.fleet(world, killed={2: (1, Status.LOST)})
        ticks: list[TickRecord] = []
        events: list[Event] = []
        return run_ticks(world, fleet, ticks.append, events.append, control=fleet), len(ticks)

    assert ended([fault("kill", "r2", 1)]) == (DESERTED, 3)
    assert ended([fault("kill", "r2", 1), fault("restart", "r2", 8)]) == (COMPLETED, 12)


def test_process_faults_need_hands(lab: Lab) -> None:
    world = lab.world([DISC] * 2, STARTS[:2], faults=[fault("pause", "one", 3)])
    with pytest.raises(BadInput, match="fogwatch run"):
        run_ticks(world, lab.fleet(world), lambda _tick: None, lambda _event: None)


def test_incarnations_count_a_robots_minds(lab: Lab) -> None:
    world = lab.world([DISC] * 3, STARTS, faults=[fault("join", "r3", 2)])
    assert [body.incarnation for body in world.bodies.values()] == [FIRST_INCARNATION, FIRST_INCARNATION, 0]


def test_a_robot_will_be_alive_if_an_act_to_come_makes_it_so(lab: Lab) -> None:
    faults = [fault("kill", "r1", 2), fault("kill", "r2", 2), fault("restart", "r2", 6)]
    faults += [fault("pause", "r3", 2, **{"for": 1.0}), fault("leave", "r3", 8)]
    world = lab.world([DISC] * 3, STARTS, duration=6.0, faults=faults)
    fleet = lab.fleet(world)
    acts = Acts(world, fleet)
    expected = {0: [1, 2, 3], 2: [2, 3], 5: [2, 3], 6: [2, 3], 8: [2]}
    found = {}
    while world.tick < world.ticks:
        assert act_between_ticks(world, acts, lambda _: None)
        if world.tick in expected:
            found[world.tick] = [number for number in (1, 2, 3) if acts.will_be_alive(number)]
        end_tick(world, fleet, begin_tick(world, fleet), lambda _: None, lambda _: None)
    assert found == expected
