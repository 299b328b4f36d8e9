"""A recording read again: what is in it, whether it is whole, and a whole copy of what there is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monitor.replay.run_files import JOURNAL
from patrol.errors import BadInput

if TYPE_CHECKING:
    from mcap.writer import Writer

METADATA = "fogwatch"
"""The name of the metadata by which a recording of ours is known."""


@dataclass
class Contents:
    """What a recording holds.

    facts: its metadata. messages: by topic. begin_s, end_s: of its messages. why_cut: why it ends early, empty for a
    whole file.
    """

    facts: Mapping[str, str] = field(default_factory=dict)
    messages: Counter[str] = field(default_factory=Counter)
    begin_s: float = 0.0
    end_s: float = 0.0
    why_cut: str = ""


def inspect_recording(path: Path, repaired: Path | None = None) -> Contents:
    """Read a recording through, testing its checksums.

    repaired: where to write a whole copy of what can be read. BadInput for a file that is no MCAP, that somebody else
    wrote, or that cannot be read or written, and where mcap is missing.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise BadInput("recordings need mcap; install it with: pip install 'fogwatch[monitor]'") from None
    if repaired is not None and repaired.exists():
        raise BadInput(f"{repaired}: is there already; name a new file")
    contents = Contents()
    if repaired is None:
        _read(path, contents, None)
        return contents
    try:
        with repaired.open("xb") as file:
            copy = _Copy(Writer(file))
            _read(path, contents, copy.take)
            copy.finish()
    except OSError as error:
        raise BadInput(f"{repaired}: cannot be written ({error.strerror}); choose another file") from None
    except BadInput:
        repaired.unlink(missing_ok=True)
        raise
    return contents


def _read(path: Path, contents: Contents, take: Callable[[Any], None] | None) -> None:
    from mcap.records import Channel, Message, Metadata

    topics: dict[int, str] = {}
    first = True
    for record in _records(path, contents):
        match record:
            case Metadata() if record.name == METADATA:
                contents.facts = dict(record.metadata)
            case Channel():
                topics[record.id] = record.topic
            case Message() if record.channel_id in topics:
                contents.messages[topics[record.channel_id]] += 1
                at = record.log_time / 1e9
                contents.begin_s, first = (at, False) if first else (contents.begin_s, False)
                contents.end_s = at
        if take is not None:
            take(record)
    if contents.why_cut and not contents.messages:
        again = f"record again: fogwatch record {path.parent}" if (path.parent / JOURNAL).is_file() else "record again"
        raise BadInput(f"{path}: is cut off before its first message; there is nothing to save, so {again}")
    if not contents.facts:
        raise BadInput(
            f"{path}: is an MCAP file, but not one of fogwatch: it has no metadata '{METADATA}'; name one that has"
        )


def _records(path: Path, contents: Contents) -> Iterator[Any]:
    """All records up to the first that is cut off or damaged."""
    from mcap.stream_reader import StreamReader

    begun = False
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, validate_crcs=True).records:
                begun = True
                yield record
    except IsADirectoryError:
        raise BadInput(f"{path}: is a folder; name a file, such as {path / 'recording.mcap'}") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); name a recording.mcap") from None
    except Exception as error:  # noqa: BLE001 - what a damaged file makes of the reader is anybody's guess
        if not begun:
            raise BadInput(
                f"{path}: is no MCAP file, or is cut off before its first record; name a recording.mcap"
            ) from None
        contents.why_cut = f"after {contents.end_s:g} s ({type(error).__name__})"


class _Copy:
    """Writes what is taken into a new file."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schemas: dict[int, int] = {}
        self._channels: dict[int, int] = {}

    def take(self, record: Any) -> None:
        """Copy a record; those that only index others are made anew."""
        from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema

        writer = self._writer
        match record:
            case Header():
                writer.start(record.profile, record.library)
            case Schema() if record.id not in self._schemas:
                self._schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            case Channel() if record.id not in self._channels and record.schema_id in self._schemas:
                what = (record.topic, record.message_encoding, self._schemas[record.schema_id], record.metadata)
                self._channels[record.id] = writer.register_channel(*what)
            case Message() if record.channel_id in self._channels:
                channel = self._channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case Attachment():
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)

    def finish(self) -> None:
        """Nothing more comes."""
        self._writer.finish()  # type: ignore[no-untyped-call]
