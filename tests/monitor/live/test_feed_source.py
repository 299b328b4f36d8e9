"""The feed of a run that goes on: the same fogs as the world's and the minds', from the start, late, and over gaps."""

import json
import struct
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor.live.feed_client import FeedClient
from monitor.live.feed_source import AGAIN_S, FeedSource
from monitor.live.fog_tracker import HEARD
from monitor.observation.source import Answer, State
from monitor.replay.player import Player
from patrol.energy.batteries import Batteries
from patrol.errors import BadInput
from patrol.ground.fog import NEVER
from patrol.journal import JournalWriter, pack, unpack
from patrol.journal.file import MAGIC
from patrol.journal.records import Event, Status, TickRecord
from patrol.scenario.controls import OPERATOR
from patrol.wire import read_sparingly
from runtime.messages.feed import Batch, SoFar, batch_bytes, read_so_far, so_far_bytes
from runtime.net.mailbox import Question
from tests.monitor.conftest import Seen
from tests.present import present
from worldsim.controls import RunState
from worldsim.output.feed_publisher import Feed, ground_of
from worldsim.output.record import header_of
from worldsim.world import World


def records_of(seen: Seen) -> list[bytes]:
    """A journal's records, packed, in their order."""
    data = (seen.folder / "journal").read_bytes()[len(MAGIC) :]
    found = []
    while data:
        length, _ = struct.unpack("<II", data[:8])
        found.append(data[8 : 8 + length])
        data = data[8 + length :]
    return found


class FakeFeed(FeedClient):
    """A wire from a run that is over: what the feed would have sent, batch by batch."""

    may_control = True
    waits = ""
    present = True
    """Until the last record has been sent."""

    def __init__(self, seen: Seen) -> None:
        self.seen = seen
        self.records = records_of(seen)
        self.batches: deque[Batch] = deque()
        self.answers = 0
        self.now = 100.0
        self.asked: list[Mapping[str, Any]] = []
        self.number = 1
        self.most_events = 10_000
        self.asked_for: list[Event] = []

    def batch(self, timeout_s: float) -> Batch | None:
        self.now += timeout_s
        return self.batches.popleft() if self.batches else None

    def send(self, records: int, *, lost: bool = False) -> None:
        """The next records as a batch."""
        part = tuple(self.records[self.number : self.number + records])
        if not lost:
            self.batches.append(read_sparingly(Batch, batch_bytes(Batch(self.number, part, running=True, pace=None))))
        self.number += len(part)
        self.present = self.number < len(self.records)

    def so_far(self) -> Iterable[bytes]:
        self.answers += 1
        return [so_far_bytes(self.answer())]

    def answer(self) -> SoFar:
        prepared = self.seen.open().prepared
        before = [unpack(record) for record in self.records[: self.number]]
        ticks = [record for record in before if isinstance(record, TickRecord)]
        events = tuple(pack(record) for record in before if isinstance(record, Event))
        blank = np.full(prepared.terrain.passable.shape, NEVER, dtype=np.int32)
        batteries = Batteries(prepared.scenario.roster, prepared.scenario.docks, prepared.scenario.step)
        for tick in ticks:
            batteries.tick(tick.robots)
        return SoFar(
            number=self.number,
            header=self.records[0],
            last=pack(ticks[-1]) if ticks else None,
            last_seen=self.seen.truth[ticks[-1].k] if ticks else blank,
            events=events[max(len(events) - self.most_events, 0) :],
            event=max(len(events) - self.most_events, 0),
            asked=tuple(pack(event) for event in self.asked_for),
            every=1,
            mfow=np.array([tick.mfow for tick in ticks], dtype=np.float32),
            fog_mean=np.array([tick.fog_mean for tick in ticks], dtype=np.float32),
            running=True,
            pace=None,
            charge=batteries.shares,
            ground=ground_of(prepared),
        )

    def control(self, control: Mapping[str, Any]) -> Answer:
        self.asked.append(control)
        return Answer(True, "done")

    def close(self) -> None:
        pass

    def source(self) -> FeedSource:
        (payload,) = self.so_far()
        return FeedSource("fleet-1", self, read_so_far(payload), lambda: self.now)


def watched(source: FeedSource) -> State:
    """The state once nothing is left to take in."""
    return deque(iter(partial(source.wait, 0.01), None), 1)[0]


def played(seen: Seen, k: int = 1) -> tuple[FeedSource, State]:
    """A source that has taken in a whole run from a record on, and its last state."""
    wire = FakeFeed(seen)
    wire.number = k
    source = wire.source()
    wire.send(10_000)
    return source, watched(source)


def test_from_the_start_the_fogs_are_those_of_the_world_and_of_its_minds(faulty: Seen) -> None:
    run, wire = faulty.open(), FakeFeed(faulty)
    source = wire.source()
    robots = [shape.number for shape in source.static().robots]
    state = watched(source)
    while wire.number < len(wire.records):
        wire.send(7)
        state = watched(source)
        np.testing.assert_array_equal(source.last_seen("truth"), faulty.truth[state.k])
    assert (state.k, state.ended, state.running) == (run.ticks - 1, "completed", False)
    assert state.mfow_s == run.mfow[-1] * run.step
    for number in robots:
        assert source.last_seen(number) is None  # it is worked out first
    source.wait(10.0)
    assert Status.ALIVE in {robot.status for robot in state.robots}
    for number in robots:
        np.testing.assert_array_equal(source.last_seen(number), faulty.beliefs[state.k, number])
    series = source.series(3)
    np.testing.assert_array_equal(series.ticks, np.arange(4, run.ticks))
    np.testing.assert_allclose(series.mfow_s, run.mfow[4:] * run.step)
    links = present(state.links)
    np.testing.assert_array_equal(links.delivered, run.links.delivered[1:, 1:])
    assert (links.sent - links.delivered - run.links.lost[1:, 1:]).min() >= 0
    assert tuple(source.events(0)) == run.events
    assert wire.answers == 1


def test_who_hears_everything_knows_the_truth_where_nothing_is_forged(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    source = wire.source()
    assert source.last_seen(HEARD) is not None
    wire.send(10_000)
    np.testing.assert_array_equal(source.last_seen(HEARD), quiet.truth[watched(source).k])
    assert source.last_seen(77) is None


def test_who_comes_late_is_told_what_was_before(faulty: Seen) -> None:
    wire = FakeFeed(faulty)
    wire.number = 20
    source = wire.source()
    state = present(source.wait(0.0))
    since = state.k
    np.testing.assert_array_equal(source.last_seen("truth"), faulty.truth[since])
    assert len(source.series(-1).ticks) == since + 1
    assert state.note == ""
    assert present(state.links).since == since + 1
    wire.send(10_000)
    state = watched(source)
    np.testing.assert_array_equal(source.last_seen("truth"), faulty.truth[state.k])
    assert tuple(source.events(0)) == faulty.open().events


def test_what_was_missed_is_asked_for_again_but_not_all_the_time(faulty: Seen) -> None:
    """Links are known from the gap on, and say so."""
    wire = FakeFeed(faulty)
    source = wire.source()
    wire.send(5)
    watched(source)
    wire.send(6, lost=True)
    wire.send(2)
    source.wait(0.0)
    assert wire.answers == 1  # only just asked
    wire.now += AGAIN_S
    wire.send(10)
    state = watched(source)
    links = present(state.links)
    assert (wire.answers, state.note) == (2, "")
    assert (links.since, links.sent.sum()) == (state.k + 1, 0)
    np.testing.assert_array_equal(source.last_seen("truth"), faulty.truth[state.k])
    wire.send(10_000)
    state = watched(source)
    np.testing.assert_array_equal(source.last_seen("truth"), faulty.truth[state.k])
    assert tuple(source.events(0)) == faulty.open().events
    assert state.ended == "completed"


def test_a_gap_doubles_no_event_and_is_told(faulty: Seen) -> None:
    wire = FakeFeed(faulty)
    wire.most_events = 8
    source = wire.source()
    events = faulty.open().events
    while wire.number < len(wire.records) - 1:
        wire.send(5)
        watched(source)
        wire.send(1, lost=True)
        wire.now += AGAIN_S
    wire.send(1)
    watched(source)
    assert wire.answers > 5
    assert tuple(source.events(0)) == events


def test_trails_have_every_tick_that_came_however_many_came_at_once(quiet: Seen) -> None:
    world = FakeFeed(quiet)
    source = world.source()
    for _ in range(3):
        world.send(20)
    k = watched(source).k
    assert k == 59
    np.testing.assert_array_equal(source.trail(0, k), quiet.open().poses[: k + 1, :, :2])
    assert source.trail(0, k + 1) is None
    world.send(2, lost=True)
    world.send(2)
    world.now += AGAIN_S
    watched(source)
    assert source.trail(k, k) is None


def test_what_operators_asked_for_is_in_force_however_much_happened_since(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    detail = json.dumps({"do": "fault", "fault": {"kind": "loss", "id": "f1", "rate": 0.5}})
    wire.asked_for = [Event(0, OPERATOR, None, detail)]
    wire.most_events, wire.number = 0, 20
    assert [one["id"] for one in watched(wire.source()).faults] == ["f1"]


def shut(state: State) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The closures that are closed, and those that wait."""
    looks = sorted(state.looks["closures"].items())
    return tuple(name for name, look in looks if look.filled), tuple(name for name, look in looks if look.waits)


def test_closures_and_what_holds_them_are_known_from_the_start_and_late(doors: Seen) -> None:
    wire = FakeFeed(doors)
    asked = [event for event in doors.open().journal.events if event.kind == OPERATOR]
    source, shown = wire.source(), dict[int, State]()
    while wire.number < len(wire.records) - 1:
        wire.send(1)
        state = source.wait(0.01)
        if state is None or state.k in shown:
            continue
        shown[state.k] = state
        np.testing.assert_array_equal(source.last_seen("truth"), doors.truth[state.k])
    told = {k: (*shut(state), [fault["id"] for fault in state.faults]) for k, state in shown.items()}
    expected = {
        10: (("gate",), (), []),
        20: ((), (), ["op1"]),
        22: ((), ("crate",), ["op1", "op2"]),
        24: (("crate",), (), ["op1", "op2"]),
        28: (("crate", "gate"), (), ["op2"]),
        40: ((), (), ["op3"]),
        50: ((), (), []),
    }
    assert {k: told[k] for k in expected} == expected
    late = FakeFeed(doors)
    late.number = 1 + next(i for i, record in enumerate(late.records) if getattr(unpack(record), "k", 0) == 34)
    late.asked_for = [*asked[:3], Event(30, "opened", None, "gate"), Event(24, "closed", None, "crate")]
    late.most_events = 0
    state = watched(late.source())
    assert (shut(state)[0], [fault["id"] for fault in state.faults]) == (("crate",), ["op2"])


def test_a_belief_is_computed_with_what_was_closed_then(doors: Seen) -> None:
    """The only robot knows all that it truly sees."""
    source, state = played(doors)
    assert source.last_seen(1) is None
    source.wait(10.0)
    np.testing.assert_array_equal(source.last_seen(1), doors.truth[state.k])


def test_a_robot_that_nobody_hears_is_silent_however_much_it_sends(muted: Seen, alone: Seen) -> None:
    _, state = played(muted)
    assert [robot.heard_s for robot in state.robots] == [(state.k - 9) * muted.open().step, 0.0, 0.0]
    assert [robot.heard_s for robot in played(alone)[1].robots] == [0.0], "the only robot"


def test_of_a_direct_radio_nobody_tells_who_heard_what(direct: Seen) -> None:
    source, state = played(direct)
    assert state.links is None
    assert [robot.heard_s for robot in state.robots] == [0.0, 0.0, 0.0]  # the world has overheard them
    assert source.static().direct
    assert source.static().layers == ("truth", HEARD)
    assert source.last_seen(1) is None
    player = Player(direct.open())
    assert player.static().direct
    assert player.static().layers == ("truth",)
    assert present(player.wait(1.0)).links is None
    assert player.last_seen(1) is None


class Asking:
    """Somebody who asks a world once for all so far."""

    def __init__(self) -> None:
        self.waiting = [("truth/fog", Question(b"", self.answer))]
        self.told: list[bytes] = []

    def get(self, timeout_s: float = 0.0) -> tuple[str, Question] | None:  # noqa: ARG002 - it is there or it is not
        return self.waiting.pop() if self.waiting else None

    def answer(self, payload: bytes) -> None:
        self.told.append(payload)


def test_a_world_tells_of_its_latest_events_and_of_all_asked_for(
    quiet: Seen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("worldsim.output.feed_publisher.MOST_EVENTS", 3)
    world, asking, posted = World(quiet.open().prepared), Asking(), list[bytes]()
    header = header_of(world, "2026-01-02T03:04:05+00:00")
    with JournalWriter(tmp_path / "journal", header) as journal:
        state = RunState(running=True, pace=None)
        feed = Feed(world, journal, header, posted.append, asking, lambda do: do(), lambda: 100.0, lambda: state)
        asked = Event(0, OPERATOR, None, '{"do":"pause"}')
        opened, waits = Event(0, "opened", None, "gate"), Event(0, "waiting", 1, "door waits to close: r1 in it")
        closures = (Event(0, "closed", None, "gate"), waits, opened)
        for record in (asked, *closures, *(Event(k, "fault", None, f"f{k}") for k in range(1, 6))):
            feed.write(record)
        feed.between()
    so_far = read_so_far(asking.told[0])
    latest = [event for one in so_far.events if isinstance(event := unpack(one), Event)]
    assert [event.detail for event in latest] == ["f3", "f4", "f5"]
    assert so_far.event == 6
    assert so_far.asked == (pack(asked), pack(opened), pack(waits))


def test_the_rate_is_right_soon_after_a_pause(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    source = wire.source()
    wire.send(9)
    watched(source)
    wire.batches.append(Batch(wire.number, (), running=False, pace=None))
    assert watched(source).ticks_per_s == 0.0
    wire.now += 100.0
    state = None
    for _ in range(6):
        wire.send(2)
        wire.now += 0.2
        state = source.wait(0.0)
    assert present(state).ticks_per_s == pytest.approx(10.0, rel=0.4)


def test_controls_go_to_the_world_unless_they_make_no_sense(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    source = wire.source()
    assert "fault" in source.static().controls
    assert source.control({"do": "pause"}).done
    assert not source.control({"do": "explode"}).done
    assert wire.asked == [{"do": "pause"}]
    wire.may_control = False
    assert not source.control({"do": "pause"}).done
    assert source.static().controls == ()


def test_silence_and_a_world_that_is_gone_are_told(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    source = wire.source()
    wire.send(5)
    assert watched(source).note == ""
    wire.now += 60.0
    assert present(source.wait(0.0)).note.startswith("no data for ")
    wire.present = False
    assert present(source.wait(0.0)).note == "the world has disconnected"


def test_a_world_of_another_version_is_refused(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    answer = replace(wire.answer(), header=b"\xc0")
    with pytest.raises(BadInput, match="another version"):
        FeedSource("fleet-1", wire, read_so_far(so_far_bytes(answer)))


def test_a_feed_whose_charge_is_of_other_robots_is_refused(quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    with pytest.raises(BadInput, match="its world sent the charge of other robots than have batteries"):
        FeedSource("test", wire, replace(wire.answer(), charge={1: 0.5}), now=lambda: wire.now)
