"""Writes `recording.mcap`: a run in a format for robot viewers (Foxglove, Lichtblick, Rerun, PlotJuggler).

The messages are CDR with ros2msg schemas, in chunks with checksums. Times count from the beginning of the run.

    /map                 nav_msgs/OccupancyGrid       once: 100 for impassable points, 0 for others
    /fog                 nav_msgs/OccupancyGrid       key frames: age from 0 to 100 (the scale), -1 outside the area
    /tf                  tf2_msgs/TFMessage           each tick: all bodies present
    /<robot>/pose        geometry_msgs/PoseStamped    each tick in which the body is present
    /<robot>/decision_ms std_msgs/Float64             wall time of a decision
    /mfow, /fog_mean     std_msgs/Float64             each tick, s
    /seen_share, /alive  std_msgs/Float64             share of the patrolled area seen so far; number of living robots
    /delivered_share     std_msgs/Float64             share of the frames delivered or dropped in the tick
    /rosout              rcl_interfaces/Log           the journal's events

Robots keep their names as far as ROS allows. Channels contain the quality of service for rosbag2: /map is latched. The
file's metadata has the scenario's name and hash and the scale of /fog; the resolved scenario is attached.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from monitor.recording import ros_messages as ros
from monitor.recording.ros_file import RosFile
from monitor.replay.replay import Watcher
from monitor.replay.run import Run
from monitor.replay.run_files import RECORDING, SCENARIO, check_out
from patrol.errors import BadInput
from patrol.files.untrusted import SCENARIO as SCENARIO_FILE
from patrol.files.untrusted import read_untrusted
from patrol.ground.fog import Fog
from patrol.journal.records import Event, Status
from patrol.pose import Pose

KEY_FRAME_S = 10.0
"""Simulated time between two grids, s."""

GRID_MEMORY = 2 << 30
"""Most bytes of all grids before compression; a longer run has fewer key frames."""

CHUNK = 1 << 15
"""Bytes of a chunk before compression: the most that a file loses when it is cut off."""

WITH_BODY = (Status.ALIVE, Status.PAUSED, Status.DEAD, Status.LOST)
"""Status of robots whose bodies are on the terrain."""


RESERVED_NAMES = frozenset(
    {ros.FRAME, "fog", "fog_scale", "fog_mean", "tf", "mfow", "seen_share", "alive", "delivered_share", "rosout"}
    | {"recording", "run"}
)
"""Names that no robot may have in a recording: the map's frame, topics, and other loggers."""


class Recorder(Watcher):
    """Writes a recording while `monitor.replay.replay.play` replays the run; close() completes it.

    It writes to a temporary file, so a file with the final name is always complete.
    """

    def __init__(self, run: Run, out: Path) -> None:
        """Create the file."""
        check_out(out, RECORDING)
        self._run = run
        self._out = out
        self._part = out.with_name(f"{out.name}.part")
        with suppress(OSError):
            self._part.unlink()  # a stranger's folder may have a link there
        self._file = RosFile(self._part, out, chunk=CHUNK)
        self._place = run.prepared.terrain.point, run.prepared.terrain.origin
        self._ros_names = ros_names(run.names)
        self._scale_s = scale_of(run)
        self._every = key_frame_ticks(run)
        self._counted = run.prepared.patrolled
        self._area = int(np.count_nonzero(self._counted))
        self._events = {k: [e for e in run.events if e.k == k] for k in {event.k for event in run.events}}
        self._begin_recording()

    def after(self, k: int, fog: Fog) -> None:
        """See `Watcher`; writes the tick."""
        run, time_ns = self._run, self._time_ns(k)
        for event in self._events.get(k, ()):
            self._log_event(event)
        if k % self._every == 0 or k == run.ticks - 1:
            values = grid_values(fog, k, self._scale_s / run.step)
            self._file.grid("/fog", self._place, values, time_ns)
        robots = []
        for index, name in enumerate(self._ros_names):
            decision_ms = float(run.decision_ms[k, index])
            pose = Pose(*run.poses[k, index].tolist()) if run.status[k, index] in WITH_BODY else None
            robots.append((name, None if math.isnan(decision_ms) else decision_ms, pose))
        self._file.robots(robots, time_ns)
        self._file.number("/mfow", run.mfow[k] * run.step, time_ns)
        self._file.number("/fog_mean", run.fog_mean[k] * run.step, time_ns)
        self._file.number("/seen_share", run.seen[k] / self._area, time_ns)
        self._file.number("/alive", int(np.count_nonzero(run.status[k] == Status.ALIVE)), time_ns)
        delivered, dropped = int(run.links.delivered_in[k]), int(run.links.dropped_in[k])
        if delivered + dropped:
            self._file.number("/delivered_share", delivered / (delivered + dropped), time_ns)

    def close(self) -> None:
        """Complete the file and give it its name."""
        run = self._run
        for k in sorted(k for k in self._events if k >= run.ticks):
            for event in self._events[k]:
                self._log_event(event)
        time_ns = self._time_ns(run.ticks)
        if run.ended is None:
            self._file.log("run", "the journal is cut off here", time_ns, ros.WARN)
        try:
            self._file.finish()
            self._part.replace(self._out)
        except OSError as error:
            self.abandon()
            raise BadInput(f"{self._out}: cannot be written ({error.strerror}); choose another file") from None

    def abandon(self) -> None:
        """Delete the unfinished file."""
        self._file.drop()
        with suppress(OSError):
            self._part.unlink()

    def _begin_recording(self) -> None:
        run, header = self._run, self._run.journal.header
        facts = {
            "scenario": run.title,
            "scenario_hash": header.scenario_hash,
            "software": header.software,
            "started": header.started or "",
            "ended": run.ended or "cut off",
            "fog_scale_s": f"{self._scale_s:g}",
            "step_s": f"{run.step:g}",
            "ticks": str(run.ticks),
            "robots": " ".join(run.names),
        }
        self._file.facts(facts)
        with suppress(OSError):
            self._file.attach(SCENARIO, "application/yaml", read_untrusted(run.folder / SCENARIO, SCENARIO_FILE))
        self._file.grid("/map", self._place, wall_values(run.prepared.terrain.passable), 0)
        text = f"/fog: 0 means seen now, 100 means seen {self._scale_s:g} s ago or earlier, -1 means not patrolled"
        self._file.log("recording", text, 0)

    def _time_ns(self, k: int) -> int:
        return round(k * self._run.step * 1e9)

    def _log_event(self, event: Event) -> None:
        index = None if event.robot is None else self._run.index.get(event.robot)
        name = "run" if index is None else self._ros_names[index]
        self._file.event(event.kind, name, event.detail, self._time_ns(event.k))


def scale_of(run: Run) -> float:
    """Return the age that /fog shows as 100: the run's largest MFoW, s."""
    return max(float(run.mfow.max()), 1.0) * run.step


def key_frame_ticks(run: Run) -> int:
    """Return the number of ticks between two grids of a run."""
    wanted = max(1, round(KEY_FRAME_S / run.step))
    affordable = max(2, GRID_MEMORY // run.prepared.patrolled.size)
    return max(wanted, -(-run.ticks // affordable))


def wall_values(passable: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Return the values of /map, int8 (h, w): 100 for impassable points, 0 for others."""
    return np.where(passable, np.int8(0), np.int8(100)).astype(np.int8)


def grid_values(fog: Fog, k: int, scale: float) -> NDArray[np.int8]:
    """Return the values of /fog at tick k, int8 (h, w).

    They go from 0 for an age of 0 to 100 for `scale` ticks or more; points that are not patrolled have -1.
    """
    oldest = min(math.ceil(scale), k + 1)  # no age is greater at tick k, whatever scale the journal comes to
    by_age = np.minimum(np.rint(np.arange(oldest + 1) * (100.0 / scale)), 100.0).astype(np.int8)
    shown = np.full(fog.patrolled.shape, ros.UNKNOWN, dtype=np.int8)
    counted = fog.patrolled.view(np.bool_)
    shown[counted] = by_age.take(k - np.maximum(fog.last_seen[counted], 0), mode="clip")
    return shown


def ros_names(names: Sequence[str]) -> list[str]:
    """Convert robots' names into unique names for ROS topics.

    The names are ASCII and differ from each other and from `RESERVED_NAMES`.
    """
    converted: list[str] = []
    for name in names:
        plain = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)
        plain = f"robot_{plain}" if plain[0].isdigit() or plain in RESERVED_NAMES else plain
        unique, number = plain, 1
        while unique in converted:
            number += 1
            unique = f"{plain}_{number}"
        converted.append(unique)
    return converted
