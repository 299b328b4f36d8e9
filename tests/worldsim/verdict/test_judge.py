"""The verdict: a good run passes every check, and every check can fail."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from patrol.journal import JournalWriter, TickRecord, read_journal
from patrol.pose import Pose
from patrol.radio.message import Position, encode
from patrol.random import draw
from tests.worldsim.checks.judged import Exits, Result, change, checks, failures, move, rehash
from tests.worldsim.conftest import Lab
from worldsim.checks.check import CheckResult
from worldsim.run_record import INTERRUPTED
from worldsim.verdict.judge import CHECKS, Judge, judge

TICKS = 12
GOOD_EXITS: dict[str, int | None] = {"r1": 0, "r2": 0, "r3": 0, "r4": 0, "world": 0}
NAMES = [
    *("complete", "trace", "nobody lost", "exit codes", "the down are silent", "links add up", "robots there"),
    *("statuses", "events", "bodies apart", "moves", "frames", "radio", "drops", "fog", "bumps", "progress"),
]


@pytest.fixture
def good(lab: Lab) -> Result:
    return lab.driven(ticks=TICKS)


def only_failure(result: Result, exits: Exits = GOOD_EXITS) -> str:
    """The name and detail of the one check that failed."""
    verdict = judge(result[1], dict(exits), result[0].prepared)
    assert (verdict.outcome, verdict.exit_code, len(verdict.failed)) == ("invalid", 1, 1), verdict.failed
    return f"{verdict.failed[0].name}: {verdict.failed[0].detail}"


def test_a_good_run_is_valid(good: Result) -> None:
    verdict = judge(good[1], GOOD_EXITS, good[0].prepared)
    assert verdict.valid
    assert verdict.exit_code == 0
    assert [check.name for check in verdict.checks] == NAMES


def test_a_journal_on_disk_is_judged_the_same(good: Result, tmp_path: Path) -> None:
    world, journal = good
    with JournalWriter(tmp_path / "journal", journal.header) as writer:
        for record in [*journal.ticks, *journal.events, journal.end]:
            assert record
            writer.write(record)
    on_disk = judge(read_journal(tmp_path / "journal"), GOOD_EXITS, world.prepared)
    assert on_disk == judge(journal, GOOD_EXITS, world.prepared)


def test_a_missing_tick_fails(good: Result) -> None:
    del good[1].records[5]
    rehash(good[1])
    assert failures(good)["complete"] == "tick 6 follows tick 4"


def test_missing_last_ticks_fail_unless_the_run_was_interrupted(good: Result) -> None:
    journal = good[1]
    del journal.records[-1]
    rehash(journal)
    assert only_failure(good) == "complete: 11 of 12 ticks"
    assert journal.end
    journal.end = replace(journal.end, reason=INTERRUPTED)
    assert failures(good, GOOD_EXITS) == {}


@pytest.mark.parametrize(
    ("end", "says"),
    [
        ({"reason": "the disk is full"}, "complete: the run ended after 12 ticks: the disk is full"),
        ({"trace_hash": "00" * 32}, "trace: the ticks' hash is "),
    ],
    ids=["reason", "trace"],
)
def test_another_end_fails(good: Result, end: dict[str, str], says: str) -> None:
    assert good[1].end
    good[1].end = replace(good[1].end, **end)  # type: ignore[arg-type]
    assert only_failure(good).startswith(says)


def test_a_journal_without_an_end_cannot_be_judged(good: Result, tmp_path: Path) -> None:
    world, journal = good
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


def test_another_trace_fails(good: Result) -> None:
    end = good[1].end
    move(good[1], 3, 1, heading=good[1].records[3].robots[0].heading + 1e-15)
    good[1].end = end
    assert list(failures(good)) == ["trace", "moves"]


def test_a_lost_robot_fails_and_is_named(lab: Lab) -> None:
    world = lab.patrol(ticks=TICKS)
    journal = lab.run(world, lab.fleet(world, silent={(2, 4, "B")}))
    detail = only_failure((world, journal), {**GOOD_EXITS, "r2": -9})
    assert detail == "nobody lost: lost: r2 at tick 5 (no answer in phase B of tick 4)"


def test_a_robot_lost_in_the_last_tick_fails_too(lab: Lab) -> None:
    world = lab.patrol(ticks=TICKS)
    assert "r3 at tick 12" in only_failure((world, lab.run(world, lab.fleet(world, silent={(3, TICKS - 1, "A")}))))


@pytest.fixture
def killing(lab: Lab) -> Result:
    """A run in which r3 is killed before tick 3."""
    return lab.driven(ticks=TICKS, faults=[{"kind": "kill", "who": "r3", "at": 1.5}])


def test_overlapping_bodies_fail(good: Result) -> None:
    row = good[1].records[7].robots[0]
    move(good[1], 7, 2, x=row.x + 0.5, y=row.y)
    assert failures(good)["bodies apart"] == "r1 and r2 overlap at tick 7, centres 0.500 m apart"


def test_a_body_over_a_wall_or_off_the_terrain_fails_and_of_several_the_first_is_named(good: Result) -> None:
    move(good[1], 7, 2, x=19.9)
    assert "r2 is over a wall" in failures(good)["bodies apart"]
    move(good[1], 7, 2, x=10.9, y=1.0)
    move(good[1], 7, 3, x=10.6, y=3.0)
    assert failures(good)["bodies apart"] == "r2 is over a wall at tick 7, at (10.900, 1.000)"


def test_a_vanished_frame_fails(good: Result) -> None:
    change(good[1], 7, deliveries=good[1].records[7].deliveries[1:])
    assert failures(good) == {
        "links add up": "frame 7 from r1 to r2 was neither delivered nor dropped (1 such frames)",
        "radio": "tick 7: frame 7 from r1 to r2 should have been delivered",
    }


def test_a_doubled_or_invented_frame_fails(good: Result) -> None:
    change(good[1], 7, dropped=((3, 4, 7, "oversized"),))
    found = failures(good)
    assert "frame 7 from r3 to r4 was delivered or dropped but not sent" in found["links add up"]
    assert found["radio"] == "tick 7: frame 7 from r3 to r4 was dropped (oversized) and should not have been"


def test_an_embellished_fog_fails(good: Result) -> None:
    change(good[1], 7, mfow=good[1].records[7].mfow - 1)
    detail = only_failure(good)
    assert detail.startswith("fog: tick 7: the poses give MFoW 3.5 s, ")
    assert "recorded is MFoW 3 s, " in detail


def test_a_score_made_half_as_high_in_every_tick_fails(good: Result) -> None:
    good[1].records = [replace(record, mfow=record.mfow // 2) for record in good[1].records]
    rehash(good[1])
    assert only_failure(good).startswith("fog: tick 1: the poses give MFoW 0.5 s, ")


def test_a_judge_who_takes_the_fog_as_it_is_says_nothing_of_it(good: Result) -> None:
    judging = Judge(good[1], GOOD_EXITS, good[0].prepared, verify_fog=False)
    for record in good[1].ticks:
        judging.tick(record)
    without_fog = [name for name in NAMES if name not in ("fog", "progress")]
    assert [check.name for check in judging.verdict().checks] == without_fog


@pytest.mark.parametrize("fields", [{"x": 3.5}, {"y": 3.5}, {"heading": 0.5}], ids=str)
@pytest.mark.parametrize("k", [0, 7, TICKS - 1])
def test_a_body_that_is_not_where_it_went_fails(good: Result, k: int, fields: dict[str, float]) -> None:
    move(good[1], k, 1, **fields)
    detail = failures(good)["moves"]
    assert detail.startswith("r1 is at (")
    assert detail.endswith(f"at tick {k}")


def test_the_last_bit_of_a_pose_counts(good: Result) -> None:
    move(good[1], 7, 3, x=math.nextafter(good[1].records[7].robots[2].x, math.inf))
    assert list(failures(good)) == ["moves"]


def test_another_command_than_that_obeyed_fails(good: Result) -> None:
    was = good[1].records[5]
    for number in (1, 3):
        move(good[1], 5, number, c0=0.5 * was.robots[number - 1].c0, bumped=False)
        assert only_failure(good).startswith(f"moves: r{number} is at (")
        good[1].records[5] = was


@pytest.mark.parametrize("bumped", [False, True])
def test_a_cancelled_move_that_the_record_lets_happen_and_the_reverse_fail(good: Result, bumped: bool) -> None:
    ticks = list(good[1].ticks)[:-1]
    k, number = next(
        (t.k, row.number) for t in ticks for row in t.robots if row.bumped == bumped and (bumped or row.c0)
    )
    move(good[1], k, number, bumped=not bumped)
    assert only_failure(good).startswith("moves: ")


def test_a_dead_body_that_drives_fails(killing: Result) -> None:
    move(killing[1], TICKS - 1, 3, c0=1.0)
    assert only_failure(killing, {}) == f"moves: r3 is dead and drives at tick {TICKS - 1}"


@pytest.mark.parametrize(
    ("number", "fields"),
    [(1, {"c0": 4.5}), (1, {"c1": -0.6}), (1, {"c0": math.nan}), (3, {"c0": 3.2, "c1": 3.2}), (4, {"c1": math.inf})],
)
def test_a_command_beyond_a_robots_limits_fails(good: Result, number: int, fields: dict[str, float]) -> None:
    move(good[1], TICKS - 1, number, **fields)
    detail = only_failure(good)
    assert detail.startswith(f"moves: r{number} obeys ")
    assert "beyond its limits" in detail


def test_a_refused_command_that_drives_fails(good: Result) -> None:
    move(good[1], TICKS - 1, 1, refused=True)
    assert only_failure(good) == "moves: r1 drives although its command was refused at tick 11"


def test_a_tick_without_one_of_the_robots_fails(good: Result) -> None:
    change(good[1], 3, robots=good[1].records[3].robots[1:])
    assert failures(good)["robots there"] == "tick 3 does not hold the scenario's robots"


@pytest.mark.parametrize(
    "fields",
    [{"x": math.nan}, {"y": math.inf}, {"x": 1e300}, {"y": -5.0}, {"heading": math.nan}, {"number": 9}],
    ids=str,
)
def test_a_robot_that_is_nowhere_fails(good: Result, fields: dict[str, Any]) -> None:
    move(good[1], 3, 2, **fields)
    assert "tick 3" in failures(good)["robots there"]


def test_of_several_robots_that_are_nowhere_the_first_is_named(good: Result) -> None:
    for number in 2, 3:
        move(good[1], 3, number, x=math.nan)
    assert failures(good)["robots there"].startswith("r2 is not on the terrain at tick 3")


def frame_of(record: TickRecord, index: int, shift: float = 0.0, **fields: Any) -> bytes:
    row = record.robots[index]
    said = Position.of(row.number, record.k, 0.5 * record.k, Pose(row.x + shift, row.y, row.heading))
    return encode(replace(said, **fields))


@pytest.mark.parametrize(
    "fields",
    [{"shift": 0.01}, {"robot": 4}, {"sequence": 8}, {"time_ms": 3501}, {"heading_mrad": 6283}, {"trail": ((7, 7),)}],
    ids=str,
)
def test_a_frame_that_says_what_is_not_so_fails(good: Result, fields: dict[str, Any]) -> None:
    record = good[1].records[7]
    change(good[1], 7, frames=((1, frame_of(record, 0, **fields)), *record.frames[1:]))
    assert only_failure(good).startswith("frames: frame 7 of r1 says Position(")


def test_a_frame_with_a_true_trail_is_good(good: Result) -> None:
    def place(k: int) -> tuple[int, int]:
        row = good[1].records[k].robots[0]
        return round(100.0 * row.x), round(100.0 * row.y)

    record = good[1].records[7]
    for length in range(1, 5):
        ways = [(place(k - 1), place(k)) for k in range(7, 7 - length, -1)]
        trail = tuple((old[0] - new[0], old[1] - new[1]) for old, new in ways)
        change(good[1], 7, frames=((1, frame_of(record, 0, trail=trail)), *record.frames[1:]))
        assert failures(good, GOOD_EXITS) == {}


@pytest.mark.parametrize("frame", [b"", b"nonsense", bytes(65)])
def test_a_frame_that_cannot_be_read_fails(good: Result, frame: bytes) -> None:
    change(good[1], 7, frames=((1, frame), *good[1].records[7].frames[1:]))
    found = failures(good)
    assert found["frames"].startswith("frame 7 of r1 cannot be decoded (malformed")
    assert set(found) == {"frames"} | ({"radio"} if len(frame) > 64 else set())


def test_a_frame_of_a_dead_robot_fails(killing: Result) -> None:
    record = killing[1].records[7]
    change(killing[1], 7, frames=(*record.frames, (3, frame_of(record, 2))))
    found = failures(killing)
    assert found["frames"] == "frame 7 of r3 has no sender that is alive"
    assert found["the down are silent"] == "r3 is dead at tick 7 and sends"


@pytest.mark.parametrize("seed", range(4))
def test_the_order_in_which_checks_are_listed_does_not_matter(
    lab: Lab, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A good run, one with a false frame and one with a robot off the terrain, under faults of many kinds."""
    faults = [
        {"kind": "loss", "rate": 0.2, "at": 1.0, "for": 4.0},
        {"kind": "delay", "delay": {"uniform": [0.0, 1.5]}},
        {"kind": "partition", "groups": "halves", "at": 3.0, "for": 3.0},
        {"kind": "spoof", "as": "r2", "payload": "random"},
        {"kind": "pause", "who": "r3", "at": 2.0, "for": 2.0},
        {"kind": "drift", "who": "r1", "bias": [0.5, 0.0]},
    ]
    world = lab.patrol(ticks=20, faults=faults)
    result = world, (journal := lab.run(world))

    def shuffled() -> dict[str, CheckResult]:
        order = sorted(CHECKS, key=lambda check: draw(seed, *check.__name__.encode()))
        assert order != list(CHECKS)
        with monkeypatch.context() as context:
            context.setattr("worldsim.verdict.judge.CHECKS", tuple(order))
            found = checks(result)
        assert list(found) != list(checks(result))
        return found

    assert failures(result) == {}
    assert {"refused frames", "forged frames", "links add up", "senses"} <= set(checks(result))
    assert shuffled() == checks(result)
    *frames, (source, frame) = journal.records[6].frames
    change(journal, 6, frames=(*frames, (source, frame[:-1] + b"?")))
    assert failures(result)
    assert shuffled() == checks(result)
    move(journal, 9, 1, x=-100.0)
    assert "robots there" in failures(result)
    assert shuffled() == checks(result)


# --- what a world leaves out -----------------------------------------------------------------------------------------


def silence(result: Result, *ticks: int) -> None:
    """Take r1's frames in some ticks, and all that became of them, off the record."""
    for k in ticks:
        record = result[1].records[k]
        kept = {name: tuple(row for row in getattr(record, name) if row[0] != 1) for name in ("frames", "deliveries")}
        change(result[1], k, **kept, dropped=tuple(drop for drop in record.dropped if drop[0] != 1))


@pytest.mark.parametrize("ticks", [range(TICKS), [TICKS - 1]], ids=["always", "last"])
def test_a_living_robot_that_does_not_send_fails_in_lockstep(good: Result, ticks: Sequence[int]) -> None:
    silence(good, *ticks)
    assert failures(good) == {"frames": f"r1 did not send its position in tick {ticks[0]}"}


def test_at_a_pace_nobody_waits_for_a_frame(lab: Lab) -> None:
    result = lab.driven(ticks=TICKS, pace=10)
    silence(result, *range(TICKS))
    assert failures(result) == {}


@pytest.mark.parametrize("free", [False, True])
def test_a_world_that_cancels_moves_at_will_fails(lab: Lab, monkeypatch: pytest.MonkeyPatch, free: bool) -> None:
    monkeypatch.setattr("worldsim.robots.bodies.path_is_free", lambda *_: free)
    found = failures(lab.driven(ticks=TICKS))
    assert ("drives through a wall" if free else "neither a wall nor another body was in its way") in found["moves"]
