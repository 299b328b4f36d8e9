"""Reads MCAP files of others, record by record.

mcap's own reader believes lengths and counts. A message that is shorter than its head then stands for the rest of the
file, and the index of a chunk for 268 million entries.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from mcap.stream_reader import StreamReader

NO_RECORD = 0
"""An opcode that no record has (MCAP's specification); zeros would be read as millions of empty records."""


def make_reader(file: BinaryIO, longest: int) -> StreamReader:
    """Return a reader that never reads on behind the end of a record, whatever lengths and counts the record holds.

    A record has at most `longest` bytes.
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
            finally:
                self._stream = stream

    return RecordByRecord(file, emit_chunks=True, validate_crcs=False, record_size_limit=longest)


def unpack_record(record: Any, most: int) -> Iterator[Any]:
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
