"""One tick after the other: what robots are told, what they hear, and what holds when they say nothing."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from patrol.exchange import Reply, Sensed
from patrol.journal import Status, trace_hash
from patrol.pose import Drive, Pose, Velocity
from patrol.radio.message import MAX_CONTACTS, MAX_FRAME, Position, decode, encode
from tests.worldsim.checks.judged import failures
from tests.worldsim.conftest import Lab
from worldsim.fleet.loop import run_ticks
from worldsim.run_record import DESERTED
from worldsim.verdict.judge import judge
from worldsim.world import World

DISC: dict[str, Any] = {"model": "holonomic", "radius": 0.4, "speed": 4.0}


def reply(vx: float, vy: float) -> Reply:
    return Reply(Velocity(vx, vy), "patrolling", None, 1.0, 0)


def test_a_tick_goes_from_poses_to_poses(lab: Lab) -> None:
    world = lab.world([DISC, DISC], [(2.0, 2.0, 0.5), (6.0, 2.0, 0.0)])
    assert world.begin_tick() == {1: Sensed(0, Pose(2.0, 2.0, 0.5)), 2: Sensed(0, Pose(6.0, 2.0, 0.0))}
    assert world.exchange({1: [b"one"], 2: []}) == {1: [], 2: [b"one"]}
    record = world.end_tick({1: reply(2.0, 0.0), 2: reply(0.0, 0.0)})
    assert (record.k, record.robots[0].x, record.robots[0].c0) == (0, 2.0, 2.0)
    assert (record.frames, record.deliveries, record.dropped) == (((1, b"one"),), ((1, 2, 0),), ())
    assert world.begin_tick()[1] == Sensed(1, Pose(3.0, 2.0, 0.0), clock_s=0.5)


def test_robots_are_told_that_they_bumped(lab: Lab) -> None:
    world = lab.world([DISC, DISC], [(2.0, 2.0, 0.0), (3.0, 2.0, 0.0)])
    world.begin_tick()
    record = world.end_tick({1: reply(2.0, 0.0), 2: reply(0.0, 0.0)})
    assert [row.bumped for row in record.robots] == [True, False]
    told = Sensed(1, Pose(2.0, 2.0, 0.0), bumped=True, clock_s=0.5), Sensed(1, Pose(3.0, 2.0, 0.0), clock_s=0.5)
    assert world.begin_tick() == dict(enumerate(told, start=1))
    world.end_tick({1: reply(-2.0, 0.0), 2: reply(0.0, 0.0)})
    assert world.begin_tick()[1] == Sensed(2, Pose(1.0, 2.0, math.pi), clock_s=1.0)


def test_the_fog_is_seen_from_the_pose_as_sent(lab: Lab) -> None:
    # 4 mm short of the next point: the wire's rounding to 1 cm carries the footprint across.
    near, exact = lab.world([DISC], [(5.996, 5.1, 0.0)]), lab.world([DISC], [(6.0, 5.1, 0.0)])
    near.begin_tick()
    exact.begin_tick()
    assert np.array_equal(near.truth.fog.last_seen, exact.truth.fog.last_seen)


def test_fog_grows_where_nobody_looks(lab: Lab) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)])
    records = []
    for _ in range(5):
        world.begin_tick()
        records.append(world.end_tick({1: reply(0.0, 0.0)}))
    assert [record.mfow for record in records] == [0, 1, 2, 3, 4]
    assert records[-1].seen == records[0].seen > 0
    assert 0 < records[-1].fog_mean < 4


def test_the_dead_neither_see_nor_hear_but_are_in_the_way(lab: Lab) -> None:
    world = lab.world([DISC, DISC], [(2.0, 2.0, 0.0), (12.0, 2.0, 0.0)])
    world.begin_tick()
    before = world.end_tick({1: reply(0.0, 0.0), 2: reply(1.0, 0.0)})
    event = world.stand_down(2, Status.DEAD, "killed")
    assert (event.k, event.kind, event.robot, event.detail) == (1, "dead", 2, "killed")
    assert list(world.begin_tick()) == [1]
    assert world.exchange({1: [b"one"], 2: [b"ghost"]}) == {1: []}
    after = world.end_tick({1: reply(0.0, 0.0), 2: reply(1.0, 0.0)})
    assert after.robots[1].status is Status.DEAD
    assert (after.robots[1].x, after.robots[1].c0) == (12.5, 0.0)
    assert after.dropped == ((1, 2, 1, "receiver dead"),)
    assert after.seen == before.seen
    assert world.bodies[2].pose.x == 12.5


@pytest.mark.parametrize("bad", [Velocity(math.nan, 0.0), Velocity(0.0, math.inf), Drive(1.0, 0.0)])
def test_nonsense_stops_a_robot_and_is_recorded(lab: Lab, bad: Velocity | Drive) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)])
    world.begin_tick()
    world.end_tick({1: reply(1.0, 0.0)})
    world.begin_tick()
    record = world.end_tick({1: Reply(bad, "patrolling", None, 1.0, 0)})
    assert (record.robots[0].c0, record.robots[0].c1, record.robots[0].bumped) == (0.0, 0.0, False)
    assert record.robots[0].refused
    assert world.bodies[1].pose.x == 2.5
    world.begin_tick()
    assert not world.end_tick({1: reply(1.0, 0.0)}).robots[0].refused


def test_in_lockstep_a_robot_without_a_command_stops(lab: Lab) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)])
    rows = []
    for answer in ({1: reply(1.0, 0.0)}, {}, {}):
        world.begin_tick()
        rows.append(world.end_tick(answer).robots[0])
    assert world.bodies[1].pose.x == 2.5
    assert (rows[-1].decision_ms, rows[-1].rejected, rows[-1].state) == (None, None, "")


def test_in_real_time_the_last_command_holds_until_the_watchdog(lab: Lab) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)], pace="realtime", watchdog=1.5)
    places = []
    for answer in ({1: reply(1.0, 0.0)}, {}, {}, {}, {}, {1: reply(1.0, 0.0)}, {}):
        world.begin_tick()
        world.end_tick(answer)
        places.append(world.bodies[1].pose.x)
    assert places == [2.5, 3.0, 3.5, 3.5, 3.5, 4.0, 4.5]


def test_the_same_seed_gives_the_same_trace_and_another_does_not(lab: Lab) -> None:
    traces = [trace_hash(lab.run(lab.patrol(seed=seed)).ticks) for seed in (1, 1, 2)]
    assert traces[0] == traces[1] != traces[2]


def test_distances_and_collisions_of_a_run_are_those_of_its_bodies(lab: Lab) -> None:
    world, journal = lab.driven()
    assert sum(body.collisions for body in world.bodies.values()) > 0
    for index, body in enumerate(world.bodies.values()):
        rows = [record.robots[index] for record in journal.ticks]
        assert body.collisions == sum(row.bumped for row in rows)
        gone = [math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(rows)]
        assert sum(gone) <= body.distance_m + 1e-9


def test_everyone_hears_this_ticks_positions_of_all_others(lab: Lab) -> None:
    world = lab.patrol(ticks=3)
    fleet = lab.fleet(world)
    journal = lab.run(world, fleet)
    for record, heard in zip(journal.ticks, fleet.heard, strict=True):
        for number, frames in heard.items():
            positions = [decode(frame) for frame in frames]
            assert [position.robot for position in positions] == [n for n in (1, 2, 3, 4) if n != number]
            for position in positions:
                row = record.robots[position.robot - 1]
                assert position == Position.of(row.number, record.k, record.k * 0.5, Pose(row.x, row.y, row.heading))


@pytest.mark.parametrize("phase", ["A", "B"])
def test_a_robot_that_stops_answering_is_lost_after_that_tick(lab: Lab, phase: str) -> None:
    world = lab.patrol(ticks=10)
    journal = lab.run(world, lab.fleet(world, silent={(2, 4, phase)}))
    assert [(e.k, e.kind, e.robot) for e in journal.events] == [(5, "lost", 2)]
    assert phase in journal.events[0].detail
    statuses = [record.robots[1].status for record in journal.ticks]
    assert statuses == [Status.ALIVE] * 5 + [Status.LOST] * 5
    last = journal.records[-1]
    assert len(last.frames) == 3
    assert len(last.deliveries) == 6


def test_a_robot_that_dies_in_phase_a_hears_nothing_any_more(lab: Lab) -> None:
    world = lab.patrol(ticks=6)
    fleet = lab.fleet(world, silent={(2, 4, "A")})
    journal = lab.run(world, fleet)
    record = journal.records[4]
    assert record.robots[1].status is Status.ALIVE
    assert [source for source, _ in record.frames] == [1, 3, 4]
    assert list(fleet.heard[4]) == [1, 3, 4]
    assert record.dropped == tuple((source, 2, 4, "receiver dead") for source in (1, 3, 4))
    assert all(2 not in delivery[:2] for delivery in record.deliveries)
    assert judge(journal, {}, world.prepared).failed[0].name == "nobody lost"


def test_a_robot_that_the_fleet_reports_gone_is_gone(lab: Lab) -> None:
    world = lab.patrol(ticks=6)
    fleet = lab.fleet(world, killed={2: (3, Status.DEAD)})
    journal = lab.run(world, fleet)
    assert [(e.k, e.kind, e.robot) for e in journal.events] == [(3, "dead", 3)]
    assert [sorted(heard) for heard in fleet.heard] == [[1, 2, 3, 4]] * 3 + [[1, 2, 4]] * 3


def test_a_run_can_be_stopped_between_ticks(lab: Lab) -> None:
    world = lab.patrol(ticks=50)
    fleet = lab.fleet(world)
    answers = iter([False] * 7 + [True])
    journal = lab.run(world, fleet, stop=lambda: next(answers))
    assert len(journal.records) == 7
    assert fleet.finished == 7


def test_the_fleet_is_told_the_end_even_when_the_sink_fails(lab: Lab) -> None:
    world = lab.patrol(ticks=5)
    fleet = lab.fleet(world)

    def full(_: object) -> None:
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        run_ticks(world, fleet, full, full)
    assert fleet.finished == 1


def test_oversized_frames_are_dropped_and_counted(lab: Lab) -> None:
    world = lab.world([DISC, DISC], [(2.0, 2.0, 0.0), (6.0, 2.0, 0.0)])
    world.begin_tick()
    assert world.exchange({1: [bytes(MAX_FRAME + 1)], 2: [bytes(MAX_FRAME)]}) == {1: [bytes(MAX_FRAME)], 2: []}
    record = world.end_tick({1: reply(0.0, 0.0), 2: reply(0.0, 0.0)})
    assert (record.deliveries, record.dropped) == (((2, 1, 0),), ((1, 2, 0, "oversized"),))


def test_a_run_ends_when_nobody_is_living(lab: Lab) -> None:
    world = lab.patrol(ticks=50)
    fleet = lab.fleet(world, silent={(number, 5, "A") for number in (1, 2, 3, 4)})
    ended = run_ticks(world, fleet, lambda _: None, lambda _: None)
    assert ended == DESERTED
    assert (world.tick, fleet.finished) == (6, 6)


# --- intruders -------------------------------------------------------------------------------------------------------


def contacts(world: World) -> dict[int, tuple[tuple[float, float], ...]]:
    return {number: report.contacts for number, report in world.begin_tick().items()}


def test_an_intruder_is_seen_in_range_and_in_sight_only(lab: Lab) -> None:
    starts = [(9.0, 2.0, 0.0), (12.0, 2.0, 0.0), (9.0, 6.0, 0.0)]
    world = lab.world([DISC] * 3, starts, intruders=[{"place": [11.0, 2.0]}])
    assert contacts(world) == {1: (), 2: ((11.0, 2.0),), 3: ()}  # behind the wall, in sight, too far


def test_an_intruder_is_there_during_its_time(lab: Lab) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)], intruders=[{"place": [3.0, 2.0], "at": 1.0, "for": 1.5}])
    seen = []
    for _ in range(7):
        seen.append(bool(contacts(world)[1]))
        world.end_tick({1: reply(0.0, 0.0)})
    assert seen == [False, False, True, True, True, False, False]


def test_an_intruder_is_in_nobodys_way(lab: Lab) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)], intruders=[{"place": [3.0, 2.0]}])
    world.begin_tick()
    record = world.end_tick({1: reply(2.0, 0.0)})
    assert not record.robots[0].bumped
    assert world.bodies[1].pose.x == 3.0


def test_of_many_intruders_the_nearest_are_seen(lab: Lab) -> None:
    places = [[2.0 + 0.3 * index, 2.5] for index in (5, 1, 4, 2, 3)]
    world = lab.world([DISC], [(2.0, 2.0, 0.0)], intruders=[{"place": place} for place in places])
    seen = contacts(world)[1]
    assert len(seen) == MAX_CONTACTS
    assert [x for x, _ in seen] == sorted(x for x, _ in places)[:MAX_CONTACTS]


def test_contacts_are_carried_and_a_run_with_them_is_valid(lab: Lab) -> None:
    world, journal = lab.driven(ticks=20, intruders=[{"place": [4.0, 4.0]}, {"place": [4.0, 5.0]}])
    frames = [(source, decode(frame)) for record in journal.ticks for source, frame in record.frames]
    reported = [(source, frame) for source, frame in frames if frame.robot == 0]
    assert {source for source, _ in reported} >= {1}
    assert all(len(frame) <= MAX_FRAME for record in journal.ticks for _, frame in record.frames)
    first = next(iter(journal.ticks))
    assert [source for source, _ in first.frames] == [1, 1, 1, 2, 3, 4]
    assert len({*first.deliveries}) == len(first.deliveries) == 6 * 3
    assert failures((world, journal)) == {}


@pytest.mark.parametrize(("x", "k", "twice"), [(4.5, 0, False), (4.0, 1, False), (4.0, 0, True)])
def test_a_report_of_what_its_sender_does_not_see_fails(lab: Lab, x: float, k: int, twice: bool) -> None:
    world, journal = lab.driven(ticks=5, intruders=[{"place": [4.0, 4.0]}])
    first = journal.records[0]
    false = encode(Position.of_contact(k, 0.5 * k, x, 4.0))
    reports = [*([frame for source, frame in first.frames if source == 1][1:] if twice else []), false]
    kept = [(source, frame) for source, frame in first.frames if source != 1 or decode(frame).robot == 1]
    journal.records[0] = replace(first, frames=(*kept, *((1, frame) for frame in reports)))
    assert "sees no such intruder" in failures((world, journal))["frames"]


def test_a_contact_that_its_sender_sees_and_does_not_report_fails(lab: Lab) -> None:
    world, journal = lab.driven(ticks=5, intruders=[{"place": [4.0, 4.0]}])
    first = journal.records[0]
    assert [source for source, _ in first.frames] == [1, 1, 2, 3, 4]
    journal.records[0] = replace(first, frames=(first.frames[0], *first.frames[2:]))
    assert failures((world, journal))["frames"] == "r1 did not send a contact in tick 0"
