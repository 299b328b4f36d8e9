"""Records on a feed that no world has sent: they are ignored and counted, and the viewer goes on with the true ones."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from monitor.live.feed_source import AGAIN_S, REFUSED_S, FeedSource
from monitor.live.record_checks import RunChecks, is_run_of
from patrol.errors import BadInput
from patrol.journal import pack, unpack
from patrol.journal.records import End, Event, Status, TickRecord
from patrol.scenario import as_mapping, load_scenario
from runtime.messages.feed import Batch, read_so_far, so_far_bytes
from tests.monitor.conftest import QUIET, Seen, run_of
from tests.monitor.live.test_feed_source import FakeFeed, watched


def tick_of(wire: FakeFeed) -> TickRecord:
    """The next tick that the world sends."""
    record = unpack(wire.records[wire.number])
    assert isinstance(record, TickRecord)
    return record


def first_row(**changes: Any) -> Callable[[TickRecord], TickRecord]:
    """A change of the first robot's row."""
    return lambda tick: replace(tick, robots=(replace(tick.robots[0], **changes), *tick.robots[1:]))


def changed(**changes: Any) -> Callable[[TickRecord], TickRecord]:
    """A change of the tick."""
    return lambda tick: replace(tick, **changes)


NONSENSE: dict[str, Callable[[TickRecord], Any]] = {
    "unknown robot": first_row(number=77),
    "text for a number": first_row(x="here"),
    "nan": first_row(y=math.nan),
    "infinite heading": first_row(heading=math.inf),
    "far away": first_row(x=1e300),
    "a state that is none": first_row(state=7),
    "a goal that is text": first_row(goal=("a", "b")),
    "robots missing": changed(robots=()),
    "late": changed(k=2**62),
    "early": changed(k=-1),
    "a tick that is text": changed(k="7"),
    "frames of a stranger": changed(frames=((99, b""),)),
    "frames that are text": changed(frames=((1, "frame"),)),
    "deliveries of lists": changed(deliveries=(([], [], 1),)),
    "a sequence without end": changed(deliveries=((1, 2, 2**63),)),
    "drops without a cause": changed(dropped=((1, 2, 3, None),)),
    "mfow of text": changed(mfow="much"),
    "mfow beyond the run": changed(mfow=2**40),
    "a mean that is none": changed(fog_mean=math.nan),
    "an event of a stranger": lambda _: Event(0, "dead", 77),
    "an event of a list": lambda _: Event(0, "dead", None, [1]),  # type: ignore[arg-type]
    "an event of no tick": lambda _: Event(2**62, "dead", 1),
    "a long event": lambda _: Event(0, "x" * 100_000, 1),
    "an end of a number": lambda _: End(7, ""),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("forge", NONSENSE.values(), ids=NONSENSE)
def test_nonsense_is_ignored_reported_and_forgotten(forge: Callable[[TickRecord], Any], faulty: Seen) -> None:
    wire = FakeFeed(faulty)
    source = wire.source()
    wire.send(5)
    k = watched(source).k
    while not isinstance(unpack(wire.records[wire.number]), TickRecord):
        wire.send(1)
        k = watched(source).k
    wire.batches.append(Batch(wire.number, (pack(forge(tick_of(wire))),), running=True, pace=None))
    state = watched(source)
    assert state.k == k
    assert "make no sense" in state.note
    wire.now += max(AGAIN_S, REFUSED_S)
    wire.send(5)  # whatever comes after the forgery starts the request for what was missed
    assert watched(source).note == ""
    assert wire.answers == 2
    wire.send(10_000)
    state = watched(source)
    assert state.ended == "completed"
    np.testing.assert_array_equal(source.last_seen("truth"), faulty.truth[state.k])


@given(st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
def test_whatever_a_record_holds_the_viewer_goes_on(quiet: Seen, data: st.DataObject) -> None:
    plain = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats() | st.text(max_size=9)
    anything = st.recursive(
        plain | st.binary(max_size=9),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
        max_leaves=8,
    )
    wire = FakeFeed(quiet)
    source = wire.source()
    wire.send(3)
    watched(source)
    says = msgpack.unpackb(wire.records[wire.number], strict_map_key=False)
    field = data.draw(st.sampled_from(sorted(says)))
    says[field] = data.draw(anything)
    if data.draw(st.booleans()) and isinstance(says["robots"], list) and says["robots"]:
        row = says["robots"][0]
        if isinstance(row, list) and row:
            row[data.draw(st.integers(0, len(row) - 1))] = data.draw(anything)
    wire.batches.append(Batch(wire.number, (msgpack.packb(says),), running=True, pace=None))
    source.wait(0.0)
    source.wait(0.0)


def test_an_end_counts_only_once_the_world_is_gone(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    source = wire.source()
    wire.send(5)
    watched(source)
    wire.batches.append(Batch(wire.number, (pack(End("completed", "")),), running=True, pace=None))
    state = source.wait(0.0)
    assert state is None or state.ended is None
    wire.now += AGAIN_S
    for _ in range(2):  # the first batch shows that the end was forged; with the second the true ticks are back
        wire.send(5)
        assert watched(source).ended is None
    wire.send(10_000)
    state = watched(source)
    assert state.ended == "completed"
    np.testing.assert_array_equal(source.last_seen("truth"), quiet.truth[state.k])


def test_a_batch_far_ahead_is_answered_by_one_request_at_a_time(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    source = wire.source()
    wire.now += AGAIN_S
    for _ in range(100):
        wire.batches.append(Batch(1 << 39, (), running=True, pace=None))
    source.wait(0.0)
    assert wire.answers == 2


def test_an_answer_of_another_run_changes_nothing(quiet: Seen) -> None:
    class Replaced(FakeFeed):
        def so_far(self) -> list[bytes]:
            answers = list(super().so_far())
            if self.number > 1:
                forged = replace(self.answer(), header=b"\xc0", mfow=np.array([7.0], np.float32))
                answers = [b"", so_far_bytes(forged), *answers]
            return answers

    wire = Replaced(quiet)
    source = wire.source()
    wire.send(5, lost=True)
    wire.now += AGAIN_S
    wire.send(5)
    assert len(watched(source).robots) == 3
    wire.send(10_000)
    state = watched(source)
    assert wire.answers == 2
    assert state.mfow_s != 7.0 * quiet.open().step
    np.testing.assert_array_equal(source.last_seen("truth"), quiet.truth[state.k])


def test_an_answer_with_the_charge_of_other_robots_changes_nothing(tmp_path: Path) -> None:
    """A battery of 1 Wh that starts at 90 % and gives 36 W has lost 1 % of it a second, in 20 ticks of 0.5 s 10 %."""
    battery = {"capacity": 1.0, "start": 0.9, "idle": 36.0, "drive": 0.0, "charge": 100.0}
    robots = [{"name": "r1", "model": "holonomic", "battery": battery}]
    wire = FakeFeed(run_of(tmp_path, {**QUIET, "duration": 15, "step": 0.5, "robots": robots}))
    wire.number = 21
    source = wire.source()
    wire.number = 1
    forged = so_far_bytes(replace(wire.answer(), charge={7: 0.5}))
    wire.so_far = lambda: [forged]  # type: ignore[method-assign]
    wire.batches.append(Batch(30, (), running=True, pace=None))
    wire.now += AGAIN_S
    assert watched(source).robots[0].charge == pytest.approx(0.8)


def test_the_key_that_a_feed_names_is_never_opened(quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    wire = FakeFeed(quiet)
    header: Any = unpack(wire.records[0])
    named = {**header.scenario, "radio": {**header.scenario["radio"], "key": "/dev/zero"}}
    wire.records[0] = pack(replace(header, scenario=named))
    monkeypatch.setattr("runtime.security.private_files.fleet_key", lambda path: pytest.fail(f"opened {path}"))
    source = wire.source()
    wire.send(5)
    source.set_shown(["heard", 1])
    watched(source)


def test_no_file_that_a_feed_names_is_opened(quiet: Seen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "policy.py").write_text("class Mine: ...\n", encoding="utf-8")
    monkeypatch.setattr("patrol.classes.class_file.file_digest", lambda path, _: pytest.fail(f"opened {path}"))
    answer = FakeFeed(quiet).answer()
    height, width = answer.last_seen.shape
    header: Any = unpack(answer.header)
    mapped = {**QUIET, "terrain": {"map": str(tmp_path / "none.yaml")}}
    named = {**mapped, "patrol": {"policy": f"{tmp_path / 'policy.py'}:Mine"}}
    sent = pack(replace(header, scenario=as_mapping(load_scenario(named, opens_classes=False))))
    assert is_run_of(load_scenario(named, opens_classes=False), sent, height, width)
    assert not is_run_of(load_scenario(mapped, opens_classes=False), sent, height, width)


def test_a_header_is_checked_against_its_terrain_and_the_run(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    answer = wire.answer()
    height, width = answer.last_seen.shape
    own = load_scenario(QUIET)
    assert is_run_of(None, answer.header, height, width)
    assert is_run_of(own, answer.header, height, width)
    assert not is_run_of(own, answer.header, height + 1, width)
    assert not is_run_of(load_scenario({**QUIET, "duration": 41}), answer.header, height, width)
    assert not is_run_of(None, b"\xc0", height, width)
    header: Any = unpack(answer.header)
    for changed in (
        replace(header, terrain=replace(header.terrain, point="1")),
        replace(header, terrain=replace(header.terrain, origin=(math.nan, 0.0))),
        replace(header, scenario=7),
        replace(header, bound_s=math.inf),
        replace(header, robots=header.robots[:-1]),
    ):
        assert not is_run_of(None, pack(changed), height, width)
        with pytest.raises(BadInput, match="another version"):
            FeedSource("fleet-1", wire, read_so_far(so_far_bytes(replace(answer, header=pack(changed)))))


def test_all_that_a_world_records_passes(faulty: Seen, spare: Seen, hazy: Seen, direct: Seen) -> None:
    for seen in (faulty, spare, hazy, direct):
        prepared = seen.open().prepared
        checks = RunChecks.of(prepared.scenario, prepared.terrain.bounds)
        k = 0
        for packed in FakeFeed(seen).records[1:]:
            record = checks.record(packed, k)
            assert record is not None
            k += isinstance(record, TickRecord)
        assert k == prepared.scenario.ticks
    assert Status.ABSENT in {row.status for row in next(iter(spare.open().journal.ticks)).robots}
