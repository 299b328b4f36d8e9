"""Writes an MCAP file of ROS 2 messages: CDR with ros2msg schemas, in chunks with checksums."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.recording import ros_messages as ros
from patrol.errors import BadInput

if TYPE_CHECKING:
    import numpy as np
    from mcap.writer import Writer
    from numpy.typing import NDArray

    from patrol.pose import Pose

METADATA = "fogwatch"
"""Name of the metadata that marks a recording as one of fogwatch."""
PROFILE = "ros2"
_LEVELS = {"dead": ros.WARN, "fault": ros.WARN, "lost": ros.ERROR}


class RosFile:
    """An open recording. Times are ns since the beginning of the run."""

    def __init__(self, path: Path, name: Path, *, new: bool = False, chunk: int | None = None) -> None:
        """Create the file.

        `name` is the file's name in error messages. Only with `new` an existing file is refused. `chunk` is in bytes,
        None for mcap's default; a killed writer loses the last, incomplete chunk.
        """
        self.encoder = ros.Encoder()
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
        self._writer: Writer = Writer(self._file) if chunk is None else Writer(self._file, chunk_size=chunk)
        self._writer.start(PROFILE, f"fogwatch {version('fogwatch')}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequence: dict[int, int] = {}

    def facts(self, facts: Mapping[str, str]) -> None:
        """Write the metadata, which marks the file as a recording of fogwatch."""
        self._writer.add_metadata(METADATA, dict(facts))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def write(self, topic: str, kind: str, data: bytes, at: int) -> None:
        """Write a message."""
        channel = self._channels.get(topic)
        if channel is None:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", self.encoder.definition(kind))
            offered = {ros.QOS: ros.offered(topic)}
            channel = self._writer.register_channel(topic, "cdr", self._schemas[kind], offered)
            self._channels[topic] = channel
        sequence = self._sequence[channel] = self._sequence.get(channel, -1) + 1
        self._writer.add_message(channel, at, data, at, sequence)

    def number(self, topic: str, value: float, at: int) -> None:
        """Write a std_msgs/Float64."""
        self.write(topic, ros.NUMBER, self.encoder.number(value), at)

    def grid(self, topic: str, place: tuple[float, tuple[float, float]], values: NDArray[np.int8], at: int) -> None:
        """Write a nav_msgs/OccupancyGrid; `place` is the side of a point and the lower left corner, m."""
        self.write(topic, ros.GRID, self.encoder.grid(at, *place, values), at)

    def robots(self, robots: Iterable[tuple[str, float | None, Pose | None]], at: int) -> None:
        """Write the robots' decision times, ms, and poses, each by the robot's name in topics; None for unknown."""
        bodies = []
        for name, decision_ms, pose in robots:
            if decision_ms is not None:
                self.number(f"/{name}/decision_ms", decision_ms, at)
            if pose is not None:
                position = (pose.x, pose.y, pose.heading)
                bodies.append((name, *position))
                self.write(f"/{name}/pose", ros.POSE, self.encoder.pose(at, *position), at)
        self.write("/tf", ros.TRANSFORMS, self.encoder.transforms(at, bodies), at)

    def log(self, name: str, text: str, at: int, level: int = ros.INFO) -> None:
        """Write a line of the log /rosout."""
        self.write("/rosout", ros.LOG, self.encoder.log(at, level, name, text), at)

    def event(self, kind: str, name: str, detail: str, at: int) -> None:
        """Write an event of the journal as a line of the log; `name` is the robot's, or ``run``."""
        self.log(name, f"{kind}: {detail}" if detail else kind, at, _LEVELS.get(kind, ros.INFO))

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
