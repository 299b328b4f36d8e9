"""The verdict: a good run passes every check, and every check can fail."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from patrol.journal import JournalWriter, RobotTick, TickRecord, read_journal, trace_hash
from patrol.pose import Pose
from patrol.radio.message import Position, encode
from tests.worldsim.conftest import Lab
from worldsim.run_record import INTERRUPTED, MemoryJournal
from worldsim.verdict.judge import Judge, Verdict, judge
from worldsim.world import World

TICKS = 12
GOOD_EXITS: dict[str, int | None] = {"r1": 0, "r2": 0, "r3": 0, "r4": 0, "world": 0}
NAMES = [
    "complete",
    "trace",
    "nobody lost",
    "exit codes",
    "the down are silent",
    "links add up",
    "robots there",
    "statuses",
    "events",
    "bodies apart",
    "moves",
    "frames",
    "radio",
    "drops",
    "fog",
    "bumps",
    "progress",
]


@pytest.fixture
def world(lab: Lab) -> World:
    return lab.patrol(ticks=TICKS)


@pytest.fixture
def journal(lab: Lab, world: World) -> MemoryJournal:
    return lab.run(world)


@pytest.fixture
def verdict(world: World) -> Callable[..., Verdict]:
    def of(journal: MemoryJournal, exits: dict[str, int | None] = GOOD_EXITS) -> Verdict:
        return judge(journal, exits, world.prepared)

    return of


def only_failure(verdict: Verdict) -> str:
    """The detail of the one check that failed."""
    assert verdict.outcome == "invalid"
    assert verdict.exit_code == 1
    assert len(verdict.failed) == 1, verdict.failed
    return f"{verdict.failed[0].name}: {verdict.failed[0].detail}"


def failures(verdict: Verdict) -> dict[str, str]:
    """The details of the checks that failed, by name."""
    assert verdict.outcome == "invalid"
    return {check.name: check.detail for check in verdict.failed}


def change(journal: MemoryJournal, k: int, rehash: bool = True, **fields: Any) -> None:
    """Alter one tick's record, and make the trace hash agree with it."""
    journal.records[k] = replace(journal.records[k], **fields)
    if rehash:
        agree(journal)


def agree(journal: MemoryJournal) -> None:
    assert journal.end
    journal.end = replace(journal.end, trace_hash=trace_hash(journal.ticks))


def moved(record: TickRecord, index: int, **fields: Any) -> tuple[RobotTick, ...]:
    robots = list(record.robots)
    robots[index] = replace(robots[index], **fields)
    return tuple(robots)


def test_a_good_run_is_valid(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    good = verdict(journal)
    assert good.valid
    assert good.exit_code == 0
    assert [check.name for check in good.checks] == NAMES


def test_a_journal_on_disk_is_judged_the_same(
    journal: MemoryJournal, verdict: Callable[..., Verdict], tmp_path: Path
) -> None:
    with JournalWriter(tmp_path / "journal", journal.header) as writer:
        for record in [*journal.ticks, *journal.events, journal.end]:
            assert record
            writer.write(record)
    assert verdict(read_journal(tmp_path / "journal")) == verdict(journal)


def test_a_missing_tick_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    del journal.records[5]
    agree(journal)
    assert failures(verdict(journal))["complete"] == "tick 6 follows tick 4"


def test_missing_last_ticks_fail(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    del journal.records[-1]
    agree(journal)
    assert only_failure(verdict(journal)) == "complete: 11 of 12 ticks"


def test_an_interrupted_run_is_complete_as_far_as_it_goes(
    journal: MemoryJournal, verdict: Callable[..., Verdict]
) -> None:
    del journal.records[-1]
    agree(journal)
    assert journal.end
    journal.end = replace(journal.end, reason=INTERRUPTED)
    assert verdict(journal).valid


def test_a_run_that_ended_otherwise_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    assert journal.end
    journal.end = replace(journal.end, reason="the disk is full")
    assert only_failure(verdict(journal)) == "complete: the run ended after 12 ticks: the disk is full"


def test_a_journal_without_an_end_cannot_be_judged(journal: MemoryJournal, world: World, tmp_path: Path) -> None:
    path = tmp_path / "journal"
    with JournalWriter(path, journal.header) as writer:
        for record in journal.ticks:
            writer.write(record)
    whole = path.read_bytes()
    for data in (whole, whole[:-3]):
        path.write_bytes(data)
        cut = judge(read_journal(path), GOOD_EXITS, world.prepared)
        assert (cut.outcome, cut.exit_code, cut.valid) == ("unknown", 3, False)
        assert cut.failed[0].name == "complete"


def test_no_journal_cannot_be_judged(world: World) -> None:
    assert judge(None, GOOD_EXITS, world.prepared).exit_code == 3


def test_another_trace_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    heading = journal.records[3].robots[0].heading
    change(journal, 3, rehash=False, robots=moved(journal.records[3], 0, heading=heading + 1e-15))
    assert list(failures(verdict(journal))) == ["trace", "moves"]


def test_another_recorded_trace_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    assert journal.end
    journal.end = replace(journal.end, trace_hash="00" * 32)
    assert only_failure(verdict(journal)).startswith("trace: the ticks' hash is ")


def test_a_lost_robot_fails_and_is_named(lab: Lab, world: World, verdict: Callable[..., Verdict]) -> None:
    journal = lab.run(world, lab.fleet(world, silent={(2, 4, "B")}))
    detail = only_failure(verdict(journal, {**GOOD_EXITS, "r2": -9}))
    assert detail == "nobody lost: lost: r2 at tick 5 (no answer in phase B of tick 4)"


def test_a_robot_lost_in_the_last_tick_fails_too(lab: Lab, world: World, verdict: Callable[..., Verdict]) -> None:
    journal = lab.run(world, lab.fleet(world, silent={(3, TICKS - 1, "A")}))
    assert "r3 at tick 12" in only_failure(verdict(journal))


def killing(lab: Lab, **more: Any) -> tuple[MemoryJournal, World]:
    """A run in which r3 is killed before tick 3."""
    world = lab.patrol(ticks=TICKS, faults=[{"kind": "kill", "who": "r3", "at": 1.5, **more}])
    return lab.run(world), world


def test_a_robot_killed_on_purpose_is_no_failure(lab: Lab) -> None:
    journal, world = killing(lab)
    verdict = judge(journal, {**GOOD_EXITS, "r3": -9}, world.prepared)
    assert verdict.valid, verdict.failed
    assert [check.detail for check in verdict.checks if check.name == "exit codes"] == [
        "4 processes ended with 0, 1 were killed as planned"
    ]


@pytest.mark.parametrize(
    ("code", "says"), [(1, "r4 ended with 1"), (None, "r4 did not end"), (-11, "r4 ended with -11")]
)
def test_a_bad_exit_code_fails(
    journal: MemoryJournal, verdict: Callable[..., Verdict], code: int | None, says: str
) -> None:
    assert only_failure(verdict(journal, {**GOOD_EXITS, "r4": code})) == f"exit codes: {says}"


def test_overlapping_bodies_fail(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    record = journal.records[7]
    change(journal, 7, robots=moved(record, 1, x=record.robots[0].x + 0.5, y=record.robots[0].y))
    assert failures(verdict(journal))["bodies apart"] == "r1 and r2 overlap at tick 7, centres 0.500 m apart"


def test_a_body_over_a_wall_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    change(journal, 7, robots=moved(journal.records[7], 1, x=10.9, y=1.0))
    assert failures(verdict(journal))["bodies apart"] == "r2 is over a wall at tick 7, at (10.900, 1.000)"


def test_a_body_off_the_terrain_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    change(journal, 7, robots=moved(journal.records[7], 1, x=19.9))
    assert "r2 is over a wall" in failures(verdict(journal))["bodies apart"]


def test_of_several_bodies_over_walls_the_first_is_named(
    journal: MemoryJournal, verdict: Callable[..., Verdict]
) -> None:
    for index, y in (1, 1.0), (2, 3.0):
        change(journal, 7, robots=moved(journal.records[7], index, x=10.6, y=y))
    assert failures(verdict(journal))["bodies apart"].startswith("r2 is over a wall at tick 7")


def test_a_vanished_frame_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    change(journal, 7, deliveries=journal.records[7].deliveries[1:])
    assert failures(verdict(journal)) == {
        "links add up": "frame 7 from r1 to r2 was neither delivered nor dropped (1 such frames)",
        "radio": "tick 7: frame 7 from r1 to r2 should have been delivered",
    }


def test_a_doubled_or_invented_frame_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    dropped = ((3, 4, 7, "oversized"),)
    change(journal, 7, dropped=dropped)
    found = failures(verdict(journal))
    assert "frame 7 from r3 to r4 was delivered or dropped but not sent" in found["links add up"]
    assert found["radio"] == "tick 7: frame 7 from r3 to r4 was dropped (oversized) and should not have been"


def test_an_embellished_fog_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    change(journal, 7, mfow=journal.records[7].mfow - 1)
    detail = only_failure(verdict(journal))
    assert detail.startswith("fog: tick 7: the poses give MFoW 3.5 s, ")
    assert "recorded is MFoW 3 s, " in detail


def test_a_score_made_half_as_high_in_every_tick_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    journal.records = [replace(record, mfow=record.mfow // 2) for record in journal.records]
    agree(journal)
    assert only_failure(verdict(journal)).startswith("fog: tick 1: the poses give MFoW 0.5 s, ")


def test_a_judge_who_takes_the_fog_as_it_is_says_nothing_of_it(journal: MemoryJournal, world: World) -> None:
    judging = Judge(journal, GOOD_EXITS, world.prepared, verify_fog=False)
    for record in journal.ticks:
        judging.tick(record)
    without_fog = [name for name in NAMES if name not in ("fog", "progress")]
    assert [check.name for check in judging.verdict().checks] == without_fog


@pytest.mark.parametrize("fields", [{"x": 3.5}, {"y": 3.5}, {"heading": 0.5}], ids=str)
@pytest.mark.parametrize("k", [0, 7, TICKS - 1])
def test_a_body_that_is_not_where_it_went_fails(
    journal: MemoryJournal, verdict: Callable[..., Verdict], k: int, fields: dict[str, float]
) -> None:
    change(journal, k, robots=moved(journal.records[k], 0, **fields))
    detail = failures(verdict(journal))["moves"]
    assert detail.startswith("r1 is at (")
    assert detail.endswith(f"at tick {k}")


def test_the_last_bit_of_a_pose_counts(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    row = journal.records[7].robots[2]
    change(journal, 7, robots=moved(journal.records[7], 2, x=math.nextafter(row.x, math.inf)))
    assert list(failures(verdict(journal))) == ["moves"]


def test_another_command_than_that_obeyed_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    for index, name in ((0, "r1"), (2, "r3")):
        row = journal.records[5].robots[index]
        was = journal.records[5]
        change(journal, 5, robots=moved(was, index, c0=0.5 * row.c0, bumped=False))
        assert only_failure(verdict(journal)).startswith(f"moves: {name} is at (")
        journal.records[5] = was


def test_a_move_that_only_the_record_cancels_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    k, index = next(
        (record.k, index)
        for record in journal.ticks
        for index, row in enumerate(record.robots)
        if record.k < TICKS - 1 and not row.bumped and row.c0
    )
    change(journal, k, robots=moved(journal.records[k], index, bumped=True))
    assert only_failure(verdict(journal)).startswith("moves: ")


def test_a_cancelled_move_that_the_record_lets_happen_fails(
    journal: MemoryJournal, verdict: Callable[..., Verdict]
) -> None:
    k, index = next(
        (record.k, index) for record in journal.ticks for index, row in enumerate(record.robots) if row.bumped
    )
    assert k < TICKS - 1
    change(journal, k, robots=moved(journal.records[k], index, bumped=False))
    assert only_failure(verdict(journal)).startswith("moves: ")


def test_a_dead_body_that_drives_fails(lab: Lab) -> None:
    journal, world = killing(lab)
    change(journal, TICKS - 1, robots=moved(journal.records[-1], 2, c0=1.0))
    assert only_failure(judge(journal, {}, world.prepared)) == f"moves: r3 is dead and drives at tick {TICKS - 1}"


@pytest.mark.parametrize(
    ("index", "fields"),
    [(0, {"c0": 4.5}), (0, {"c1": -0.6}), (0, {"c0": math.nan}), (2, {"c0": 3.2, "c1": 3.2}), (3, {"c1": math.inf})],
)
def test_a_command_beyond_a_robots_limits_fails(
    journal: MemoryJournal, verdict: Callable[..., Verdict], index: int, fields: dict[str, float]
) -> None:
    last = journal.records[-1]
    change(journal, TICKS - 1, robots=moved(last, index, **fields))
    detail = only_failure(verdict(journal))
    assert detail.startswith(f"moves: r{index + 1} obeys ")
    assert "beyond its limits" in detail


def test_a_refused_command_that_drives_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    change(journal, TICKS - 1, robots=moved(journal.records[-1], 0, refused=True))
    assert only_failure(verdict(journal)) == "moves: r1 drives although its command was refused at tick 11"


def test_a_tick_without_one_of_the_robots_fails(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    change(journal, 3, robots=journal.records[3].robots[1:])
    assert failures(verdict(journal))["robots there"] == "tick 3 does not hold the scenario's robots"


@pytest.mark.parametrize(
    "fields",
    [{"x": math.nan}, {"y": math.inf}, {"x": 1e300}, {"y": -5.0}, {"heading": math.nan}, {"number": 9}],
    ids=str,
)
def test_a_robot_that_is_nowhere_fails(
    journal: MemoryJournal, verdict: Callable[..., Verdict], fields: dict[str, Any]
) -> None:
    change(journal, 3, robots=moved(journal.records[3], 1, **fields))
    assert "tick 3" in failures(verdict(journal))["robots there"]


def test_of_several_robots_that_are_nowhere_the_first_is_named(
    journal: MemoryJournal, verdict: Callable[..., Verdict]
) -> None:
    for index in 1, 2:
        change(journal, 3, robots=moved(journal.records[3], index, x=math.nan))
    assert failures(verdict(journal))["robots there"].startswith("r2 is not on the terrain at tick 3")


def frame_of(record: TickRecord, index: int, shift: float = 0.0, **fields: Any) -> bytes:
    row = record.robots[index]
    said = Position.of(row.number, record.k, 0.5 * record.k, Pose(row.x + shift, row.y, row.heading))
    return encode(replace(said, **fields))


@pytest.mark.parametrize(
    "fields",
    [{"shift": 0.01}, {"robot": 4}, {"sequence": 8}, {"time_ms": 3501}, {"heading_mrad": 6283}, {"trail": ((7, 7),)}],
    ids=str,
)
def test_a_frame_that_says_what_is_not_so_fails(
    journal: MemoryJournal, verdict: Callable[..., Verdict], fields: dict[str, Any]
) -> None:
    record = journal.records[7]
    change(journal, 7, frames=((1, frame_of(record, 0, **fields)), *record.frames[1:]))
    assert only_failure(verdict(journal)).startswith("frames: frame 7 of r1 says Position(")


def test_a_frame_with_a_true_trail_is_good(journal: MemoryJournal, verdict: Callable[..., Verdict]) -> None:
    def place(k: int) -> tuple[int, int]:
        row = journal.records[k].robots[0]
        return round(100.0 * row.x), round(100.0 * row.y)

    record = journal.records[7]
    for length in range(1, 5):
        ways = [(place(k - 1), place(k)) for k in range(7, 7 - length, -1)]
        trail = tuple((old[0] - new[0], old[1] - new[1]) for old, new in ways)
        change(journal, 7, frames=((1, frame_of(record, 0, trail=trail)), *record.frames[1:]))
        assert verdict(journal).valid


@pytest.mark.parametrize("frame", [b"", b"nonsense", bytes(65)])
def test_a_frame_that_cannot_be_read_fails(
    journal: MemoryJournal, verdict: Callable[..., Verdict], frame: bytes
) -> None:
    record = journal.records[7]
    change(journal, 7, frames=((1, frame), *record.frames[1:]))
    found = failures(verdict(journal))
    assert found["frames"].startswith("frame 7 of r1 cannot be decoded (malformed")
    assert set(found) == {"frames"} | ({"radio"} if len(frame) > 64 else set())


def test_a_frame_of_a_dead_robot_fails(lab: Lab) -> None:
    journal, world = killing(lab)
    record = journal.records[7]
    change(journal, 7, frames=(*record.frames, (3, frame_of(record, 2))))
    found = failures(judge(journal, {}, world.prepared))
    assert found["frames"] == "frame 7 of r3 has no sender that is alive"
    assert found["the down are silent"] == "r3 is dead at tick 7 and sends"
