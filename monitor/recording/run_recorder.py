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
from collections import deque
from contextlib import suppress
from pathlib import Path

import numpy as np

from monitor.recording import ros_messages as ros
from monitor.recording.ros_file import KEY_FRAME_S, WITH_BODY, RosFile
from monitor.replay.replay import Watcher
from monitor.replay.run import Run
from monitor.replay.run_files import RECORDING, SCENARIO, check_out
from patrol.errors import BadInput
from patrol.files.untrusted import SCENARIO as SCENARIO_FILE
from patrol.files.untrusted import read_untrusted
from patrol.ground.fog import Fog
from patrol.journal.records import Status
from patrol.pose import Pose

GRID_MEMORY = 2 << 30
"""Most bytes of all grids before compression; a longer run has fewer key frames."""

CHUNK = 1 << 15
"""Bytes of a chunk before compression: the most that a file loses when it is cut off."""


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
        terrain = run.prepared.terrain
        names, place = dict(zip(run.numbers, run.names, strict=True)), (terrain.point, terrain.origin)
        self._file = RosFile(self._part, out, names, run.step, place, chunk=CHUNK)
        self._scale_s = scale_of(run)
        self._every = key_frame_ticks(run)
        self._area = int(np.count_nonzero(run.prepared.patrolled))
        self._events = deque(run.events)
        self._begin_recording()

    def after(self, k: int, fog: Fog) -> None:
        """See `Watcher`; writes the tick."""
        run, file = self._run, self._file
        while self._events and self._events[0].k <= k:
            file.event(self._events.popleft())
        if k % self._every == 0 or k == run.ticks - 1:
            file.fog(fog, k, self._scale_s)
        took_ms = (None if math.isnan(ms) else ms for ms in run.decision_ms[k].tolist())
        status = zip(run.status[k].tolist(), run.poses[k].tolist(), strict=True)
        poses = (Pose(*pose) if of_robot in WITH_BODY else None for of_robot, pose in status)
        file.robots(zip(took_ms, poses, strict=True), k)
        file.measures(k, run.mfow[k] * run.step, run.fog_mean[k] * run.step)
        file.number("/seen_share", run.seen[k] / self._area, k)
        file.number("/alive", int(np.count_nonzero(run.status[k] == Status.ALIVE)), k)
        delivered, dropped = int(run.links.delivered_in[k]), int(run.links.dropped_in[k])
        if delivered + dropped:
            file.number("/delivered_share", delivered / (delivered + dropped), k)

    def close(self) -> None:
        """Complete the file and give it its name."""
        for event in self._events:
            self._file.event(event)
        if self._run.ended is None:
            self._file.log("run", "the journal is cut off here", self._run.ticks, ros.WARN)
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
        self._file.facts(
            scenario=run.title,
            scenario_hash=header.scenario_hash,
            software=header.software,
            started=header.started or "",
            ended=run.ended or "cut off",
            fog_scale_s=f"{self._scale_s:g}",
            ticks=str(run.ticks),
        )
        with suppress(OSError):
            self._file.attach(SCENARIO, "application/yaml", read_untrusted(run.folder / SCENARIO, SCENARIO_FILE))
        self._file.ground(run.prepared.terrain.passable, 0, f"{self._scale_s:g} s")


def scale_of(run: Run) -> float:
    """Return the age that /fog shows as 100: the run's largest MFoW, s."""
    return max(float(run.mfow.max()), 1.0) * run.step


def key_frame_ticks(run: Run) -> int:
    """Return the number of ticks between two grids of a run."""
    wanted = max(1, round(KEY_FRAME_S / run.step))
    # A grid has a byte for each point; the first and the last tick have one in any case.
    affordable = max(2, GRID_MEMORY // run.prepared.patrolled.size)
    return max(wanted, -(-run.ticks // affordable))
