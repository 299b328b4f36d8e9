"""An MCAP file of ROS 2 messages while it is written: CDR with ros2msg schemas, in chunks with checksums."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.recording import ros_messages as ros
from monitor.recording.mcap_file import METADATA
from patrol.errors import BadInput

if TYPE_CHECKING:
    from mcap.writer import Writer

PROFILE = "ros2"
_TROUBLE = {"dead": ros.WARN, "fault": ros.WARN, "lost": ros.ERROR}


class RosFile:
    """Takes messages by topic; times are ns since the recording's zero.

    path: where it is written. called: what errors call it. new: refuse a file that is there. chunk: bytes of a chunk;
    what is in none yet is lost when the writer is killed. BadInput where mcap or rosbags is missing or the file cannot
    be written.
    """

    def __init__(self, path: Path, called: Path, *, new: bool = False, chunk: int | None = None) -> None:
        self.encoder = ros.Encoder()
        try:
            from mcap.writer import Writer
        except ImportError:
            raise BadInput("recordings need mcap; install it with: pip install 'fogwatch[monitor]'") from None
        try:
            self._file = path.open("xb" if new else "wb")
        except FileExistsError:
            raise BadInput(f"{called}: is there already; name a new file") from None
        except OSError as error:
            raise BadInput(f"{called}: cannot be written ({error.strerror}); choose another file") from None
        self._writer: Writer = Writer(self._file) if chunk is None else Writer(self._file, chunk_size=chunk)
        self._writer.start(PROFILE, f"fogwatch {version('fogwatch')}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequence: dict[int, int] = {}

    def facts(self, says: Mapping[str, str]) -> None:
        """What the recording is of, by which it is known as one of ours."""
        self._writer.add_metadata(METADATA, dict(says))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """A file that belongs to the recording."""
        self._writer.add_attachment(0, 0, name, media_type, data)

    def write(self, topic: str, kind: str, data: bytes, at: int) -> None:
        """A message of a type in `monitor.recording.ros_messages`."""
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
        """A std_msgs/Float64."""
        self.write(topic, ros.NUMBER, self.encoder.number(value), at)

    def say(self, name: str, text: str, at: int, level: int = ros.INFO) -> None:
        """A line of the log."""
        self.write("/rosout", ros.LOG, self.encoder.log(at, level, name, text), at)

    def event(self, kind: str, name: str, detail: str, at: int) -> None:
        """One of a journal's events as a line of the log. name: of whom it befalls."""
        self.say(name, f"{kind}: {detail}" if detail else kind, at, _TROUBLE.get(kind, ros.INFO))

    def flush(self) -> None:
        """Hand the whole chunks to the system, which keeps them whatever becomes of this process."""
        self._file.flush()

    def finish(self) -> None:
        """Nothing more comes: write the index. OSError where that cannot be."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()

    def drop(self) -> None:
        """Close the file as it is."""
        self._file.close()
