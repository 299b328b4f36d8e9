"""Bags of strangers in MCAP: what stands for much is not unpacked, and what is damaged ends the reading."""

import resource
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard

from fogwatch.grounds import bags
from fogwatch.grounds.bags import extract_map
from patrol.files.untrusted import MIB
from tests.hostile.files.looks import one_line

MAGIC = b"\x89MCAP0\r\n"
MOST = 64 * MIB
"""Bytes of the largest record and chunk here, so that files are small."""
MESSAGE, CHANNEL, SCHEMA, CHUNK, MESSAGE_INDEX, ATTACHMENT, METADATA = 5, 4, 3, 6, 7, 9, 12


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    """A record; its length may be a lie."""
    return bytes([opcode]) + struct.pack("<Q", len(body) if length is None else length) + body


def text(content: str) -> bytes:
    return struct.pack("<I", len(content.encode())) + content.encode()


def chunk(content: bytes, compression: str = "zstd", size: int | None = None) -> bytes:
    """A chunk; the size that it declares may be a lie."""
    packed = zstandard.ZstdCompressor(level=1).compress(content) if compression == "zstd" else content
    head = struct.pack("<QQQI", 1, 1, len(content) if size is None else size, 0)
    return record(CHUNK, head + text(compression) + struct.pack("<Q", len(packed)) + packed)


HELLO = record(MESSAGE, struct.pack("<HIQQ", 1, 1, 1, 1) + b"x")
BEGIN = (
    MAGIC
    + record(1, text("ros2") + text("x"))
    + record(SCHEMA, struct.pack("<H", 1) + text("a/B") + text("ros2msg") + struct.pack("<I", 0))
    + record(CHANNEL, struct.pack("<HH", 1, 1) + text("/t") + text("cdr") + struct.pack("<I", 0))
)
END = record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC
LARGE = bytes(4 * MOST)
CUT: dict[str, Callable[[], bytes]] = {
    "a record longer than the file": lambda: record(MESSAGE, b"abc", 1 << 62),
    "a record of all lengths": lambda: record(MESSAGE, b"abc", (1 << 64) - 1),
    "a record without content": lambda: record(MESSAGE, b""),
    "a record of no kind": lambda: record(0, b""),
    "a message shorter than its head, and much behind it": lambda: record(MESSAGE, bytes(21)) + LARGE,
    "an index of more entries than its record": lambda: record(MESSAGE_INDEX, struct.pack("<HI", 1, 1 << 31)) + LARGE,
    "an attachment longer than its record": lambda: record(
        ATTACHMENT, struct.pack("<QQ", 1, 1) + text("n") + text("m") + struct.pack("<Q", 1 << 60)
    ),
    "a map of more entries than its record": lambda: record(METADATA, text("x") + struct.pack("<I", 1 << 31)),
    "a bomb": lambda: chunk(LARGE),
    "a bomb that says it is small": lambda: chunk(LARGE, size=100),
    "a chunk that holds more than it says": lambda: chunk(record(255, bytes(MOST // 4)), size=0),
    "a large chunk": lambda: chunk(LARGE, ""),
    "a compression that nothing here uses": lambda: chunk(HELLO, "gzip"),
    "text that is none": lambda: record(CHANNEL, struct.pack("<HHI", 2, 1, 2) + b"\xff\xfe"),
}


@pytest.mark.parametrize("what", CUT)
def test_reading_ends_where_a_bag_stands_for_too_much(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bags, "MOST_BYTES", MOST)
    path = tmp_path / "strange.mcap"
    path.write_bytes(BEGIN + HELLO + CUT[what]())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "is no whole bag (" in one_line(lambda: extract_map(path, tmp_path / "out"))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST >> 10


def test_a_chunk_in_a_chunk_is_not_opened(tmp_path: Path) -> None:
    path = tmp_path / "strange.mcap"
    inner = HELLO
    for _ in range(100):
        inner = chunk(inner, "")
    path.write_bytes(BEGIN + HELLO + inner + END)
    assert "holds no nav_msgs/msg/OccupancyGrid" in one_line(lambda: extract_map(path, tmp_path / "out"))
