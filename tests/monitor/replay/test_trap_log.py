import math
from dataclasses import replace

import pytest

from monitor.observation.source import Trapped
from monitor.observation.traps import TrapWatch
from monitor.replay.player import Player
from monitor.replay.run_log import RunLog
from patrol.measures.stays import TRAPPED_S
from runtime.messages.telemetry import FREE, TRAPPED
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed, played, watched
from tests.monitor.replay.test_player import Wall, at
from tests.present import present


def test_who_was_trapped_is_known_at_any_tick(trapped: Seen) -> None:
    run = trapped.open()
    log = RunLog(run)
    while not log.done:
        log.read()
    found = round(TRAPPED_S / run.step)
    for k, numbers in ((0, []), (found - 1, []), (found, [2]), (389, [2]), (390, []), (399, [])):
        assert list(present(log.at(k))) == numbers
    begins, ends = log.events
    assert (begins.k, begins.kind, begins.robot) == (found, TRAPPED, 2)
    assert (ends.k, ends.kind, ends.robot) == (390, FREE, 2)
    assert "since 0 s; nobody has seen (" in begins.detail


def test_a_robot_that_is_shut_in_is_not_trapped(shut_in: Seen) -> None:
    run = shut_in.open()
    assert run.closings.names(run.ticks - 1) == {"side0", "side1", "side2", "side3"}
    watch = TrapWatch(run.prepared)
    events = [watch.tick(record, lambda: shut_in.truth[record.k]) for record in run.journal.ticks]  # noqa: B023
    assert any(events), "it counts where what is closed is unknown"
    log, (_, state) = RunLog(run), played(shut_in)
    while not log.done:
        log.read()
    assert state.robots[0].trapped is None
    assert not log.events


def test_it_is_unknown_until_the_journal_is_read_that_far(trapped: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.replay.run_log.BUDGET_S", -1.0)  # a tick, or a stretch of fog, in each call
    log, whole = RunLog(trapped.open()), RunLog(trapped.open())
    log.read()
    assert log.at(0) == {}
    assert log.at(1) is None
    monkeypatch.setattr("monitor.replay.run_log.BUDGET_S", math.inf)
    whole.read()
    assert whole.done
    monkeypatch.setattr("monitor.replay.run_log.BUDGET_S", -1.0)
    while not log.done:
        log.read()
    assert log.events == whole.events
    assert log.at(380) == whole.at(380)


def test_a_replay_says_it_after_jumps_and_a_fleet_as_it_runs(trapped: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.replay.run_log.BUDGET_S", math.inf)
    player = Player(trapped.open(), Wall())
    wire = FakeFeed(trapped)
    source = wire.source()
    for k in (380, 10):
        state = at(player, k)
        assert [robot.trapped for robot in state.robots] == [None, Trapped(0.0) if k == 380 else None]
    while wire.number < len(wire.records):
        wire.send(40)
        state = watched(source)
        assert [robot.trapped for robot in state.robots] == [robot.trapped for robot in at(player, state.k).robots]
    both = [[event for event in one.events(0) if event.kind in (TRAPPED, FREE)] for one in (player, source)]
    assert both[0] == both[1]
    assert len(both[0]) == 2
    assert player.events(len(trapped.open().events) + 1) == both[0][1:]


def test_a_replay_says_it_by_itself_once_it_is_known(trapped: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.replay.run_log.BUDGET_S", -1.0)
    player = Player(trapped.open(), Wall())
    assert at(player, 380).robots[1].trapped is None
    state = next(state for _ in range(500) if (state := player.wait(1.0)) is not None)
    assert state.robots[1].trapped == Trapped(0.0)
    assert player.wait(0.1) is None  # it is said once


def test_who_comes_late_does_not_know_since_when(trapped: Seen) -> None:
    wire = FakeFeed(trapped)
    wire.number = 21
    source = wire.source()
    wire.send(366)
    known = present(watched(source).robots[1].trapped)
    assert not known.exact
    assert 0.0 < known.since_s < 15.0


@pytest.mark.parametrize(("later_s", "exact"), [(1.0, False), (2.0, True)])
def test_a_stay_is_as_long_as_it_seems_if_its_robot_was_seen_elsewhere_for_more_than_a_second(
    trapped: Seen, later_s: float, exact: bool
) -> None:
    """Places are looked at once a second, so the first look alone does not say when a robot came."""
    run = trapped.open()
    first, came = 10, 10 + round(later_s / run.step)
    watch = TrapWatch(run.prepared, from_start=False)
    for record in list(run.journal.ticks)[first:389]:
        rows = [replace(row, x=row.x + 30.0) if row.number == 2 and record.k < came else row for row in record.robots]
        watch.tick(replace(record, robots=tuple(rows)), lambda: trapped.truth[record.k])  # noqa: B023
    assert watch.trapped(2) == Trapped(came * run.step, exact)
