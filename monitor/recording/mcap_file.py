"""Inspects recordings, and repairs those that were cut off."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from monitor.replay.run_files import JOURNAL
from patrol.errors import BadInput
from patrol.files.untrusted import MIB, RECORDING, open_untrusted

if TYPE_CHECKING:
    from mcap.stream_reader import StreamReader
    from mcap.writer import Writer

METADATA = "fogwatch"
"""Name of the metadata that marks a recording as one of fogwatch."""

MOST_RECORD = 64 * MIB
"""Bytes of the longest record, and of a chunk before compression; a grid of the largest terrain takes 50 MB."""
MOST_DAMAGED = 100
"""Number of damaged records after which the rest of a file is given up."""
NO_RECORD = 0
"""An opcode that no record has (MCAP's specification); zeros would be read as millions of empty records."""


@dataclass
class Contents:
    """The contents of a recording."""

    facts: Mapping[str, str] = field(default_factory=dict)
    messages: Counter[str] = field(default_factory=Counter)  # number of messages by topic
    begin_s: float = 0.0  # time of the first message
    end_s: float = 0.0  # time of the last message
    why_cut: str = ""  # where and why it ends early, or lacks something first; empty for a complete file
    damaged: int = 0  # number of damaged records that were passed over


def inspect_recording(path: Path, repaired: Path | None = None) -> Contents:
    """Read a whole recording and check its checksums.

    `repaired` is a new file for a complete copy of everything that can be read; None for no copy.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise BadInput("recordings need mcap; install it with: pip install 'fogwatch[monitor]'") from None
    if repaired is not None and repaired.exists():
        raise BadInput(f"{repaired}: exists already; name a new file")
    contents = Contents()
    if repaired is None:
        _read_contents(path, contents, None)
        return contents
    try:
        with repaired.open("xb") as file:
            copy = _Copy(Writer(file))
            _read_contents(path, contents, copy.write)
            copy.finish()
    except OSError as error:
        raise BadInput(f"{repaired}: cannot be written ({error.strerror}); choose another file") from None
    except BadInput:
        repaired.unlink(missing_ok=True)
        raise
    return contents


def _read_contents(path: Path, contents: Contents, write: Callable[[Any], None] | None) -> None:
    from mcap.records import Channel, Header, Message, Metadata, Schema

    topics: dict[int, str] = {}
    first = True
    # First what describes messages: it may be damaged where it comes first, and whole in the index at the end.
    described = [
        r for r in _read_records(path, Contents(), checks_all=False) if isinstance(r, Header | Schema | Channel)
    ]
    for record in chain(described, _read_records(path, contents)):
        match record:
            case Metadata() if record.name == METADATA:
                contents.facts = dict(record.metadata)
            case Channel():
                topics[record.id] = record.topic
            case Message() if record.channel_id in topics:
                contents.messages[topics[record.channel_id]] += 1
                time_s = record.log_time / 1e9
                contents.begin_s, first = (time_s, False) if first else (contents.begin_s, False)
                contents.end_s = time_s
        if write is not None:
            write(record)
    if contents.why_cut and not contents.messages:
        again = f"record again: fogwatch record {path.parent}" if (path.parent / JOURNAL).is_file() else "record again"
        raise BadInput(f"{path}: is damaged or cut off, no message in it is whole, nothing can be saved; {again}")
    if not contents.facts:
        raise BadInput(
            f"{path}: is an MCAP file, but not one of fogwatch (it has no metadata '{METADATA}'); name a recording.mcap"
        )


def _read_records(path: Path, contents: Contents, checks_all: bool = True) -> Iterator[Any]:
    """Yield all records that are whole, but for those behind one of a damaged length.

    Where the checksum of all records before the index is wrong, they end there, unless it is not checked.
    """
    begun = False
    try:
        with open_untrusted(path, RECORDING) as file:
            for record in make_reader(file, checks_all, partial(_note_damage, contents)).records:
                begun = True
                yield from _whole_records(record, contents)
    except IsADirectoryError:
        raise BadInput(f"{path}: is a folder; name a file, such as {path / 'recording.mcap'}") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); name a recording.mcap") from None
    except Exception as error:  # noqa: BLE001 - a damaged file may raise anything in the reader
        if not begun:
            raise BadInput(
                f"{path}: is not an MCAP file, or is cut off before its first record; name a recording.mcap"
            ) from None
        contents.why_cut = contents.why_cut or _why_damaged(contents, error)


def _whole_records(record: Any, contents: Contents) -> Iterator[Any]:
    """Yield the records in a record; of a damaged chunk none, or those before the damage."""
    try:
        yield from unpack_record(record)
    except Exception as error:  # noqa: BLE001 - as in `_read_records`
        _note_damage(contents, error)


def _note_damage(contents: Contents, error: Exception) -> None:
    """Count a damaged record; raise its error where there are too many to go on."""
    contents.why_cut = contents.why_cut or _why_damaged(contents, error)
    contents.damaged += 1
    if contents.damaged > MOST_DAMAGED:
        raise error


def _why_damaged(contents: Contents, error: Exception) -> str:
    return f"after {contents.end_s:g} s ({type(error).__name__})"


def make_reader(
    file: BinaryIO, checks_all: bool, damaged: Callable[[Exception], None], longest: int = MOST_RECORD
) -> StreamReader:
    """Return a reader that never reads on behind the end of a record, whatever lengths and counts the record holds.

    mcap's own reader believes them. A message that is shorter than its head then stands for the rest of the file, and
    the index of a chunk for 268 million entries.
    """
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import EndOfFile, McapError
    from mcap.records import McapRecord
    from mcap.stream_reader import StreamReader

    class RecordByRecord(StreamReader):
        def _read_record(self, opcode: int, length: int) -> McapRecord | None:
            if opcode == NO_RECORD:
                raise McapError(f"opcode {opcode}")
            stream = self._stream
            content = stream.read(length)
            if len(content) < length:
                raise EndOfFile
            self._stream = ReadDataStream(BytesIO(content))
            try:
                return super()._read_record(opcode, length)
            except Exception as error:  # noqa: BLE001 - a damaged record may raise anything, and the next may be whole
                damaged(error)
                return None
            finally:
                self._stream = stream

    return RecordByRecord(file, emit_chunks=True, validate_crcs=checks_all, record_size_limit=longest)


def unpack_record(record: Any, most: int = MOST_RECORD) -> Iterator[Any]:
    """Yield a record, or those in a chunk, one at a time; what is no schema, channel or message in it, as bytes.

    A chunk of more than `most` bytes is not decompressed: it raises ValueError, and so does an unknown compression.
    """
    import zstandard
    from lz4.frame import LZ4FrameDecompressor
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, Message, Schema
    from mcap.stream_reader import get_chunk_data_stream

    if not isinstance(record, Chunk):
        yield record
        return
    if record.compression not in ("", "zstd", "lz4"):
        raise ValueError(f"compression {record.compression}")
    size = record.uncompressed_size
    if record.compression == "zstd":
        declared = zstandard.get_frame_parameters(record.data).content_size
        size = max(size, 0 if declared == zstandard.CONTENTSIZE_UNKNOWN else declared)
    if size > most:
        raise ValueError(f"a chunk of {size} bytes; at most {most}")
    if record.compression == "lz4":
        record = replace(record, compression="", data=LZ4FrameDecompressor().decompress(record.data, size))
    stream, length = get_chunk_data_stream(record, validate_crc=True)
    if length != record.uncompressed_size:
        raise ValueError(f"a chunk of {length} bytes, which says {record.uncompressed_size}")
    while stream.count < length:
        opcode, size = stream.read1(), stream.read8()
        match opcode:
            case Opcode.CHANNEL:
                yield Channel.read(stream)
            case Opcode.MESSAGE:
                yield Message.read(stream, size)
            case Opcode.SCHEMA:
                yield Schema.read(stream)
            case _:
                yield stream.read(size)


class _Copy:
    """Writes records into a new file."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._begun = False
        self._schemas: dict[int, int] = {}
        self._channels: dict[int, int] = {}

    def write(self, record: Any) -> None:
        """Copy a record; index records are created by finish()."""
        from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema

        writer = self._writer
        if not self._begun:  # once, whatever the first record is, and however many headers there are
            self._begun = True
            writer.start(*((record.profile, record.library) if isinstance(record, Header) else ()))
        match record:
            case Schema() if record.id not in self._schemas:
                self._schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            case Channel() if record.id not in self._channels and record.schema_id in self._schemas:
                channel_key = (record.topic, record.message_encoding, self._schemas[record.schema_id], record.metadata)
                self._channels[record.id] = writer.register_channel(*channel_key)
            case Message() if record.channel_id in self._channels:
                channel = self._channels[record.channel_id]
                writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case Attachment():
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)

    def finish(self) -> None:
        """Write the index."""
        self._writer.finish()  # type: ignore[no-untyped-call]
