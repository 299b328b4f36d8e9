"""Messages of a live recording, for the states of a source that is told here."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from monitor.observation.source import RobotShape, RobotState, Series, State, Static
from monitor.recording import live_recorder
from monitor.recording.live_recorder import LiveRecorder, record_live
from patrol.ground.terrain import Terrain
from patrol.journal.records import Event, Status
from patrol.pose import Pose
from patrol.scenario import as_mapping, load_scenario
from tests.recordings import decoded

NAMES = ("anna", "bert")
PATROLLED = np.ones((2, 3), dtype=np.bool_)


class Told:
    """A source of what is told it; a tick lasts half a second."""

    def __init__(self, *, truth: bool = True) -> None:
        self.states: list[State | None] = []
        self.mfow_s: dict[int, float] = {}
        self.news: list[Event] = []
        self.seen = np.zeros((2, 3), dtype=np.int32)
        self.now = 0
        scenario = {"terrain": {"builtin": "open"}, "robots": [{"name": name} for name in NAMES]}
        shapes = tuple(RobotShape(n, name, "car", 0.5, 10.0, 360.0) for n, name in enumerate(NAMES, 1))
        mapping = as_mapping(load_scenario(scenario))
        self._static = Static(
            name="f",
            scenario=mapping,
            terrain=Terrain("f", PATROLLED, 0.5, (3.0, 4.0)),
            patrolled=PATROLLED,
            robots=shapes,
            step=0.5,
            ticks=None,
            bound_s=None,
            live=True,
            layers=("truth",) if truth else ("heard",),
        )

    def static(self) -> Static:
        return self._static

    def wait(self, timeout_s: float) -> State | None:
        assert timeout_s > 0.0
        return self.states.pop(0)

    def series(self, after: int) -> Series:
        ticks = sorted(k for k in self.mfow_s if after < k <= self.now)
        mfow = np.array([self.mfow_s[k] for k in ticks])
        return Series(np.array(ticks, dtype=np.int64), mfow, 0.5 * mfow)

    def events(self, since: int) -> list[Event]:
        return self.news[since:]

    def last_seen(self, layer: object) -> Any:
        assert layer == self._static.layers[0]
        return self.seen


def state(k: int, *statuses: Status, **more: Any) -> State:
    robots = tuple(
        RobotState(n, status, pose=Pose(float(n), 0.5 * k, 0.0), decision_ms=None if n == 2 else 1.5)
        for n, status in enumerate(statuses or (Status.ALIVE, Status.PAUSED), 1)
    )
    return State(k, 0.5 * k, True, None, 2.0, robots, None, None, **more)


def recorded(source: Told, states: list[State], folder: Path) -> dict[str, list[tuple[float, Any]]]:
    recorder = LiveRecorder(cast(Any, source), folder / "live.mcap", "2026-01-02T03:04:05+00:00")
    for one in states:
        source.now = one.k
        recorder.write(one)
    recorder.close()
    return decoded(folder / "live.mcap")


def test_each_state_is_written_at_its_time_with_the_bodies_that_are_there(tmp_path: Path) -> None:
    states = [state(4), state(6, Status.DEAD, Status.ABSENT), state(6, Status.ALIVE, Status.ALIVE), state(7)]
    topics = recorded(Told(), states, tmp_path)
    assert [(at, value.data) for at, value in topics["/alive"]] == [(2.0, 1.0), (3.0, 0.0), (3.5, 1.0)]
    assert [at for at, _ in topics["/anna/pose"]] == [2.0, 3.0, 3.5]
    assert [at for at, _ in topics["/bert/pose"]] == [2.0, 3.5]
    place = topics["/bert/pose"][1][1].pose.position
    assert (place.x, place.y) == (2.0, 3.5)
    assert [value.data for _, value in topics["/anna/decision_ms"]] == [1.5] * 3
    assert "/bert/decision_ms" not in topics
    assert [at for at, _ in topics["/map"]] == [2.0]


def test_without_the_truth_only_living_robots_have_bodies(tmp_path: Path) -> None:
    topics = recorded(Told(truth=False), [state(0), state(1, Status.LOST, Status.ALIVE)], tmp_path)
    assert [at for at, _ in topics["/anna/pose"]] == [0.0]
    assert [at for at, _ in topics["/bert/pose"]] == [0.5]


def test_measures_come_for_every_tick_from_the_first_state_on(tmp_path: Path) -> None:
    source = Told()
    source.mfow_s = {k: float(k) for k in range(9)}
    topics = recorded(source, [state(4), state(8)], tmp_path)
    assert [(at, value.data) for at, value in topics["/mfow"]] == [(0.5 * k, float(k)) for k in range(4, 9)]
    assert [(at, value.data) for at, value in topics["/fog_mean"]] == [(0.5 * k, 0.5 * k) for k in range(4, 9)]


def test_grids_come_every_ten_seconds_and_at_the_end_and_their_scale_doubles(tmp_path: Path) -> None:
    source = Told()
    source.mfow_s = {0: 1.0, 19: 10.0, 20: 10.5, 40: 41.0}
    states = [state(k) for k in (0, 19, 20, 39, 40, 45)]
    topics = recorded(source, states, tmp_path)
    grids = [(at, value.data) for at, value in topics["/fog_scale"]]
    assert grids == [(0.0, 10.0), (10.0, 20.0), (20.0, 80.0), (22.5, 80.0)]
    assert [at for at, _ in topics["/fog"]] == [0.0, 10.0, 20.0, 22.5]
    # All was seen in tick 0: at 10 s that is half of the scale, at 20 s a quarter.
    assert [set(value.data) for _, value in topics["/fog"]] == [{0}, {50}, {25}, {28}]
    corner = topics["/fog"][0][1].info.origin.position
    assert (corner.x, corner.y, topics["/fog"][0][1].info.resolution) == (3.0, 4.0, 0.5)


def test_a_grid_that_was_just_written_is_the_last_one(tmp_path: Path) -> None:
    topics = recorded(Told(), [state(0), state(20)], tmp_path)
    assert [at for at, _ in topics["/fog"]] == [0.0, 10.0]


def test_events_before_the_first_state_are_left_out_and_others_have_their_own_time(tmp_path: Path) -> None:
    source = Told()
    source.news = [Event(3, "dead", 1, "before"), Event(4, "dead", 2, "now"), Event(5, "note", None, "later")]
    topics = recorded(source, [state(4), state(6)], tmp_path)
    said = [(at, log.name, log.msg) for at, log in topics["/rosout"]]
    assert said[1:] == [(2.0, "bert", "dead: now"), (2.5, "run", "note: later")]


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The states that are recorded, and that the recording was closed."""
    done: list[str] = []

    class Noted:
        last: State | None = None

        def __init__(self, *_: object) -> None:
            pass

        def write(self, one: State) -> None:
            done.append(str(one.k))
            self.last = one

        def close(self) -> None:
            done.append("closed")

    monkeypatch.setattr(live_recorder, "LiveRecorder", Noted)
    return done


def record(source: Told, stop: Callable[[], bool] = lambda: False) -> tuple[State | None, list[str]]:
    said: list[str] = []
    clock = iter(float(n) for n in range(1000))
    last = record_live(cast(Any, source), Path("out"), "", stop, said.append, lambda: next(clock))
    return last, said


def test_a_recording_ends_with_the_run_and_says_what_is_wrong_meanwhile(written: list[str]) -> None:
    source = Told()
    silent = replace(state(2), note="nothing heard")
    source.states = [state(0), None, silent, silent, state(3), replace(state(4), ended="completed"), state(5)]
    last, said = record(source)
    assert written == ["0", "2", "2", "3", "4", "closed"]
    assert said == ["nothing heard", "receiving data again"]
    assert last is not None
    assert last.k == 4


def test_a_world_that_is_gone_for_ten_seconds_ends_a_recording(written: list[str]) -> None:
    source = Told()
    gone = replace(state(1), gone=True)
    source.states = [gone, *[None] * 3, state(2), gone, *[None] * 30]
    _, said = record(source)
    assert said == ["the world was disconnected for 10 s; the recording ends"]
    assert written == ["1", "2", "1", "closed"]
    assert len(source.states) == 30 - 9  # the clock is asked once a turn, and twice in that in which it is gone


def test_a_recording_ends_when_it_is_told_to(written: list[str]) -> None:
    answers = iter([False, False, True])
    source = Told()
    source.states = [state(0), state(1), state(2)]
    record(source, lambda: next(answers))
    assert written == ["0", "1", "closed"]
