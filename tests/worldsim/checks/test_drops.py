"""The verdict on frames that were stopped: too few, too many, the wrong ones, or for no reason at all."""

from typing import Any

import pytest

from patrol.journal.records import FORGED
from tests.worldsim.checks.judged import Run, change, failures, spares, stops
from worldsim.radio.rules import RadioRules

TICKS = 30
QUIET = {"kind": "silence", "who": "r1", "id": "quiet"}
SPLIT = {"kind": "partition", "groups": [["r1", "r2"], ["r3", "r4"]], "id": "split"}
NARROW = {"kind": "bandwidth", "bytes_per_s": 20.0, "id": "narrow"}
LOSS = {"kind": "loss", "from": "r1", "rate": 0.5, "id": "loss"}
INSIDER = {"kind": "spoof", "by": "r1", "as": "r3", "payload": {"offset": [1.0, 0.0]}, "id": "insider"}
STRANGER = {"kind": "spoof", "as": "r3", "payload": {"offset": [1.0, 0.0]}, "id": "stranger"}
DELAY = {"kind": "delay", "delay": {"constant": 1.2}, "id": "late"}


@pytest.mark.parametrize(
    "faults",
    [
        [QUIET, {**QUIET, "who": ["r1", "r2"], "direction": "in", "id": "earlier"}, SPLIT],
        [{**QUIET, "who": "r2", "direction": "in"}, {**QUIET, "direction": "out", "id": "later"}],
        [SPLIT, {**SPLIT, "groups": "one", "direction": "one-way", "id": "other"}, INSIDER, STRANGER, DELAY],
        [NARROW, {**NARROW, "who": "r1", "bytes_per_s": 70.0, "id": "more"}, INSIDER, {**QUIET, "at": 5.0, "for": 3.0}],
        [NARROW, {"kind": "range", "reach": 6.0}, {**SPLIT, "at": 4.0, "for": 4.0}, LOSS, DELAY, INSIDER],
        [DELAY, {"kind": "kill", "who": "r2", "at": 5.0}, {"kind": "leave", "who": "r4", "at": 6.0}, QUIET],
        [{"kind": "pause", "who": "r2", "at": 5.0, "for": 4.0}],
    ],
)
def test_whatever_a_good_radio_stops_is_right(run: Run, faults: list[dict[str, Any]]) -> None:
    assert failures(run(*faults)) == {}


@pytest.mark.parametrize("fault", [QUIET, {**SPLIT, "direction": "one-way"}], ids=["silence", "partition"])
def test_a_cut_that_stops_everybody_fails(run: Run, fault: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RadioRules, "stop", stops(f"{fault['kind']}:{fault['id']}"))
    found = failures(run(fault))
    assert list(found) == ["nothing crossed"]
    assert f"was stopped by {fault['kind']} {fault['id']}, which does not apply to it" in found["nothing crossed"]


@pytest.mark.parametrize("fault", [QUIET, SPLIT], ids=["silence", "partition"])
@pytest.mark.parametrize("late", [False, True])
def test_an_insider_is_cut_off_like_any_robot(
    run: Run, fault: dict[str, Any], late: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RadioRules, "stop", spares(lambda sent, _: (sent.source == FORGED)[:, None]))
    found = failures(run(fault, INSIDER, DELAY) if late else run(fault, INSIDER))
    assert "nothing crossed" in found
    assert found["nothing crossed"].startswith("a frame from a forger to r")
    assert f"got through {fault['kind']} {fault['id']}" in found["nothing crossed"]


def test_what_reaches_a_dead_receiver_through_a_cut_came_through(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody hears what it is told, but the frame got as far as it."""
    monkeypatch.setattr(RadioRules, "stop", spares(lambda _, receivers: receivers == 2))
    found = failures(run({"kind": "kill", "who": "r2"}, QUIET))
    assert found == {"nothing crossed": "a frame from r1 to r2 of tick 0 got through silence quiet"}


def test_a_cut_that_another_cause_takes_the_place_of_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RadioRules, "stop", stops("loss:loss"))
    found = failures(run(LOSS, {**QUIET, "who": "r1"}))
    assert found["nothing crossed"] == "a frame from r1 to r2 of tick 0 got through silence quiet"


@pytest.mark.parametrize("bytes_per_s", [1e6, 20.0])
def test_a_bandwidth_that_stops_what_it_has_room_for_fails(
    run: Run, bytes_per_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RadioRules, "stop", stops("bandwidth:narrow"))
    found = failures(run({**NARROW, "bytes_per_s": bytes_per_s}))
    assert found == {"bandwidth": "bandwidth narrow stopped r1 in tick 0 although it had bytes left"}


def test_a_bandwidth_that_what_is_forged_does_not_use_up_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """The forger's own frames come after those that it forges: the bucket of both is one."""
    monkeypatch.setattr(RadioRules, "stop", spares(lambda sent, _: (sent.source == FORGED)[:, None]))
    found = failures(run({**NARROW, "who": "r1"}, INSIDER))
    assert list(found) == ["bandwidth"]
    assert found["bandwidth"].startswith("r1 exceeded 20 bytes/s in tick ")


@pytest.mark.parametrize("faults", [[], [LOSS]], ids=["without faults", "with one"])
def test_a_frame_that_is_not_too_long_and_counts_as_that_fails(
    run: Run, faults: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("worldsim.radio.fates.MAX_FRAME", 1)
    found = failures(run(*faults))
    assert found == {"drops": "a frame from r1 to r2 was dropped in tick 0 for a cause that does not apply: oversized"}


def test_a_link_that_a_loss_is_not_about_and_that_loses_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    good, more = RadioRules.stop, stops("loss:loss", origins=(2,))

    def stop(*of: Any) -> None:
        good(*of)
        more(*of)

    monkeypatch.setattr(RadioRules, "stop", stop)
    found = failures(run(LOSS))
    assert list(found) == ["drops"]
    assert found["drops"].endswith("for a cause that does not apply: loss:loss")


@pytest.mark.parametrize(
    "why",
    ["receiver dead", "receiver paused", "receiver absent", "own", "loss:quiet", "silence:loss", "loss:f9", "the wind"],
)
def test_a_cause_that_does_not_apply_fails(run: Run, why: str) -> None:
    world, journal = run({**LOSS, "rate": 0.0}, {**QUIET, "at": 9.0}, {**STRANGER, "at": 9.0})
    record = journal.records[4]
    change(journal, 4, deliveries=record.deliveries[1:], dropped=((*record.deliveries[0], why),))
    says = f"a frame from r1 to r2 was dropped in tick 4 for a cause that does not apply: {why}"
    assert failures((world, journal))["drops"] == says


def test_a_fault_stops_nothing_of_another_tick_or_before_it_begins(run: Run) -> None:
    world, journal = run({**LOSS, "at": 2.0}, {**LOSS, "rate": 0.0, "id": "none"})
    record = journal.records[3]
    gone = record.deliveries[0]
    for row in [(*gone, "loss:loss"), (gone[0], gone[1], 2, "loss:none")]:
        change(journal, 3, deliveries=record.deliveries[1:], dropped=(row,))
        says = "a frame from r1 to r2 was dropped in tick 3 for a cause that does not apply"
        assert failures((world, journal))["drops"].startswith(says)


def test_only_the_forger_does_not_hear_what_it_forges(run: Run) -> None:
    world, journal = run(INSIDER)
    record = journal.records[4]
    assert [row for row in record.dropped if row[3] == "own"] == [(FORGED, 1, 4, "own")]
    deliveries = tuple(link for link in record.deliveries if link != (FORGED, 2, 4))
    change(journal, 4, deliveries=deliveries, dropped=((FORGED, 1, 4, "own"), (FORGED, 2, 4, "own")))
    says = "a frame from a forger to r2 was dropped in tick 4 for a cause that does not apply: own"
    assert failures((world, journal))["drops"] == says
