"""A run's folder as a source for the page: the state at any tick, at any speed, forwards and backwards."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.replay.linklog import LinkLog
from monitor.replay.past_beliefs import Hindsight
from monitor.replay.replay import Replay
from monitor.replay.run import Run
from monitor.source import Answer, Layer, RobotShape, RobotState, Series, State, Static
from patrol.errors import BadInput
from patrol.journal.records import Event, Status
from patrol.pose import Pose
from patrol.radio.fleet_key import fleet_key

SHOW_S = 1.0 / 30.0
"""Wall time between two states."""

FASTEST = 1000.0
"""Of the factors of real time."""

_RATE_S = 2.0
_NO_BODY = (Status.ABSENT, Status.LEFT)


class Player:
    """Plays a run. Wall time is looked at only to know which tick is due."""

    def __init__(self, run: Run, now: Callable[[], float] = time.monotonic) -> None:
        self._run = run
        self._now = now
        self._replay = Replay(run)
        self._links = LinkLog(run)
        self._hindsight = Hindsight(run, _key_of(run))
        # With a direct radio nobody knows who heard what.
        self._direct = run.prepared.scenario.radio.via == "direct"
        self._layers: tuple[Layer, ...] = ("truth", *(() if self._direct else run.numbers))
        self._changed = threading.Condition()
        self._k = 0
        self._place = 0.0
        """Where the play is, in ticks, between two of them."""
        self._asked_at = now()
        self._running = False
        self._pace = 1.0
        self._told: tuple[int, bool, float] | None = None
        self._lacks_links = False
        """The last state had no links, as the journal was not read that far."""
        self._at = 0
        self._shown: deque[tuple[float, int]] = deque()

    def static(self) -> Static:
        """See `Source`."""
        run = self._run
        scenario, terrain = run.prepared.scenario, run.prepared.terrain
        specs = {spec.number: spec for spec in scenario.roster}
        shape = (scenario.sensor.range, scenario.sensor.angle)
        return Static(
            name=run.folder.name or run.title,
            scenario=run.journal.header.scenario,
            passable=terrain.passable,
            patrolled=run.prepared.patrolled,
            point=terrain.point,
            origin=terrain.origin,
            robots=tuple(
                RobotShape(facts.number, facts.name, facts.model, specs[facts.number].radius, *shape)
                for facts in run.robots
            ),
            step=run.step,
            ticks=run.ticks,
            bound_s=run.journal.header.bound_s,
            live=False,
            layers=self._layers,
            controls=("pause", "go", "step", "pace", "seek"),
            note="" if run.ended is not None else "this run was cut off, or goes on; what there is of it is shown",
            direct=self._direct,
        )

    def wait(self, timeout_s: float) -> State | None:
        """See `Source`; a state at most each `SHOW_S`, and once more where its links took a while to read."""
        until, rate = self._now() + timeout_s, 0.0
        while True:
            found = self._lacks_links and self._links.reach(self._at)
            with self._changed:
                self._advance()
                now = self._now()
                new = (self._k, self._running, self._pace)
                news = found or new != self._told
                due = (self._shown[-1][0] + SHOW_S if self._shown else now) - now
                if news and due <= 0.0:
                    self._told = new
                    self._at = self._k
                    rate = self._rate(now)
                    break
                left = until - now
                if left <= 0.0:
                    return None
                if found or not self._lacks_links:
                    self._changed.wait(min(left, max(due, 0.002)) if self._running or news else left)
        return self._state(*new, rate)

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """See `Source`; what a robot believed takes a while to find out."""
        if layer not in self._layers:
            return None
        if isinstance(layer, int):
            return self._hindsight.last_seen(layer, self._at)
        return self._replay.fog(self._at).last_seen

    def since(self, layer: Layer) -> int:  # noqa: ARG002 - a run is known from its beginning
        """See `Source`."""
        return 0

    def tick(self, layer: Layer) -> int:  # noqa: ARG002 - a replay shows no fog of another moment
        """See `Source`."""
        return self._at

    def keep(self, layers: Collection[Layer]) -> None:
        """See `Source`."""
        self._hindsight.keep([layer for layer in layers if isinstance(layer, int)])

    def trail(self, first: int, last: int) -> NDArray[np.float64]:
        """See `Source`."""
        poses = self._run.poses[first : last + 1, :, :2].astype(np.float64)
        poses[np.isin(self._run.status[first : last + 1], _NO_BODY)] = np.nan
        return poses

    def series(self, after: int) -> Series:
        """See `Source`."""
        run, first = self._run, max(after + 1, 0)
        ticks = np.arange(first, run.ticks, dtype=np.int64)
        mfow_s = run.mfow[first:].astype(np.float64) * run.step
        return Series(ticks, mfow_s, run.fog_mean[first:] * run.step)

    def events(self, since: int) -> Sequence[Event]:
        """See `Source`; those of the whole run, also those to come."""
        return self._run.events[since:]

    def ask(self, control: Mapping[str, Any]) -> Answer:
        """See `Source`."""
        with self._changed:
            self._advance()
            answer = self._obey(control)
            self._changed.notify_all()
        return answer

    def close(self) -> None:
        """See `Source`."""

    def _obey(self, control: Mapping[str, Any]) -> Answer:
        match control:
            case {"do": "pause"}:
                self._running = False
            case {"do": "go"}:
                if self._pace > 0.0 and self._k >= self._run.ticks - 1:
                    self._place = 0.0
                self._running = True
            case {"do": "step"}:
                self._running = False
                self._go_to(self._k + (1 if self._pace > 0.0 else -1))
            case {"do": "pace", "factor": int() | float() as factor} if 0.0 < abs(factor) <= FASTEST:
                self._pace = float(factor)
            case {"do": "seek", "k": int() as k} if not isinstance(k, bool):
                self._go_to(k)
            case {"do": str() as what}:
                return Answer(False, f"{what[:40]}: a replay pauses, goes on, steps, seeks and changes its pace")
            case _:
                return Answer(False, "a control says what to do")
        return Answer(True)

    def _go_to(self, k: int) -> None:
        self._k = min(max(k, 0), self._run.ticks - 1)
        self._place = float(self._k)

    def _advance(self) -> None:
        """Move on by the wall time that has gone by."""
        now = self._now()
        gone, self._asked_at = now - self._asked_at, now
        if not self._running:
            return
        self._place += gone * self._pace / self._run.step
        last = self._run.ticks - 1
        if not 0.0 <= self._place < last:
            self._place = min(max(self._place, 0.0), float(last))
            self._running = False
        self._k = int(self._place)

    def _rate(self, now: float) -> float:
        """Ticks per wall second, lately."""
        while self._shown and self._shown[0][0] < now - _RATE_S:
            self._shown.popleft()
        since, before = self._shown[0] if self._shown else (now, self._k)
        self._shown.append((now, self._k))
        return abs(self._k - before) / (now - since) if self._running and now > since else 0.0

    def _state(self, k: int, running: bool, pace: float, rate: float) -> State:
        run = self._run
        links = None if self._direct else self._links.at(k)
        self._lacks_links = links is None and not self._direct
        robots = []
        for place, number in enumerate(run.numbers):
            x, y, heading = run.poses[k, place].tolist()
            to_x, to_y = run.goals[k, place].tolist()
            took, status = float(run.decision_ms[k, place]), Status(int(run.status[k, place]))
            robots.append(
                RobotState(
                    number=number,
                    status=status,
                    state=run.labels[run.states[k, place]],
                    pose=None if status in _NO_BODY else Pose(x, y, heading),
                    goal=None if np.isnan(to_x) or status is not Status.ALIVE else (to_x, to_y),
                    decision_ms=None if np.isnan(took) else took,
                    heard_s=None if links is None else _since(int(links.heard[place].max()), k, run.step),
                )
            )
        return State(
            k=k,
            time_s=k * run.step,
            running=running,
            pace=pace,
            ticks_per_s=rate,
            robots=tuple(robots),
            mfow_s=float(run.mfow[k]) * run.step,
            fog_mean_s=float(run.fog_mean[k]) * run.step,
            links=links,
            intruders=tuple(
                intruder.place for intruder in run.prepared.scenario.intruders if intruder.is_there(k * run.step)
            ),
        )


def open_player(folder: Path) -> Player:
    """A player of the run in a folder; BadInput where there is none."""
    from monitor.replay.run import open_run

    return Player(open_run(folder))


def _since(tick: int, k: int, step: float) -> float | None:
    return None if tick < 0 else (k - tick) * step


def _key_of(run: Run) -> bytes | None:
    """The fleet's key, where it can still be read; without it frames are believed untested."""
    try:
        return fleet_key(run.prepared.scenario.radio.key)
    except BadInput:
        return None
