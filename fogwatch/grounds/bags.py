"""Maps out of bags of ROS 2: the newest `nav_msgs/OccupancyGrid`, of bags in MCAP and in SQLite.

Bags come from others, so nothing is read that is larger than the largest grid, however small its compressed bytes are.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import BinaryIO

from fogwatch.grounds.mcap_records import make_reader, unpack_record
from patrol.errors import BadInput, Malformed, quoted
from patrol.files.untrusted import BAG, open_untrusted
from patrol.files.whole_file import writing
from ros2.robot.shown import write_map
from ros2.wire.codec import decode
from ros2.wire.messages import OccupancyGrid

MOST_BYTES = 1 << 28
"""Bytes of the largest message, and of the largest chunk of messages when it is decompressed, 256 MiB."""
MOST_STEPS = 10**9
"""Steps that SQLite may take over a bag, some tens of seconds: its tables can be made to have no end."""
MOST_EXPANDED, _MOST_TIMES, _EACH = 1 << 32, 256, 4096
"""Bytes that all messages may take, 4 GiB and 256 times the file; each counts as 4 KiB more, for the time it takes."""

_GRID = "nav_msgs/msg/OccupancyGrid"
_ENDINGS = {".mcap", ".db3", ".zstd"}
_PLAIN = ("CREATE TABLE ", "CREATE INDEX ", "CREATE UNIQUE INDEX ")
"""What SQLite calls what is no view, trigger or virtual table: these could make far more than the file holds."""
_TOPICS = "SELECT id, name FROM topics WHERE type = ?"
_MESSAGES = "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN"
_LONGEST_NAME = 255
"""Characters that are kept of a topic's name."""

Found = tuple[int, str, bytes]
"""Time in ns, topic and bytes of a grid."""


def extract_map(bag: Path, out: Path, topic: str | None = None) -> tuple[Path, OccupancyGrid]:
    """Write the newest grid of a bag into a folder, as map_server does; return the map's file, and the grid.

    The map's file has the bag's name. Without a topic the bag must have grids of one topic alone.
    """
    try:
        bag = bag.resolve()  # a map needs its name, which "." has not
        files = sorted(file for file in bag.iterdir() if file.suffix in _ENDINGS) if bag.is_dir() else [bag]
    except OSError as error:
        raise BadInput(f"{bag}: cannot be read ({error.strerror})") from None
    except RuntimeError:
        raise BadInput(f"{bag}: is a link that leads back to itself; name the bag") from None
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
            left = MOST_EXPANDED + _MOST_TIMES * path.stat().st_size
            for size, grid in (_in_mcap if head.startswith(b"\x89") else _in_sqlite)(file):
                left -= size + _EACH
                if left < 0:
                    raise ValueError("its messages are too many for its size")
                if grid:
                    yield grid
    except ImportError:
        raise BadInput("bags need mcap; install it with: pip install 'fogwatch[monitor]'") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror})") from None
    except (sqlite3.Error, struct.error, LookupError, ValueError, TypeError, OverflowError, RuntimeError) as error:
        raise BadInput(f"{path}: is no whole bag ({type(error).__name__}: {quoted(str(error))})") from None


def _in_sqlite(file: BinaryIO) -> Iterator[tuple[int, Found | None]]:
    with closing(sqlite3.connect(f"file:/proc/self/fd/{file.fileno()}?mode=ro&immutable=1", uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
        database.setlimit(sqlite3.SQLITE_LIMIT_FUNCTION_ARG, 0)  # a column may be generated, such as by zeroblob(N)
        database.set_progress_handler(lambda: 1, MOST_STEPS)
        for (statement,) in database.execute("SELECT sql FROM sqlite_master WHERE sql NOT NULL"):
            if not statement.startswith(_PLAIN):
                raise ValueError(f"only plain tables are read, not {statement[:_LONGEST_NAME]}")
        topics = {key: name[:_LONGEST_NAME] for key, name in database.execute(_TOPICS, (_GRID,))}
        for key, *stamped in database.execute(f"{_MESSAGES} ({', '.join('?' * len(topics))})", (*topics,)):
            row = (stamped[0], topics[key], stamped[1])
            if list(map(type, row)) != [int, str, bytes]:
                raise ValueError("a message without time, topic or bytes")
            yield len(row[2]), row


def _in_mcap(file: BinaryIO) -> Iterator[tuple[int, Found | None]]:
    from mcap.exceptions import McapError  # here: its library is an extra
    from mcap.records import Channel, Chunk, Message, Schema
    from zstandard import ZstdError

    grids: dict[int, bool] = {}
    topics: dict[int, str] = {}
    try:
        for outer in make_reader(file, MOST_BYTES).records:
            yield outer.uncompressed_size if isinstance(outer, Chunk) else 0, None
            for record in unpack_record(outer, MOST_BYTES):
                grid = None
                if isinstance(record, Schema):
                    grids[record.id] = record.name == _GRID
                elif isinstance(record, Channel) and grids.get(record.schema_id):
                    topics[record.id] = record.topic[:_LONGEST_NAME]
                elif isinstance(record, Message) and record.channel_id in topics:
                    grid = record.log_time, topics[record.channel_id], record.data
                yield 0, grid
    except (McapError, ZstdError) as error:
        raise ValueError(str(error) or type(error).__name__) from None
