"""Maps out of bags of ROS 2: the newest `nav_msgs/OccupancyGrid`, of bags in MCAP and in SQLite.

Bags come from others, so nothing is read that is larger than the largest grid, however small its compressed bytes are.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from monitor.recording.mcap_file import make_reader
from patrol.errors import BadInput, Malformed, quoted
from patrol.files.untrusted import BAG, open_untrusted
from patrol.files.whole_file import writing
from ros2.robot.shown import write_map
from ros2.wire.codec import decode
from ros2.wire.messages import OccupancyGrid

if TYPE_CHECKING:
    from mcap.records import Chunk

MOST_BYTES = 1 << 28
"""Bytes of the largest message, and of the largest chunk of messages, 256 MiB."""
MOST_STEPS = 10**9
"""Steps that SQLite may take over a bag, some tens of seconds: its tables can be made to have no end."""

_GRID = "nav_msgs/msg/OccupancyGrid"
_ENDINGS = {".mcap", ".db3", ".zstd"}
_FOUND = """SELECT messages.timestamp, topics.name, messages.data
FROM topics JOIN messages ON messages.topic_id = topics.id WHERE topics.type = ?"""

Found = tuple[int, str, bytes]
"""Time in ns, topic and bytes of a grid."""


def extract_map(bag: Path, out: Path, topic: str | None = None) -> tuple[Path, OccupancyGrid]:
    """Write the newest grid of a bag into a folder, as map_server does; return the map's file, and the grid.

    The map's file has the bag's name. Without a topic the bag must have grids of one topic alone.
    """
    files = sorted(file for file in bag.iterdir() if file.suffix in _ENDINGS) if bag.is_dir() else [bag]
    newest: Found | None = None
    topics: set[str] = set()
    for stamped in chain.from_iterable(map(_grids_of, files)):
        topics.add(stamped[1])
        if topic in (None, stamped[1]) and (newest is None or stamped[0] >= newest[0]):
            newest = stamped
    names = ", ".join(map(quoted, sorted(topics)))
    if newest is None:
        raise BadInput(
            f"{bag}: holds no {_GRID}{f' of {topic}, but of {names}' if topics else ''}; record its map topic"
        )
    if topic is None and len(topics) > 1:
        raise BadInput(f"{bag}: holds grids of several topics; give --topic, one of {names}")
    path = out / f"{bag.stem}.yaml"
    if path.exists() or path.with_suffix(".png").exists():
        raise BadInput(f"{path}: is there already, or its image; give another --out")
    try:
        grid = decode(OccupancyGrid, newest[2])
        with writing(out):
            out.mkdir(parents=True, exist_ok=True)
            return write_map(grid, out, bag.stem), grid
    except (Malformed, BadInput) as error:
        raise BadInput(f"{bag}: {quoted(newest[1])}: {error}") from None


def _grids_of(path: Path) -> Iterator[Found]:
    """Yield all grids of a file."""
    try:
        with open_untrusted(path, BAG) as file:
            head = file.read(16)
            file.seek(0)
            if head.startswith(b"\x28\xb5\x2f\xfd"):
                raise BadInput(f"{path}: is compressed; unpack it with: zstd -d {path}")
            if not head.startswith((b"\x89MCAP0\r\n", b"SQLite format 3\0")):
                raise BadInput(f"{path}: is no bag; expected an .mcap or .db3 file, or the folder of one")
            yield from (_in_mcap if head.startswith(b"\x89") else _in_sqlite)(file)
    except ImportError:
        raise BadInput("bags need mcap; install it with: pip install 'fogwatch[monitor]'") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror})") from None
    except (sqlite3.Error, struct.error, LookupError, ValueError, TypeError, OverflowError, RuntimeError) as error:
        raise BadInput(f"{path}: is no whole bag ({type(error).__name__}: {quoted(str(error))})") from None


def _in_sqlite(file: BinaryIO) -> Iterator[Found]:
    with closing(sqlite3.connect(f"file:/proc/self/fd/{file.fileno()}?mode=ro&immutable=1", uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
        database.set_progress_handler(lambda: 1, MOST_STEPS)
        for row in database.execute(_FOUND, (_GRID,)):
            if list(map(type, row)) != [int, str, bytes]:
                raise ValueError("a message without time, topic or bytes")
            yield row


def _expand(chunk: Chunk) -> Chunk:
    """Return a chunk whose records are not compressed."""
    from lz4.frame import LZ4FrameDecompressor  # here: they come with an extra
    from zstandard import ZstdDecompressor, ZstdError

    data = chunk.data
    try:
        if chunk.compression == "zstd":
            data = ZstdDecompressor().stream_reader(data).read(MOST_BYTES + 1)
        elif chunk.compression == "lz4":
            data = LZ4FrameDecompressor().decompress(data, MOST_BYTES + 1)
    except ZstdError as error:
        raise ValueError(str(error)) from None
    if len(data) != chunk.uncompressed_size or len(data) > MOST_BYTES:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes; at most {MOST_BYTES}, and as many as it says")
    return replace(chunk, compression="", data=data)


def _in_mcap(file: BinaryIO) -> Iterator[Found]:
    from mcap.exceptions import McapError  # here: its library is an extra
    from mcap.records import Channel, Chunk, Message, Schema
    from mcap.stream_reader import breakup_chunk

    def damaged(error: Exception) -> None:
        raise error

    schemas: dict[int, str] = {}
    topics: dict[int, str] = {}
    try:
        for outer in make_reader(file, False, damaged, MOST_BYTES).records:
            for record in breakup_chunk(_expand(outer)) if isinstance(outer, Chunk) else (outer,):
                if isinstance(record, Schema):
                    schemas[record.id] = record.name
                elif isinstance(record, Channel) and schemas.get(record.schema_id) == _GRID:
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and record.channel_id in topics:
                    yield record.log_time, topics[record.channel_id], record.data
    except McapError as error:
        raise ValueError(str(error) or type(error).__name__) from None
