import sqlite3
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer

from fogwatch.grounds import bags
from fogwatch.grounds.bags import extract_map
from patrol.errors import BadInput
from patrol.maps.load import read_terrain
from patrol.pose import Pose
from ros2.wire.codec import encode
from ros2.wire.definitions import store
from ros2.wire.messages import Bool, OccupancyGrid
from tests.fogwatch.commands.test_map import output

GRID = "nav_msgs/msg/OccupancyGrid"
CELLS = np.zeros((20, 30), dtype=np.int8)
CELLS[:, 29] = 100
CELLS[0] = -1
OLDER = encode(OccupancyGrid(1, "map", 0.1, Pose(0.0, 0.0, 0.0), np.full((5, 5), 100, dtype=np.int8)))


def newest(heading: float = 0.0) -> bytes:
    return encode(OccupancyGrid(2, "map", 0.1, Pose(-1.0, 2.0, heading), CELLS))


def ros_bag(folder: Path, storage: StoragePlugin, *grids: tuple[str, bytes]) -> Path:
    """A bag as rosbag2 records it, in which the grids were received 1 s apart, the last one first in the file."""
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        topics = {}
        for name in sorted({name for name, _ in grids}):
            topics[name] = writer.add_connection(name, GRID, typestore=store())
        other = writer.add_connection("/ready", "std_msgs/msg/Bool", typestore=store())
        for number, (name, payload) in reversed(list(enumerate(grids))):
            writer.write(topics[name], number * 10**9, payload)
        writer.write(other, len(grids) * 10**9, encode(Bool(True)))
    return folder


def mcap_file(path: Path, compression: CompressionType, payload: bytes, schema: str = GRID) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file, compression=compression)
        writer.start()
        channel = writer.register_channel("/map", "cdr", writer.register_schema(schema, "ros2msg", b""))
        writer.add_message(channel, 0, payload, 0)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("whole_folder", [True, False])
def test_the_newest_grid_of_a_bag_is_a_map(tmp_path: Path, storage: StoragePlugin, whole_folder: bool) -> None:
    bag = ros_bag(tmp_path / "site: 1", storage, ("/map", OLDER), ("/map", newest()))
    source = bag if whole_folder else next(file for file in bag.iterdir() if file.suffix in (".mcap", ".db3"))
    told = output("extract", str(source), "--out", str(tmp_path / "maps"))
    written = tmp_path / "maps" / f"{source.stem}.yaml"
    assert told == f"{written}: 30 x 20 cells of 0.1 m, of frame map\n"
    terrain = read_terrain(written, 0.1)
    assert terrain.origin == pytest.approx((-1.0, 2.0))
    np.testing.assert_array_equal(terrain.passable, CELLS == 0)
    assert "30 x 20 points of 0.1 m" in output("check", str(written), "--radius", "0.1")
    with pytest.raises(BadInput, match="is there already, or its image; give another --out"):
        extract_map(source, tmp_path / "maps")


@pytest.mark.parametrize("compression", list(CompressionType))
def test_reads_chunks_of_every_compression(tmp_path: Path, compression: CompressionType) -> None:
    bag = mcap_file(tmp_path / "a.mcap", compression, newest())
    np.testing.assert_array_equal(extract_map(bag, tmp_path)[1].cells, CELLS)


def test_a_quarter_turn_is_kept_and_another_is_refused_by_the_reader(tmp_path: Path) -> None:
    bag = mcap_file(tmp_path / "turned.mcap", CompressionType.NONE, newest(np.pi / 2))
    terrain = read_terrain(extract_map(bag, tmp_path)[0], 0.1)
    assert terrain.origin == pytest.approx((-3.0, 2.0))
    np.testing.assert_array_equal(terrain.passable, np.rot90(CELLS == 0, -1))
    bag = mcap_file(tmp_path / "skew.mcap", CompressionType.NONE, newest(0.3))
    with pytest.raises(BadInput, match="yaw"):
        read_terrain(extract_map(bag, tmp_path)[0], 0.1)


def test_of_several_topics_one_must_be_named(tmp_path: Path) -> None:
    bag = ros_bag(tmp_path / "bag", StoragePlugin.MCAP, ("/map", newest()), ("/costmap", OLDER))
    with pytest.raises(BadInput, match='several topics; give --topic, one of "/costmap", "/map"'):
        extract_map(bag, tmp_path)
    with pytest.raises(BadInput, match='of /mop, but of "/costmap", "/map"'):
        extract_map(bag, tmp_path, "/mop")
    assert extract_map(bag, tmp_path, "/map")[1].cells.shape == (20, 30)


def sqlite_bag(path: Path, *statements: str) -> Path:
    database = sqlite3.connect(path)
    for statement in statements:
        database.execute(statement)
    database.commit()
    database.close()
    return path


def refused(bag: Path, out: Path, words: str) -> None:
    with pytest.raises(BadInput, match=words) as error:
        extract_map(bag, out)
    assert "\n" not in str(error.value)
    assert not out.exists()


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_may_have_as_many_bytes_as_the_limit(
    tmp_path: Path, compression: CompressionType, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = mcap_file(tmp_path / "bag.mcap", compression, newest())
    with bag.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    (chunk,) = summary.chunk_indexes
    monkeypatch.setattr(bags, "MOST_BYTES", chunk.uncompressed_size)
    extract_map(bag, tmp_path / "out")
    assert read_terrain(tmp_path / "out" / "bag.yaml", 0.1).passable.any()
    monkeypatch.setattr(bags, "MOST_BYTES", chunk.uncompressed_size - 1)
    refused(bag, tmp_path / "other", f"at most {chunk.uncompressed_size - 1}")


TOPICS = "CREATE TABLE topics (id, name, type)"
A_TOPIC = f"INSERT INTO topics VALUES (1, '/map', '{GRID}')"


def test_hostile_bags_are_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    whole = mcap_file(tmp_path / "whole.mcap", CompressionType.ZSTD, newest()).read_bytes()
    bag = tmp_path / "bag.mcap"
    for end in (8, 9, 40, 150, len(whole) // 2, len(whole) - 9):
        bag.write_bytes(whole[:end])
        refused(bag, out, "no whole bag|holds no")
    for content, words in ((b"", "is no bag"), (b"hello", "is no bag"), (zstandard.compress(whole), "zstd -d")):
        bag.write_bytes(content)
        refused(bag, out, words)
    refused(tmp_path / "none.mcap", out, "cannot be read")
    refused(mcap_file(bag, CompressionType.ZSTD, newest(), "nav_msgs/msg/Path"), out, "holds no nav_msgs")
    refused(mcap_file(bag, CompressionType.ZSTD, newest()[:60]), out, "map.*no nav_msgs/msg/OccupancyGrid")
    monkeypatch.setattr(bags, "MOST_BYTES", 10_000)
    for compression in (CompressionType.ZSTD, CompressionType.LZ4):
        refused(mcap_file(bag, compression, bytes(1_000_000)), out, "at most 10000")
    refused(mcap_file(bag, CompressionType.NONE, zlib.compress(bytes(20_000)) + bytes(20_000)), out, "exceeds limit")
    base = tmp_path / "a.db3"
    refused(sqlite_bag(base, "CREATE TABLE other (id)"), out, "no such table: topics")
    messages = "CREATE TABLE messages (topic_id, timestamp, data)"
    words = "INSERT INTO messages VALUES (1, 'now', 'text')"
    refused(sqlite_bag(tmp_path / "b.db3", TOPICS, A_TOPIC, messages, words), out, "without time, topic or bytes")
    huge = "INSERT INTO messages VALUES (1, 1, zeroblob(20000))"
    refused(sqlite_bag(tmp_path / "c.db3", TOPICS, A_TOPIC, messages, huge), out, "too big")
    cut = base.read_bytes()
    base.write_bytes(cut[: len(cut) // 2])
    refused(base, out, "no whole bag")


MESSAGES = "CREATE TABLE messages (topic_id, timestamp, data)"
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT {} FROM n"


def tampered(made: str) -> str:
    """Let a table be made in another way, which SQLite does when it opens the file."""
    return f"UPDATE sqlite_master SET sql = '{made}' WHERE name = 'messages'"


@pytest.mark.parametrize(
    ("statements", "words"),
    [
        (["CREATE VIEW messages AS SELECT 1 AS topic_id, 2 AS timestamp, x'03' AS data"], "only plain tables"),
        (["CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data)"], "only plain tables"),
        ([MESSAGES, "PRAGMA writable_schema = ON", tampered("CREATE/**/TABLE messages (data)")], "only plain tables"),
        (["CREATE TABLE messages (topic_id, timestamp, data AS (zeroblob(topic_id * 9)))"], "too many argu"),
        ([MESSAGES, f"INSERT INTO messages {ENDLESS.format('2, i, 3')} LIMIT 5000"], "interrupted"),
        ([MESSAGES, f"INSERT INTO messages {ENDLESS.format('1, i, zeroblob(9)')} LIMIT 500"], "too many for its size"),
    ],
)
def test_what_an_sqlite_bag_makes_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, statements: list[str], words: str
) -> None:
    monkeypatch.setattr(bags, "MOST_STEPS", 10_000)
    monkeypatch.setattr(bags, "MOST_EXPANDED", 1_000_000)
    monkeypatch.setattr(bags, "_MOST_TIMES", 1)
    refused(sqlite_bag(tmp_path / "a.db3", TOPICS, A_TOPIC, *statements), tmp_path / "out", words)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_the_messages_of_a_small_file_are_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: CompressionType
) -> None:
    """Messages count as 4 KiB each, in one chunk as in several; 500 of them are more than 1 MB and the file."""
    monkeypatch.setattr(bags, "MOST_EXPANDED", 1_000_000)
    monkeypatch.setattr(bags, "_MOST_TIMES", 1)
    bag = tmp_path / "a.mcap"
    for chunk_size in (1 << 20, 1 << 10):
        with bag.open("wb") as file:
            writer = McapWriter(file, chunk_size=chunk_size, compression=compression, use_statistics=False)
            writer.start()
            channel = writer.register_channel("/ready", "cdr", writer.register_schema("Bool", "ros2msg", b""))
            for time in range(500):
                writer.add_message(channel, time, b"", time)
            writer.finish()  # type: ignore[no-untyped-call]
        refused(bag, tmp_path / "out", "too many for its size")


def test_a_bag_is_extracted_from_within_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ros_bag(tmp_path / "site", StoragePlugin.MCAP, ("/map", newest())))
    assert extract_map(Path(), tmp_path / "maps")[0] == tmp_path / "maps" / "site.yaml"


def test_a_folder_that_cannot_be_listed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "iterdir", refuse)
    refused(tmp_path, tmp_path / "out", r"cannot be read \(Permission denied\)")
