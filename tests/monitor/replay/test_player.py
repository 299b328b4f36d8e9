import numpy as np
import pytest
from numpy.typing import NDArray

from monitor.observation.source import State
from monitor.replay.player import Player
from patrol.journal.records import Status
from tests.monitor.conftest import Seen
from tests.present import present


class Wall:
    """A wall clock that goes on when it is told to."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def __call__(self) -> float:
        self.time_s += 0.04  # nobody is shown states faster than that
        return self.time_s


def at(player: Player, k: int) -> State:
    assert player.control({"do": "seek", "k": k}).done
    state = present(player.wait(1.0))
    assert state.k == k
    return state


def believed_of(player: Player, number: int) -> NDArray[np.int32]:
    """A robot's belief, which is worked out little by little."""
    return next(seen for _ in range(1000) if (seen := player.last_seen(number)) is not None)


def test_a_player_shows_the_run_at_any_tick_in_any_order(faulty: Seen) -> None:
    run = faulty.open()
    player = Player(run, Wall())
    assert player.static().layers == ("truth", *run.numbers)
    for k in (0, 60, 30, 79, 5, 6):
        state = at(player, k)
        np.testing.assert_array_equal(player.last_seen("truth"), faulty.truth[k])
        assert state.mfow_s == run.mfow[k] * run.step
        assert [robot.status for robot in state.robots] == [Status(int(one)) for one in run.status[k]]
        pose = present(state.robots[0].pose)
        assert (pose.x, pose.y, pose.heading) == tuple(run.poses[k, 0].tolist())


def test_what_a_robot_believed_is_what_its_mind_held(faulty: Seen) -> None:
    player = Player(faulty.open(), Wall())
    for number, k in ((3, 20), (3, 33), (3, 12), (2, 78), (1, 77), (1, 60)):
        at(player, k)
        np.testing.assert_array_equal(believed_of(player, number), faulty.beliefs[k, number])
    assert player.last_seen(99) is None
    assert player.last_seen("heard") is None


def test_closures_what_holds_them_and_beliefs_are_as_they_were(doors: Seen) -> None:
    """The only robot knows all that it truly sees."""
    player = Player(doors.open(), Wall())
    for k, closed, waiting, held in (
        (30, ["crate"], [], ["op2"]),
        (12, ["gate"], [], []),
        (22, [], ["crate"], ["op1", "op2"]),
        (28, ["crate", "gate"], [], ["op2"]),
        (45, [], [], ["op3"]),
        (79, [], [], []),
    ):
        state = at(player, k)
        looks = state.looks["closures"]
        assert [name for name in sorted(looks) if looks[name].filled] == closed
        assert [name for name in sorted(looks) if looks[name].waits] == waiting
        assert [fault["id"] for fault in state.faults] == held
        np.testing.assert_array_equal(believed_of(player, 1), doors.truth[k])


def test_two_who_look_at_two_robots_both_come_to_see_them(faulty: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.replay.past_beliefs.BUDGET_S", 0.0)
    player = Player(faulty.open(), Wall())
    at(player, 60)
    turns = ([player.last_seen(number) for number in (2, 3)] for _ in range(500))
    both = next(seen for seen in turns if all(one is not None for one in seen))
    np.testing.assert_array_equal(both, [faulty.beliefs[60, number] for number in (2, 3)])


def test_links_come_by_themselves_however_slow_the_journal(faulty: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.replay.run_log.BUDGET_S", 0.0)
    run = faulty.open()
    player = Player(run, Wall())
    assert at(player, run.ticks - 1).links is None
    state = next(state for _ in range(run.ticks) if (state := player.wait(1.0)) is not None)
    assert (state.k, state.running) == (run.ticks - 1, False)
    assert state.links is not None
    assert any(robot.heard_s is not None for robot in state.robots)
    assert player.wait(1.0) is None  # it is told once


def test_a_trail_is_where_robots_were_as_long_as_they_had_a_body(faulty: Seen) -> None:
    run = faulty.open()
    trail = Player(run, Wall()).trail(30, 70)
    there = ~np.isin(run.status[30:71], (Status.ABSENT, Status.LEFT))
    np.testing.assert_array_equal(trail[there], run.poses[30:71, :, :2][there])
    assert np.isnan(trail[~there]).all()


def test_a_player_plays_at_its_pace_and_backwards_and_stops_at_the_ends(quiet: Seen) -> None:
    wall = Wall()
    player = Player(quiet.open(), wall)
    at(player, 10)
    assert player.control({"do": "pace", "factor": 4.0}).done
    assert player.control({"do": "go"}).done
    before = wall.time_s
    wall.time_s += 2.0
    state = present(player.wait(1.0))
    assert state.running
    assert state.k == pytest.approx(10 + (wall.time_s - before) * 4.0 / 0.5, abs=2)
    wall.time_s += 1000.0
    state = present(player.wait(1.0))
    assert (state.k, state.running) == (79, False)
    assert player.control({"do": "pace", "factor": -2}).done
    assert player.control({"do": "step"}).done
    assert present(player.wait(1.0)).k == 78
    assert player.control({"do": "go"}).done
    wall.time_s += 1000.0
    state = present(player.wait(1.0))
    assert (state.k, state.running) == (0, False)


def test_a_run_that_plays_by_itself_waits_for_the_first_page(quiet: Seen) -> None:
    wall = Wall()
    player = Player(quiet.open(), wall, autoplay=True)
    wall.time_s += 5.0
    state = present(player.wait(1.0))
    assert (state.k, state.running, state.pace) == (0, False, 1.0)
    player.set_shown([])
    again = player.wait(0.1)  # None, or the same with what has been read of the journal since
    assert again is None or not again.running
    player.set_shown(["truth"])
    wall.time_s += 5.0
    state = present(player.wait(1.0))
    assert state.running
    assert state.k >= 10
    assert player.control({"do": "pause"}).done
    player.set_shown(["truth", 1])
    assert not present(player.wait(1.0)).running


def test_a_control_comes_before_playing_by_itself(quiet: Seen) -> None:
    player = Player(quiet.open(), Wall(), autoplay=True)
    assert at(player, 30).running is False
    player.set_shown(["truth"])
    assert at(player, 31).running is False


@pytest.mark.parametrize(
    ("duration_s", "pace"), [(40, 1.0), (90, 1.0), (91, 2.0), (1800, 20.0), (3600, 50.0), (50_000, 100.0)]
)
def test_a_long_run_plays_faster(quiet: Seen, duration_s: int, pace: float, monkeypatch: pytest.MonkeyPatch) -> None:
    run = quiet.open()
    monkeypatch.setattr(type(run), "step", duration_s / run.ticks)
    assert present(Player(run, Wall(), autoplay=True).wait(1.0)).pace == pace


@pytest.mark.parametrize(
    "control",
    [{}, {"do": 3}, {"do": "kill"}, {"do": "pace", "factor": 0}, {"do": "pace", "factor": "fast"}, {"do": "seek"}],
)
def test_a_player_refuses_what_makes_no_sense(quiet: Seen, control: dict[str, object]) -> None:
    answer = Player(quiet.open(), Wall()).control(control)
    assert not answer.done
    assert answer.text


def test_all_fogs_are_of_the_tick_that_was_shown_last(faulty: Seen) -> None:
    """Somebody jumps between a state and the fogs that belong to it."""
    player = Player(faulty.open(), Wall())
    at(player, 60)
    assert player.control({"do": "seek", "k": 20}).done
    assert player.tick("truth") == player.tick(2) == 60
    np.testing.assert_array_equal(player.last_seen("truth"), faulty.truth[60])
    np.testing.assert_array_equal(believed_of(player, 2), faulty.beliefs[60, 2])


def test_each_robots_state_is_its_own_at_the_tick(faulty: Seen) -> None:
    run = faulty.open()
    player = Player(run, Wall())
    player.read_all()
    for k in (0, 40, 46, 57, 79):
        state = at(player, k)
        heard = present(state.links).heard
        for index, robot in enumerate(state.robots):
            assert (robot.number, robot.state) == (run.numbers[index], run.labels[run.states[k, index]])
            goal = tuple(run.goals[k, index].tolist())
            has_goal = robot.status is Status.ALIVE and not np.isnan(goal).any()
            assert robot.goal == (goal if has_goal else None)
            took = float(run.decision_ms[k, index])
            assert robot.decision_ms == (None if np.isnan(took) else took)
            last = max(int(tick) for tick in heard[index])
            assert robot.heard_s == (None if last < 0 else (k - last) * run.step)
            assert robot.charge is None
        assert (state.time_s, state.fog_mean_s) == (k * run.step, run.fog_mean[k] * run.step)
    shapes = player.static().robots
    assert [(shape.number, shape.name, shape.radius) for shape in shapes] == [(n, f"r{n}", 1.0) for n in (1, 2, 3)]
    assert player.static().ticks == run.ticks == 80


def test_series_and_events_go_on_from_where_they_were_asked_for(faulty: Seen) -> None:
    run = faulty.open()
    player = Player(run, Wall())
    for after, first in ((-1, 0), (0, 1), (77, 78), (79, 80)):
        series = player.series(after)
        assert series.ticks.tolist() == list(range(first, 80))
        assert series.mfow_s.tolist() == (run.mfow[first:] * run.step).tolist()
        assert series.fog_mean_s.tolist() == (run.fog_mean[first:] * run.step).tolist()
    assert [*player.events(0)] == [*run.events]
    assert [*player.events(3)] == [*run.events[3:]]
    assert [*player.events(len(run.events))] == []


@pytest.mark.parametrize(
    ("k", "pace", "stepped"), [(5, 1.0, 6), (5, -1.0, 4), (0, -2.0, 0), (79, 2.0, 79), (-3, 1.0, 1), (1000, -1.0, 78)]
)
def test_a_step_is_one_tick_the_way_that_it_plays_and_no_further_than_the_ends(
    quiet: Seen, k: int, pace: float, stepped: int
) -> None:
    player = Player(quiet.open(), Wall())
    for control in ({"do": "pace", "factor": pace}, {"do": "seek", "k": k}, {"do": "step"}):
        assert player.control(control).done
    state = present(player.wait(1.0))
    assert (state.k, state.running, state.pace) == (stepped, False, pace)


@pytest.mark.parametrize(
    ("factor", "done"), [(1000.0, True), (1000.1, False), (-1000.0, True), (-1000.1, False), (0.0, False)]
)
def test_a_pace_is_at_most_a_thousand_and_never_none(quiet: Seen, factor: float, done: bool) -> None:
    assert Player(quiet.open(), Wall()).control({"do": "pace", "factor": factor}).done is done


def test_who_goes_on_at_the_end_begins_anew_and_backwards_does_not(quiet: Seen) -> None:
    for pace, begins in ((1.0, 0), (-1.0, 78)):
        player = Player(quiet.open(), Wall())
        for control in ({"do": "pace", "factor": pace}, {"do": "seek", "k": 79}, {"do": "go"}):
            player.control(control)
        state = present(player.wait(1.0))
        assert state.running
        assert state.k == begins
