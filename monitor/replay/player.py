"""The source for a finished run: plays it at any speed, forwards and backwards."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.observation.source import Answer, Layer, RobotShape, RobotState, Series, Source, State, Static, TickRate
from monitor.replay.past_beliefs import PastBeliefs
from monitor.replay.replay import Replay
from monitor.replay.run import Run
from monitor.replay.run_log import RunLog
from patrol.journal.records import Event, Status
from patrol.pose import Pose
from patrol.scenario.controls import in_force, intruders_there
from patrol.scenario.marks import looks_at

SHOW_S = 1.0 / 30.0
"""Least wall time between two states, s."""

FASTEST = 1000.0
"""Largest pace, as a factor of real time."""

PACES = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
WHOLE_S = 90.0
"""A run that plays by itself does so at the slowest of these paces that shows it within this wall time, s."""

_NO_BODY = (Status.ABSENT, Status.LEFT)


class Player(Source):
    """A `monitor.observation.source.Source` that plays a run. The wall clock only decides which tick is due."""

    def __init__(self, run: Run, now: Callable[[], float] = time.monotonic, *, autoplay: bool = False) -> None:
        """Start at tick 0, paused.

        With `autoplay` it plays as soon as a page is open, unless a control comes before.
        """
        self._run = run
        self._now = now
        self._replay = Replay(run)
        self._log = RunLog(run)
        self._past_beliefs = PastBeliefs(run, run.key, now)
        self._planned = len(run.journal.header.scenario.get("faults") or ())
        # With a direct radio it is unknown which frames each robot heard.
        self._direct = run.prepared.scenario.radio.via == "direct"
        self._layers: tuple[Layer, ...] = ("truth", *(() if self._direct else run.numbers))
        self._changed = threading.Condition()
        self._k = 0
        self._place = 0.0
        """Position in ticks, with fractions."""
        self._asked_at = now()
        self._running = False
        self._autoplay = autoplay
        whole_s = run.ticks * run.step
        # For example, a run of 600 s plays at a pace of 10, within 60 s.
        self._pace = next((pace for pace in PACES if whole_s <= pace * WHOLE_S), PACES[-1]) if autoplay else 1.0
        self._returned: tuple[int, bool, float] | None = None
        self._is_ahead = False
        """True if the last state had no links and traps because the journal was not read that far."""
        self._at = 0
        self._shown_at: float | None = None
        self._rate = TickRate()

    def static(self) -> Static:
        """See `Source`."""
        run = self._run
        return Static(
            name=run.folder.name or run.title,
            scenario=run.journal.header.scenario,
            terrain=run.prepared.terrain,
            patrolled=run.prepared.patrolled,
            robots=tuple(
                replace(robot, spare=False)
                for robot in RobotShape.all_of(run.prepared.scenario)
                if robot.number in run.index
            ),
            step=run.step,
            ticks=run.ticks,
            bound_s=run.journal.header.bound_s,
            live=False,
            layers=self._layers,
            controls=("pause", "go", "step", "pace", "seek"),
            note="" if run.ended is not None else "the journal has no end: the run was cut off or is still running",
            direct=self._direct,
        )

    def wait(self, timeout_s: float) -> State | None:
        """See `Source`; one state per `SHOW_S` at most, and another one when its links or traps took longer to read."""
        until, rate = self._now() + timeout_s, 0.0
        while True:
            self._log.read()
            arrived = self._is_ahead and self._log.at(self._at) is not None
            with self._changed:
                self._advance_ticks()
                now = self._now()
                new = (self._k, self._running, self._pace)
                news = arrived or new != self._returned
                wait_s = (now if self._shown_at is None else self._shown_at + SHOW_S) - now
                if news and wait_s <= 0.0:
                    self._returned = new
                    self._at, self._shown_at = self._k, now
                    rate = abs(self._rate.at(now, self._k)) if self._running else 0.0
                    self._rate.add(now, self._k)
                    break
                remaining_s = until - now
                if remaining_s <= 0.0:
                    return None
                if arrived or self._log.done:
                    self._changed.wait(min(remaining_s, max(wait_s, 0.002)) if self._running or news else remaining_s)
        return self._make_state(*new, rate)

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """See `Source`; a robot's belief takes a while to compute."""
        if layer not in self._layers:
            return None
        if isinstance(layer, int):
            return self._past_beliefs.last_seen(layer, self._at)
        return self._replay.fog(self._at).last_seen

    def tick(self, layer: Layer) -> int:  # noqa: ARG002 - every fog is of the same tick
        """See `Source`."""
        return self._at

    def set_shown(self, layers: Collection[Layer]) -> None:
        """See `Source`; the first page that is open starts the run if it plays by itself."""
        if layers and self._autoplay:
            self.control({"do": "go"})
        self._past_beliefs.set_shown([layer for layer in layers if isinstance(layer, int)])

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
        """See `Source`; the events of the whole run, including those after the current tick, then those found here."""
        run = self._run.events
        return [*run[since:], *self._log.events[max(since - len(run), 0) :]]

    def control(self, control: Mapping[str, Any]) -> Answer:
        """See `Source`."""
        with self._changed:
            self._autoplay = False
            self._advance_ticks()
            answer = self._obey_control(control)
            self._changed.notify_all()
        return answer

    def read_all(self) -> None:
        """Read links and traps of the whole run at once; `wait` reads them in slices."""
        while not self._log.done:
            self._log.read()

    def _obey_control(self, control: Mapping[str, Any]) -> Answer:
        match control:
            case {"do": "pause"}:
                self._running = False
            case {"do": "go"}:
                # At the end, "go" means from the start again.
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
                return Answer(False, f"{what[:40]}: a replay accepts pause, go, step, pace and seek")
            case _:
                return Answer(False, 'a control needs the key "do"')
        return Answer(True)

    def _go_to(self, k: int) -> None:
        self._k = min(max(k, 0), self._run.ticks - 1)
        self._place = float(self._k)

    def _advance_ticks(self) -> None:
        """Advance by the wall time that has passed."""
        now = self._now()
        elapsed_s, self._asked_at = now - self._asked_at, now
        if not self._running:
            return
        self._place += elapsed_s * self._pace / self._run.step
        last = self._run.ticks - 1
        if not 0.0 <= self._place < last:
            self._place = min(max(self._place, 0.0), float(last))
            self._running = False
        self._k = int(self._place)

    def _make_state(self, k: int, running: bool, pace: float, rate: float) -> State:
        run = self._run
        links = None if self._direct else self._log.links.at(k)
        trapped = self._log.at(k)
        self._is_ahead = trapped is None
        robots = []
        for index, number in enumerate(run.numbers):
            x, y, heading = run.poses[k, index].tolist()
            to_x, to_y = run.goals[k, index].tolist()
            took, charge = float(run.decision_ms[k, index]), float(run.charge[k, index])
            status = Status(int(run.status[k, index]))
            robots.append(
                RobotState(
                    number=number,
                    status=status,
                    state=run.labels[run.states[k, index]],
                    pose=None if status in _NO_BODY else Pose(x, y, heading),
                    goal=None if np.isnan(to_x) or status is not Status.ALIVE else (to_x, to_y),
                    decision_ms=None if np.isnan(took) else took,
                    heard_s=None if links is None else _seconds_since(int(links.heard[index].max()), k, run.step),
                    trapped=None if trapped is None else trapped.get(number),
                    charge=None if np.isnan(charge) else charge,
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
            intruders=intruders_there(run.prepared.scenario, k),
            faults=in_force(run.prepared.scenario, k, self._planned),
            looks=looks_at(run.prepared.scenario, k, run.closings),
        )


def open_player(folder: Path, key: Path | None = None) -> Player:
    """Open a run at tick 0; it plays as soon as a page is open.

    `key` is the file of the fleet's key; None leaves the tags of messages unchecked.
    """
    from monitor.replay.run import open_run

    return Player(open_run(folder, key), autoplay=True)


def _seconds_since(tick: int, k: int, step: float) -> float | None:
    return None if tick < 0 else (k - tick) * step
