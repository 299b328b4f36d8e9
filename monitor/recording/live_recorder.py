"""Records a running fleet from the source of a page, with the topics of `monitor.recording.run_recorder`.

Each state from the source is written when it arrives. Without a world that is every tick, with the poses that the
robots report. A world's feed gives about twenty states a second, but MFoW and mean fog for every tick.

The largest age is not known in advance, so the scale of /fog grows: /fog_scale, s, accompanies each grid. The topics
/seen_share and /delivered_share are missing. Chunks are small and flushed at once: a killed recorder loses only the
last few seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from monitor.observation.source import Source, State
from monitor.recording.ros_file import KEY_FRAME_S, WITH_BODY, RosFile
from monitor.replay.run_files import SCENARIO
from patrol.files.whole_file import writing
from patrol.ground.fog import Fog
from patrol.journal.records import Status
from patrol.scenario import dump_scenario, load_scenario

CHUNK = 4096
"""Bytes of a chunk before compression."""

REMAINS = "what is recorded so far remains"
"""The end of the message that a recording cannot go on."""

LEAST_SCALE_S = 10.0
WAIT_S = 0.2
GONE_S = 10.0
"""Longest wait for a world that has disconnected, s of wall time; enough for a restart of its router."""


class LiveRecorder:
    """Writes the states of a source; close() completes the file."""

    def __init__(self, source: Source, out: Path, started: str) -> None:
        """Create the file, which must not exist yet; `started` is wall time as ISO 8601 text."""
        static = source.static()
        self._source = source
        self._static = static
        self._out = out
        self._bodies = WITH_BODY if static.has_truth else (Status.ALIVE,)
        self._every = max(1, round(KEY_FRAME_S / static.step))
        self._scale_s = LEAST_SCALE_S
        self._series_k = self._robots_k = -1
        self._events = 0
        self._grid_k = -self._every
        self.last: State | None = None
        names, place = (
            {robot.number: robot.name for robot in static.robots},
            (static.terrain.point, static.terrain.origin),
        )
        self._file = RosFile(out, out, names, static.step, place, new=True, chunk=CHUNK)
        self._file.facts(
            scenario=str(static.scenario["name"]),
            fleet=static.name,
            started=started,
            ended="recorded while it was running",
            told_by="its world" if static.has_truth else "its robots' positions",
            fog_scale_s="given by /fog_scale",
        )
        text = dump_scenario(load_scenario(static.scenario))
        self._file.attach(SCENARIO, "application/yaml", text.encode())
        self._file.flush()

    def write(self, state: State) -> None:
        """Write a state, which must be later than those before."""
        with writing(self._out, REMAINS):
            self._write_state(state)
            self._file.flush()

    def close(self) -> None:
        """Write the last grid and the index."""
        with writing(self._out, REMAINS):
            if self.last is not None:
                self._write_grid(self.last)
            self._file.finish()

    def _write_state(self, state: State) -> None:
        if self.last is None:
            self._begin_recording(state)
        series = self._source.series(self._series_k)
        for k, mfow_s, mean_s in zip(series.ticks.tolist(), series.mfow_s, series.fog_mean_s, strict=True):
            self._series_k = k
            # Doubled, so that the scale changes seldom and older grids stay readable.
            while self._scale_s < mfow_s:
                self._scale_s *= 2.0
            self._file.measures(k, mfow_s, mean_s)
        for event in self._source.events(self._events):
            self._events += 1
            self._file.event(event)
        # States may repeat a tick, such as when only the pace has changed.
        if state.robots and state.k > self._robots_k:
            self._robots_k = state.k
            rows = [(robot.decision_ms, robot.pose if robot.status in self._bodies else None) for robot in state.robots]
            self._file.robots(rows, state.k)
            self._file.number("/alive", sum(robot.status is Status.ALIVE for robot in state.robots), state.k)
        if state.k >= self._grid_k + self._every:
            self._write_grid(state)
        self.last = state

    def _begin_recording(self, state: State) -> None:
        """Write the constant facts, and skip events before the first state."""
        self._series_k = state.k - 1
        self._events = sum(event.k < state.k for event in self._source.events(0))
        self._file.ground(self._static.terrain.passable, state.k, "/fog_scale seconds", self._static.note)

    def _write_grid(self, state: State) -> None:
        static = self._static
        last_seen = self._source.last_seen(static.layers[0])
        if last_seen is None or state.k == self._grid_k:
            return
        self._grid_k = state.k
        self._file.number("/fog_scale", self._scale_s, state.k)
        self._file.fog(Fog.resumed(static.patrolled, last_seen), state.k, self._scale_s)


def record_live(
    source: Source,
    out: Path,
    started: str,
    stop: Callable[[], bool],
    say: Callable[[str], None],
    now: Callable[[], float] = time.monotonic,
) -> State | None:
    """Record a source until its run ends, its world has disconnected, or `stop` says so.

    The last state is returned, None if there was none. `out` must not exist yet. `started` is wall time as ISO 8601
    text, and `say` is called with a line for the operator when the source's note changes.
    """
    recorder = LiveRecorder(source, out, started)
    note = ""
    gone_at: float | None = None
    while not stop():
        state = source.wait(WAIT_S)
        if state is not None:
            recorder.write(state)
            if state.note != note:
                note = state.note
                say(note or "receiving data again")
            if state.ended is not None:
                break
            gone_at = (now() if gone_at is None else gone_at) if state.gone else None
        if gone_at is not None and now() >= gone_at + GONE_S:
            say(f"the world was disconnected for {GONE_S:g} s; the recording ends")
            break
    recorder.close()
    return recorder.last
