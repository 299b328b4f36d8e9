from dataclasses import replace

import msgpack
import pytest

from patrol.errors import Malformed
from patrol.journal import Event, RobotTick, Status, TickRecord
from patrol.wire import read
from runtime.messages.telemetry import SHOW_S, Metrics, Notice, RobotView, Watcher, pack_view, read_traffic

METRICS = Metrics(3, 10, 1.5, 2.0, 1.0, 2.5, 0.5, 40.0, (RobotView("r1", 1, "patrolling", 1.0, 2.0, 0.5),))


def record(k: int, mfow: int) -> TickRecord:
    row = RobotTick(1, Status.ALIVE, 1.0, 2.0, 0.5, 0.0, 0.0, False, "holding", None, 1.0, 0)
    return TickRecord(k, (row,), (), (), (), mfow, 0.5, 50)


def test_readers_skip_what_they_do_not_know() -> None:
    placed = replace(METRICS, stalest=(26.5, -9.5))
    for metrics in (METRICS, placed):
        assert read(Metrics, pack_view(metrics)) == metrics
        says = {**msgpack.unpackb(pack_view(metrics)), "news": [1, 2]}
        assert read(Metrics, msgpack.packb(says)) == metrics


def test_a_watcher_adds_up_and_shows_now_and_then() -> None:
    time = [100.0]
    watcher = Watcher({1: "r1"}, points=100, step=0.5, ticks=4, now=lambda: time[0])
    time[0] += 0.5
    first = watcher.take(record(0, 2))
    assert first == Metrics(1, 4, 0.5, 1.0, 1.0, 1.0, 0.5, 2.0, (RobotView("r1", 1, "holding", 1.0, 2.0, 0.5),))
    assert watcher.take(record(1, 6)) is None
    time[0] += SHOW_S
    third = watcher.take(record(2, 4))
    assert third is not None
    assert (third.k, third.mfow_s, third.mfow_mean_s, third.mfow_max_s) == (3, 2.0, 2.0, 3.0)
    last = watcher.take(record(3, 4))
    assert last is not None
    assert last.k == 4


def test_events_are_told_by_name() -> None:
    watcher = Watcher({1: "r1"}, 1, 0.5, 4, lambda: 0.0)
    assert watcher.notice(Event(3, "lost", 1, "gone")) == Notice(3, "lost", "r1", "gone")
    assert watcher.notice(Event(3, "note")) == Notice(3, "note", "", "")


@pytest.mark.parametrize(
    "traffic",
    [
        None,
        [],
        {},
        {"incarnation": 1, "sent": 1, "heard": {"r2": -1}, "refused": 0, "final": True},
        {"incarnation": 1, "sent": 1, "heard": {}, "refused": 0, "final": 1},
        {"incarnation": 1, "sent": 1.5, "heard": {}, "refused": 0, "final": True},
    ],
)
def test_other_traffic_is_unreadable(traffic: object) -> None:
    with pytest.raises(Malformed):
        read_traffic(msgpack.packb({"traffic": traffic}))
