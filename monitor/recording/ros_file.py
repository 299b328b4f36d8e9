"""Writes a recording: an MCAP file of ROS 2 messages, CDR with ros2msg schemas, in chunks with checksums.

`monitor.recording.run_recorder` lists the topics. Robots keep their names as far as ROS allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from monitor.recording import ros_messages as ros
from patrol.errors import BadInput
from patrol.ground.fog import Fog
from patrol.journal.records import Event, Status

if TYPE_CHECKING:
    from mcap.writer import Writer

    from patrol.pose import Pose

METADATA = "fogwatch"
"""Name of the metadata that marks a recording as one of fogwatch."""
PROFILE = "ros2"
_LEVELS = {"dead": ros.WARN, "fault": ros.WARN, "lost": ros.ERROR}

KEY_FRAME_S = 10.0
"""Simulated time between two grids, s."""

WITH_BODY = (Status.ALIVE, Status.PAUSED, Status.DEAD, Status.LOST)
"""Status of robots whose bodies are on the terrain."""

RESERVED_NAMES = frozenset(
    {ros.FRAME, "fog", "fog_scale", "fog_mean", "tf", "mfow", "seen_share", "alive", "delivered_share", "rosout"}
    | {"recording", "run"}
)
"""Names that no robot may have in a recording: the map's frame, topics, and other loggers."""


class RosFile:
    """An open recording. `k` is the tick of what is written."""

    def __init__(
        self,
        path: Path,
        name: Path,
        robots: Mapping[int, str],
        step: float,
        place: tuple[float, tuple[float, float]],
        *,
        chunk: int,
        new: bool = False,
    ) -> None:
        """Create the file.

        `name` is the file's name in error messages. `robots` has the robots' names by number, in the order of their
        places, and `place` the side of a point and the lower left corner of the grids, m. Only with `new` an existing
        file is refused. `chunk` is in bytes; a killed writer loses the last, incomplete chunk.
        """
        self._robots = robots
        self._step = step
        self._place = place
        self._ros_names = dict(zip(robots, ros_names(robots.values()), strict=True))
        self._encoder = ros.Encoder()
        try:
            from mcap.writer import Writer
        except ImportError:
            raise BadInput("recordings need mcap; install it with: pip install 'fogwatch[monitor]'") from None
        try:
            self._file = path.open("xb" if new else "wb")
        except FileExistsError:
            raise BadInput(f"{name}: exists already; name a new file") from None
        except OSError as error:
            raise BadInput(f"{name}: cannot be written ({error.strerror}); choose another file") from None
        self._writer: Writer = Writer(self._file, chunk_size=chunk)
        self._writer.start(PROFILE, f"fogwatch {version('fogwatch')}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequence: dict[int, int] = {}

    def facts(self, **facts: str) -> None:
        """Write the metadata, which marks the file as a recording of fogwatch."""
        own = {"step_s": f"{self._step:g}", "robots": " ".join(self._robots.values())}
        self._writer.add_metadata(METADATA, facts | own)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def ground(self, passable: NDArray[np.bool_], k: int, scale: str, note: str = "") -> None:
        """Write the map, and a line of the log about the grids; `scale` is the age that they show as 100."""
        self._write_grid("/map", wall_values(passable), k)
        text = f"/fog: 0 means seen now, 100 means seen {scale} ago or earlier, -1 means not patrolled"
        self.log("recording", " · ".join(filter(None, (text, note))), k)

    def fog(self, fog: Fog, k: int, scale_s: float) -> None:
        """Write the fog; `scale_s` is the age that it shows as 100, s."""
        self._write_grid("/fog", grid_values(fog, k, scale_s / self._step), k)

    def measures(self, k: int, mfow_s: float, mean_s: float) -> None:
        """Write the measures of a tick."""
        self.number("/mfow", mfow_s, k)
        self.number("/fog_mean", mean_s, k)

    def number(self, topic: str, value: float, k: int) -> None:
        """Write a std_msgs/Float64."""
        self._write_message(topic, ros.NUMBER, self._encoder.number(value), k)

    def robots(self, robots: Iterable[tuple[float | None, Pose | None]], k: int) -> None:
        """Write the robots' decision times, ms, and poses, in the order of their places; None for unknown."""
        bodies, at = [], self._time_ns(k)
        for name, (decision_ms, pose) in zip(self._ros_names.values(), robots, strict=True):
            if decision_ms is not None:
                self.number(f"/{name}/decision_ms", decision_ms, k)
            if pose is not None:
                position = (pose.x, pose.y, pose.heading)
                bodies.append((name, *position))
                self._write_message(f"/{name}/pose", ros.POSE, self._encoder.pose(at, *position), k)
        self._write_message("/tf", ros.TRANSFORMS, self._encoder.transforms(at, bodies), k)

    def log(self, name: str, text: str, k: int, level: int = ros.INFO) -> None:
        """Write a line of the log /rosout."""
        self._write_message("/rosout", ros.LOG, self._encoder.log(self._time_ns(k), level, name, text), k)

    def event(self, event: Event) -> None:
        """Write an event of the journal as a line of the log."""
        text = f"{event.kind}: {event.detail}" if event.detail else event.kind
        name = self._ros_names.get(event.robot or 0, "run")
        self.log(name, text, event.k, _LEVELS.get(event.kind, ros.INFO))

    def flush(self) -> None:
        """Pass complete chunks to the operating system, which keeps them even if this process is killed."""
        self._file.flush()

    def finish(self) -> None:
        """Write the index and close the file; OSError is not turned into `BadInput` here."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()

    def drop(self) -> None:
        """Close the file without an index; what cannot be written any more is lost."""
        with suppress(OSError):
            self._file.close()

    def _write_grid(self, topic: str, values: NDArray[np.int8], k: int) -> None:
        self._write_message(topic, ros.GRID, self._encoder.grid(self._time_ns(k), *self._place, values), k)

    def _write_message(self, topic: str, kind: str, data: bytes, k: int) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", self._encoder.definition(kind))
            offered = {ros.QOS: ros.offered(topic)}
            channel = self._writer.register_channel(topic, "cdr", self._schemas[kind], offered)
            self._channels[topic] = channel
        sequence = self._sequence[channel] = self._sequence.get(channel, -1) + 1
        # Both of a message's times are simulated, so that recordings of equal runs are equal.
        self._writer.add_message(channel, self._time_ns(k), data, self._time_ns(k), sequence)

    def _time_ns(self, k: int) -> int:
        return round(k * self._step * 1e9)


def wall_values(passable: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Return the values of /map, int8 (h, w): 100 for impassable points, 0 for others."""
    return np.where(passable, np.int8(0), np.int8(100)).astype(np.int8)


def grid_values(fog: Fog, k: int, scale: float) -> NDArray[np.int8]:
    """Return the values of /fog at tick k, int8 (h, w).

    They go from 0 for an age of 0 to 100 for `scale` ticks or more; points that are not patrolled have -1.

    For example, with a scale of 200 ticks an age of 50 gives 25.
    """
    oldest = min(math.ceil(scale), k + 1)  # no age is greater at tick k, whatever scale the journal comes to
    by_age = np.minimum(np.rint(np.arange(oldest + 1) * (100.0 / scale)), 100.0).astype(np.int8)
    shown = np.full(fog.patrolled.shape, ros.UNKNOWN, dtype=np.int8)
    counted = fog.patrolled.view(np.bool_)
    shown[counted] = by_age.take(k - np.maximum(fog.last_seen[counted], 0), mode="clip")
    return shown


def ros_names(names: Iterable[str]) -> list[str]:
    """Convert robots' names into unique names for ROS topics.

    The names are ASCII and differ from each other and from `RESERVED_NAMES`.

    For example, "r-1" and "r_1" become "r_1" and "r_1_2", and "1st" becomes "robot_1st".
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
