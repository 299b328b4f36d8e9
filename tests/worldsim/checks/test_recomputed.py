"""The verdict on the radio: a run with every radio fault at once is valid, and every check can fail."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.journal.records import FORGED
from patrol.kernels.hear import hear
from patrol.pose import Pose
from patrol.prepare import inboxes_of
from patrol.radio.message import Position, encode
from tests.worldsim.checks.judged import Result, Run, change, check_of, checks, failures, move, result_of
from tests.worldsim.conftest import Lab
from worldsim.checks.arrivals import LossesAsAsked
from worldsim.checks.check import CheckResult
from worldsim.checks.fates import NothingCrossed, WithinBandwidth
from worldsim.kernels.radio import below
from worldsim.radio.rules import Burst
from worldsim.run_record import MemoryJournal
from worldsim.world import World

KEY = b"a key of a fleet"
LOSS = {"kind": "loss", "rate": 0.3, "id": "loss"}
BURSTS = {"kind": "loss", "rate": 0.5, "mean_burst": 3.0, "from": "r1", "id": "bursts"}
ALL = (
    LOSS,
    BURSTS,
    {"kind": "delay", "delay": {"normal": [0.5, 0.5]}, "at": 2.0, "for": 10.0, "id": "delay"},
    {"kind": "duplicate", "rate": 0.5, "delay": {"exponential": 1.0}, "id": "copies"},
    {"kind": "reorder", "rate": 0.2, "hold": 1.5, "id": "mixed"},
    {"kind": "partition", "groups": "halves", "at": 4.0, "for": 3.0, "direction": "one-way", "id": "split"},
    {"kind": "silence", "who": "r3", "at": 6.0, "for": 3.0, "direction": "in", "id": "quiet"},
    {"kind": "range", "reach": 8.0, "through_walls": False, "at": 10.0, "for": 3.0, "id": "near"},
    {"kind": "bandwidth", "bytes_per_s": 12.0, "at": 12.0, "for": 6.0, "id": "narrow"},
    {"kind": "spoof", "as": "r2", "payload": {"offset": [1.0, 0.0]}, "at": 1.0, "for": 5.0, "id": "offset"},
    {"kind": "spoof", "by": "r4", "as": "r1", "payload": "random", "at": 3.0, "for": 8.0, "id": "insider"},
    {"kind": "spoof", "as": "half", "payload": "freeze", "at": 5.0, "for": 5.0, "id": "freeze"},
    {"kind": "spoof", "as": "all", "payload": {"replay": 2.0}, "at": 7.0, "for": 9.0, "id": "replay"},
    {"kind": "spoof", "payload": {"invented": 6}, "at": 8.0, "for": 4.0, "id": "ghosts"},
    {"kind": "spoof", "payload": {"ahead": 64}, "as": "r2", "by": "r4", "at": 8.0, "for": 4.0, "id": "ahead"},
    {"kind": "drift", "who": "r4", "bias": [0.5, 0.0], "noise": 0.1, "id": "drift"},
    {"kind": "clock", "who": "r1", "offset": -3.0, "rate": 0.1, "id": "clock"},
    {"kind": "kill", "who": "r3", "at": 9.5},
    {"kind": "restart", "who": "r3", "at": 13.0},
    {"kind": "pause", "who": "r2", "at": 10.0, "for": 2.0},
)


SPOOF = {"kind": "spoof", "as": "r2", "payload": {"offset": [0.5, 0.0]}, "id": "lie"}


@pytest.fixture
def key(tmp_path: Path) -> str:
    path = tmp_path / "fleet.key"
    path.write_bytes(KEY)
    return str(path)


@pytest.fixture
def run(lab: Lab) -> Run:
    def of(*faults: dict[str, Any], ticks: int = 40, key: str | None = None) -> Result:
        world = lab.patrol(ticks=ticks, faults=list(faults), radio={"key": key})
        return world, lab.run(world, lab.fleet(world, key=KEY if key else None))

    return of


@pytest.mark.parametrize("keyed", [False, True])
def test_a_run_with_everything_at_once_is_valid(run: Run, key: str, keyed: bool) -> None:
    result = run(*ALL, key=key if keyed else None)
    assert failures(result) == {}
    found = checks(result)
    assert {"radio", "nothing crossed", "bandwidth", "losses", "refused frames", "forged frames"} <= set(found)
    assert found["forged frames"].detail.startswith("offset: 0 of") is keyed
    counts = {str(fault["id"]): 0 for fault in ALL if "id" in fault}
    for record in result[1].ticks:
        for *_, why in (*record.dropped, *record.copies, *record.delayed):
            counts[why.partition(":")[2] or why] = 1
        for fault in record.forged:
            counts[fault] = 1
    assert [fault for fault, seen in counts.items() if not seen] == ["drift", "clock"]


def test_a_frame_that_only_the_record_loses_fails(run: Run) -> None:
    world, journal = run(LOSS)
    *_, last = journal.ticks
    source, to, sequence = last.deliveries[0]
    dropped = tuple(sorted((*last.dropped, (source, to, sequence, "loss:loss"))))
    change(journal, last.k, deliveries=last.deliveries[1:], dropped=dropped)
    found = failures((world, journal))
    name = f"frame {sequence} from r{source} to r{to}"
    assert found == {"radio": f"tick {last.k}: {name} should have been delivered"}


def test_another_cause_another_copy_or_another_delay_fails(run: Run) -> None:
    world, journal = run(*ALL)
    for what in ("dropped", "copies", "delayed", "forged", "deliveries"):
        k = next(record.k for record in journal.ticks if getattr(record, what))
        was = journal.records[k]
        change(journal, k, **{what: getattr(was, what)[:-1]})
        assert f"tick {k}: " in failures((world, journal))["radio"]
        journal.records[k] = was
    k = next(record.k for record in journal.ticks if record.frames[0][0] == FORGED)
    forged = encode(Position.of(2, k, 0.5 * k, Pose(1.0, 1.0, 0.0)))
    change(journal, k, frames=((FORGED, forged), *journal.records[k].frames[1:]))
    assert "the forged frames are not those" in failures((world, journal))["radio"]


def test_another_draw_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """A world whose radio rolls other dice than the journal's judge."""
    with monkeypatch.context() as patch:
        patch.setattr("worldsim.radio.rules.below", lambda states, *of: below(states + np.uint64(1), *of))
        world, journal = run(LOSS)
    assert "radio" in failures((world, journal))


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({"kind": "silence", "who": "r2", "direction": "in", "id": "s"}, "r1 to r2 of tick 3 got through silence s"),
        ({"kind": "silence", "who": "r1", "direction": "out", "id": "s"}, "r1 to r2 of tick 3 got through silence s"),
        (
            {"kind": "partition", "groups": [["r1"], ["r2"]], "direction": "one-way", "id": "p"},
            "r1 to r2 of tick 3 got through partition p",
        ),
    ],
)
def test_what_comes_through_a_cut_fails(run: Run, fault: dict[str, Any], says: str) -> None:
    result = run(fault)
    record, frame = result[1].records[3], (1, 2, 3)
    deliveries = tuple(sorted((*record.deliveries, frame)))
    change(result[1], 3, deliveries=deliveries, dropped=tuple(d for d in record.dropped if d[:3] != frame))
    found = failures(result)
    assert found["nothing crossed"] == f"a frame from {says}"
    assert set(found) == {"nothing crossed", "radio"}


def test_a_cut_holds_only_while_it_lasts_and_by_when_a_frame_was_sent(run: Run) -> None:
    late = {"kind": "delay", "delay": {"constant": 2.0}}
    cut = {"kind": "silence", "who": "r1", "at": 3.0, "for": 4.0}
    world, journal = run(late, cut)
    assert any(source == 1 for record in journal.records[6:10] for source, _, _ in record.deliveries)
    assert failures((world, journal)) == {}


def test_more_bytes_than_the_bandwidth_fail(run: Run) -> None:
    world, journal = run({"kind": "bandwidth", "bytes_per_s": 10.0, "who": "r1", "id": "b"})
    check = check_of(WithinBandwidth, world.prepared, journal)
    stopped = next(record for record in journal.ticks if record.dropped)
    assert {cause for *_, cause in stopped.dropped} == {"bandwidth:b"}
    deliveries = tuple(sorted((*stopped.deliveries, *[d[:3] for d in stopped.dropped])))
    change(journal, stopped.k, dropped=(), deliveries=deliveries)
    for record in journal.ticks:
        check.tick(record)
    assert check.result().detail == f"r1 exceeded 10 bytes/s in tick {stopped.k}"
    assert set(failures((world, journal))) == {"bandwidth", "radio"}


def losses(world: World, journal: MemoryJournal) -> CheckResult:
    return result_of(LossesAsAsked, world.prepared, journal)


@pytest.mark.parametrize(
    ("made", "asked", "says"),
    [
        ({**LOSS, "rate": 0.7}, LOSS, "configured"),
        ({**BURSTS, "rate": 0.7}, BURSTS, "configured"),
        ({"kind": "loss", "rate": 0.5, "from": "r1", "id": "bursts"}, {**BURSTS, "mean_burst": 8.0}, "turned"),
    ],
    ids=["independent", "bursts", "no bursts"],
)
def test_other_losses_than_asked_for_fail(
    lab: Lab, run: Run, made: dict[str, Any], asked: dict[str, Any], says: str
) -> None:
    check = losses(lab.patrol(ticks=400, faults=[asked]), run(made, ticks=400)[1])
    assert not check.ok
    assert says in check.detail


@pytest.mark.parametrize("bad", [False, True])
def test_links_that_all_begin_alike_fail(run: Run, bad: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """From then on they are what they should be."""
    bursts = {**BURSTS, "from": "all", "rate": 0.1 if bad else 0.9, "mean_burst": 10.0}
    assert losses(*run(bursts)).ok
    good = Burst.__init__

    def begin(self: Burst, *of: Any) -> None:
        good(self, *of)
        self._bad = bad

    monkeypatch.setattr(Burst, "__init__", begin)
    check = losses(*run(bursts))
    assert check.detail.startswith(
        f"bursts: {12 * bad} of 12 links were bad to begin with, {90 - 80 * bad} % configured"
    )


def test_refusals_that_nobody_had_reason_for_fail(run: Run) -> None:
    result = run({"kind": "spoof", "as": "r2", "payload": "random"})
    move(result[1], 5, 1, rejected=99)
    found = failures(result)
    assert list(found) == ["refused frames"]
    says = "r1 reports at tick 5 that it refused 99 frames; from what it heard it should be "
    assert found["refused frames"].startswith(says)
    exits = {"world": 0} | {f"r{n}": 0 for n in (1, 2, 3, 4)}
    assert failures(result, exits) == {}
    move(result[1], 5, 1, rejected=0)
    assert list(failures(result, exits)) == ["refused frames"]


def test_a_robot_that_does_not_look_at_tags_fails(lab: Lab, key: str) -> None:
    quiet = {"kind": "silence", "who": "r2", "direction": "out"}
    world = lab.patrol(faults=[SPOOF, quiet], radio={"key": key})
    fleet = lab.fleet(world, key=KEY)
    fleet.inboxes = {n: inboxes_of(world.scenario, [n], world.terrain.bounds, None) for n in (1, 2, 3, 4)}
    journal = lab.run(world, fleet)
    assert list(failures((world, journal))) == ["refused frames"]


def test_a_fleet_that_signs_with_other_bytes_than_its_key_fails(lab: Lab, key: str) -> None:
    world = lab.patrol(ticks=8, radio={"key": key}, intruders=[{"place": [4.0, 4.0]}])
    result = world, lab.run(world, lab.fleet(world, key=KEY))
    assert failures(result) == {}
    assert "refused frames" in checks(result)
    for other in (b"another key of a fleet", None):
        world = lab.patrol(ticks=8, radio={"key": key})
        found = failures((world, lab.run(world, lab.fleet(world, key=other))))
        assert found["frames"].startswith("frame 0 of r1 cannot be decoded (tag: ")


def test_a_judge_whose_inboxes_believe_strangers_finds_out(run: Run, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    world, journal = run(SPOOF, key=key)
    keyless: Any = lambda scenario, listeners, bounds, _key: inboxes_of(scenario, listeners, bounds, None)  # noqa: E731
    monkeypatch.setattr("worldsim.checks.heard.inboxes_of", keyless)
    assert (
        failures((world, journal))["forged frames"]
        == "r1 accepted a forged frame of lie without the fleet's key at tick 0"
    )


@pytest.mark.parametrize("ahead", [1, 64, 10**6])
def test_frames_of_ticks_to_come_are_refused_and_nothing_else_is(run: Run, ahead: int) -> None:
    result = run({"kind": "spoof", "as": "r2", "payload": {"ahead": ahead}, "id": "ahead"})
    assert failures(result) == {}
    found = checks(result)
    assert found["forged frames"].detail == "ahead: 0 of 160 heard were accepted"
    assert found["refused frames"].detail == "120 ahead, 40 own"


def test_a_judge_whose_inboxes_believe_in_ticks_to_come_finds_out(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    world, journal = run({"kind": "spoof", "as": "r2", "payload": {"ahead": 3}, "id": "ahead"})
    clockless: Any = lambda *given: inboxes_of(*given, knows_ticks=False)  # noqa: E731
    monkeypatch.setattr("worldsim.checks.heard.inboxes_of", clockless)
    assert (
        failures((world, journal))["forged frames"]
        == "r1 accepted a forged frame of ahead of a tick that was still to come at tick 0"
    )


def forgetful(cells: Any, *rest: Any) -> bool:
    """Judge frames without knowing which ones came in earlier ticks."""
    cells["used"] = 0
    return bool(hear(cells, *rest))


@pytest.mark.parametrize("own", ["all", "one"])
def test_an_inbox_that_believes_what_it_heard_before_finds_out(
    run: Run, key: str, monkeypatch: pytest.MonkeyPatch, own: str
) -> None:
    """The repeated frames' originals came before, from the robots themselves."""
    spoof = {"kind": "spoof", "as": own, "payload": {"replay": 5.0}, "id": "echo"}
    monkeypatch.setattr("patrol.radio.inbox.hear", forgetful)
    world, journal = run(spoof, key=key)
    found = failures((world, journal))
    assert list(found) == ["forged frames"]
    assert found["forged frames"].endswith(" accepted a forged frame of echo a second time at tick 10")


def test_an_inbox_that_believes_copies_finds_out(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("patrol.radio.inbox.hear", forgetful)
    world, journal = run({"kind": "duplicate", "rate": 1.0, "delay": {"constant": 0.5}})
    assert failures((world, journal)) == {"refused frames": "r2 accepted frame 0 of r1 a second time at tick 1"}


def test_without_the_key_file_what_needs_it_is_not_judged(run: Run, key: str, tmp_path: Path) -> None:
    calm, attacked = (run(*some, key=key) for some in ((), ({**SPOOF, "by": "r3", "payload": "random"},)))
    (tmp_path / "fleet.key").unlink()
    assert failures(calm) == {}
    assert "tags not judged: radio.key: cannot read" in checks(calm)["frames"].detail
    found = checks(attacked)
    assert {name for name, check in found.items() if not check.judged} >= {"radio", "refused frames", "forged frames"}
    assert "recovery" in found


def test_what_is_in_flight_at_the_end_adds_up(run: Run) -> None:
    world, journal = run({"kind": "delay", "delay": {"constant": 3.0}})
    check = checks((world, journal))["links add up"]
    assert (check.ok, check.detail) == (True, "480 frames sent over links, 408 delivered or dropped, 72 in flight")
    *_, last = journal.ticks
    change(journal, last.k, deliveries=last.deliveries[1:])
    assert "neither delivered nor dropped" in failures((world, journal))["links add up"]


def test_crossing_is_told_from_the_records_alone(run: Run) -> None:
    """The check needs no ether: the faults' groups and what became of the frames are enough."""
    world, journal = run({"kind": "partition", "groups": "halves", "id": "p"})
    check = check_of(NothingCrossed, world.prepared, journal)
    record = journal.records[2]
    lost, *rest = record.dropped
    check.tick(replace(record, deliveries=tuple(sorted((*record.deliveries, lost[:3]))), dropped=tuple(rest)))
    assert not check.result().ok
