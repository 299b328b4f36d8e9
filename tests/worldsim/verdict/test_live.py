"""A run that is judged while it goes on gets the verdict of its finished journal, however its journal comes in."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from patrol.journal import End, Event, Header, JournalWriter, Record, Status, TickRecord, read_journal
from patrol.random import draw
from patrol.scenario.controls import OPERATOR, AddFault, as_detail
from worldsim.fleet.loop import run_ticks
from worldsim.output.record import Recorder, header_of
from worldsim.run_record import COMPLETED, INTERRUPTED
from worldsim.verdict.judge import Verdict, judge
from worldsim.verdict.live import LiveJudge

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from tests.worldsim.conftest import Lab, RandomFleet
    from worldsim.world import World

TICKS = 16
EXITS: dict[str, int | None] = {"r1": 0, "r2": 0, "r3": 0, "r4": 0, "the world": 0, "the router": 0}

LOSS = {"kind": "loss", "rate": 0.5, "at": 2.0, "id": "op1"}
RADIO = [
    LOSS,
    {"kind": "delay", "delay": {"normal": [0.5, 0.5]}, "at": 1.0, "for": 4.0},
    {"kind": "spoof", "as": "r2", "payload": {"offset": [1.0, 0.0]}, "at": 3.0, "for": 3.0},
]


class Tape:
    """Takes a run's records in the order in which a journal gets them."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.records: list[Record] = []

    def write(self, record: Record) -> None:
        self.records.append(record)


def taped(world: World, fleet: RandomFleet, ended: str = COMPLETED, ticks: int = TICKS) -> Tape:
    """The records of a run, which is stopped after so many ticks."""
    tape = Tape(header_of(world))
    recorder = Recorder(tape, world.scenario.spares)
    run_ticks(world, fleet, recorder.tick, recorder.event, lambda: world.tick >= ticks, fleet)
    recorder.end(ended)
    return tape


def written(tape: Tape, path: Path) -> bytes:
    """The tape as a journal's bytes."""
    with JournalWriter(path, tape.header) as writer:
        for record in tape.records:
            writer.write(record)
    return path.read_bytes()


def pieces(journal: bytes, path: Path, seed: int) -> Iterator[bytes]:
    """Longer and longer parts of a journal, cut anywhere behind its header; the last one is all of it."""
    first = path.with_name("header")
    first.unlink(missing_ok=True)
    with JournalWriter(first, read_journal(path).header):
        pass
    begin = first.stat().st_size
    cuts = {begin + int(draw(seed, number) * (len(journal) - begin)) for number in range(12)}
    yield from (journal[:cut] for cut in [begin, *sorted(cuts), len(journal)])


def live(journal: bytes, path: Path, prepared: Prepared, seed: int = 1) -> tuple[Verdict, LiveJudge]:
    """The verdict of a journal that grows piece by piece."""
    judging = None
    for piece in list(pieces(journal, path, seed)):
        path.write_bytes(piece)
        judging = judging or LiveJudge(path, prepared)
        judging.read_on()
    assert judging is not None
    return judging.verdict(EXITS), judging


def check_same(tape: Tape, prepared: Prepared, folder: Path, cut: int = 0) -> Verdict:
    """Judge a run in both ways, after its journal has lost its last bytes; the verdict, which must be the same."""
    path = folder / "journal"
    journal = written(tape, path)
    journal = journal[: len(journal) - cut]
    path.write_bytes(journal)
    finished = judge(read_journal(path), EXITS, prepared)
    for seed in range(3):
        path.write_bytes(journal)
        assert live(journal, path, prepared, seed)[0] == finished
    return finished


def test_a_good_run(lab: Lab, tmp_path: Path) -> None:
    world = lab.patrol(ticks=TICKS)
    assert check_same(taped(world, lab.fleet(world)), world.prepared, tmp_path).valid


def test_ticks_are_judged_before_the_end(lab: Lab, tmp_path: Path) -> None:
    world = lab.patrol(ticks=TICKS)
    path = tmp_path / "journal"
    tape = taped(world, lab.fleet(world))
    end = tape.records.pop()
    written(tape, path)
    judging = LiveJudge(path, world.prepared)
    told: list[int] = []
    judging.read_on(told.append)
    assert told == list(range(1, TICKS)), "the last one may still be followed by its events"
    assert isinstance(end, End)


@pytest.mark.parametrize(
    "faults",
    [
        RADIO,
        [{"kind": "kill", "who": "r2", "at": 2.0}, {"kind": "restart", "who": "r2", "at": 5.0}],
        [{"kind": "pause", "who": "r1", "at": 1.0, "for": 3.0}, *RADIO],
    ],
)
def test_runs_with_faults(lab: Lab, tmp_path: Path, faults: list[dict[str, Any]]) -> None:
    world = lab.patrol(ticks=TICKS, faults=faults)
    check_same(taped(world, lab.fleet(world)), world.prepared, tmp_path)


def test_a_robot_that_is_lost(lab: Lab, tmp_path: Path) -> None:
    """The checks of its last tick look at the event that follows it."""
    world = lab.patrol(ticks=TICKS)
    fleet = lab.fleet(world, silent={(2, 7, "B")}, killed={10: (3, Status.LOST)})
    verdict = check_same(taped(world, fleet), world.prepared, tmp_path)
    assert [check.name for check in verdict.failed] == ["nobody lost"]


def test_an_interrupted_run(lab: Lab, tmp_path: Path) -> None:
    world = lab.patrol(ticks=TICKS)
    assert check_same(taped(world, lab.fleet(world), INTERRUPTED, 9), world.prepared, tmp_path).valid


@pytest.mark.parametrize("cut", [3, 400])
def test_a_run_whose_world_was_killed(lab: Lab, tmp_path: Path, cut: int) -> None:
    """Its journal ends anywhere, within a record or behind one."""
    world = lab.patrol(ticks=TICKS)
    verdict = check_same(taped(world, lab.fleet(world)), world.prepared, tmp_path, cut)
    assert verdict.outcome == "unknown"


def test_a_journal_without_an_end(lab: Lab, tmp_path: Path) -> None:
    world = lab.patrol(ticks=TICKS)
    tape = taped(world, lab.fleet(world))
    tape.records.pop()
    assert check_same(tape, world.prepared, tmp_path).outcome == "unknown"


def test_a_damaged_journal(lab: Lab, tmp_path: Path) -> None:
    world = lab.patrol(ticks=TICKS)
    path = tmp_path / "journal"
    journal = bytearray(written(taped(world, lab.fleet(world)), path))
    journal[2 * len(journal) // 3] ^= 1
    path.write_bytes(journal)
    finished = judge(read_journal(path), EXITS, world.prepared)
    assert finished.outcome == "unknown"
    assert live(bytes(journal), path, world.prepared)[0] == finished


def operated(tape: Tape, faults: list[dict[str, Any]]) -> Tape:
    """The same run, as if an operator had added its faults, each in the tick in which it begins."""
    later = Tape(tape.header)
    for record in tape.records:
        if isinstance(record, TickRecord):
            for fault in faults:
                if record.k == round(fault["at"] / 0.5):
                    control = AddFault(do="fault", fault={**fault, "at": 0.0})
                    later.write(Event(record.k, OPERATOR, detail=as_detail(control)))
        later.write(record)
    return later


@pytest.mark.parametrize("count", [1, 3])
def test_faults_that_an_operator_has_added(lab: Lab, tmp_path: Path, count: int) -> None:
    """They choose other checks, which need the ticks before as well."""
    faults = [{**fault, "id": f"f{place}"} for place, fault in enumerate(RADIO[:count])]
    faulty = lab.patrol(ticks=TICKS, faults=faults)
    tape = operated(taped(faulty, lab.fleet(faulty)), faults)
    calm = lab.patrol(ticks=TICKS).prepared
    verdict = check_same(tape, calm, tmp_path)
    assert {"refused frames"} <= {check.name for check in verdict.checks}
    path = tmp_path / "journal"
    judging = live(path.read_bytes(), path, calm)[1]
    assert len(judging.prepared.scenario.faults) == count


def test_an_event_that_comes_too_late_is_looked_at(lab: Lab, tmp_path: Path) -> None:
    """No world writes one. The verdict is that of the file, whatever its order."""
    world = lab.patrol(ticks=TICKS)
    tape = taped(world, lab.fleet(world, killed={6: (3, Status.LOST)}))
    (event,) = [record for record in tape.records if isinstance(record, Event)]
    tape.records.remove(event)
    tape.records.insert(-2, event)
    check_same(tape, world.prepared, tmp_path)
