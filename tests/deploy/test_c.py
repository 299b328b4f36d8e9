"""The C library for microcontrollers: the vectors that both it and Python obey, hostile bytes, and a fleet's radio."""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from patrol.pose import Pose
from patrol.radio.message import MAX_FRAME, Position, Rejected, decode, encode
from patrol.random import mix
from runtime.net.mailbox import Mailbox
from runtime.net.multicast import Group, open_group
from runtime.net.serial_line import END, Unpacker, open_serial, packet
from tests.routers import free_port
from tests.serial_lines import Modems

SOURCES = Path(__file__).parents[2] / "deploy" / "c"
VECTORS: dict[str, list[dict[str, Any]]] = json.loads((SOURCES / "vectors.json").read_text(encoding="utf-8"))
KEY = b"a key of the fleet, 32 bytes long"
PATIENCE_S = 300.0
HOSTILE = 30_000

needs_cc = pytest.mark.skipif(
    any(shutil.which(tool) is None for tool in ("cc", "make")) and not os.environ.get("CI"),
    reason="the commands cc and make are not installed",
)


def key_of(vector: dict[str, Any]) -> bytes | None:
    text = vector.get("key")
    return None if text is None else text.encode()


def position_of(vector: dict[str, Any]) -> Position:
    robot, sequence, time_ms, x_cm, y_cm, heading_mrad = vector["position"]
    trail = tuple((dx, dy) for dx, dy in vector.get("trail", ()))
    return Position(robot, sequence, time_ms, x_cm, y_cm, heading_mrad, trail)


def line_of(position: Position) -> str:
    numbers = [position.robot, position.sequence, position.time_ms, position.x_cm, position.y_cm, position.heading_mrad]
    return " ".join(map(str, [*numbers, *(delta for step in position.trail for delta in step)]))


def line_in(frame: bytes, key: bytes | None) -> str:
    try:
        return line_of(decode(frame, key))
    except Rejected:
        return "refused"


@pytest.fixture(scope="module")
def radio(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program, built with the address and undefined-behaviour sanitizers."""
    folder = tmp_path_factory.mktemp("c")
    for source in (*SOURCES.glob("*.[ch]"), SOURCES / "Makefile"):
        shutil.copy(source, folder)
    built = subprocess.run(["make", "-C", folder, "check", "radio"], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    assert built.stderr == ""
    return folder / "radio-checked"


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    file = tmp_path / "fleet.key"
    file.write_bytes(KEY + b"\n")
    return file


def through(radio: Path, words: Sequence[str | Path], data: bytes) -> bytes:
    done = subprocess.run([radio, *words], input=data, capture_output=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr.decode()
    assert done.stderr == b""
    return done.stdout


def with_key(key: bytes | None, folder: Path) -> list[str | Path]:
    if key is None:
        return []
    (folder / "key").write_bytes(key)
    return ["-k", folder / "key"]


def read(radio: Path, frames: Sequence[bytes], words: Sequence[str | Path] = ()) -> list[str]:
    lines = b"".join(f"{frame.hex()}\n".encode() for frame in frames)
    return through(radio, ["read", *words], lines).decode().split("\n")[:-1]


@pytest.mark.parametrize("vector", VECTORS["frames"], ids=lambda vector: vector["frame"])
def test_python_writes_and_reads_the_vectors(vector: dict[str, Any]) -> None:
    frame = bytes.fromhex(vector["frame"])
    assert encode(position_of(vector), key_of(vector)) == frame
    assert decode(frame, key_of(vector)) == position_of(vector)
    assert packet(frame).hex() == vector["packet"]
    assert list(Unpacker().feed(bytes.fromhex(vector["packet"]))) == [frame]


def test_the_first_vector_is_right_byte_by_byte() -> None:
    # An array of seven: version 1, robot 1 and sequence 7 in a byte each; 3500 ms, 600 cm, 613 cm, 5283 mrad in three.
    frame = VECTORS["frames"][0]["frame"]
    assert bytes.fromhex(frame) == b"\x97\1\1\7" + b"".join(b"\xcd" + n.to_bytes(2) for n in (3500, 600, 613, 5283))


def python(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the packages of a clone."""
    environment = {**os.environ, "PYTHONPATH": str(root)}
    command = [sys.executable, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=root, env=environment)


def laid_out(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return python(root, str(root / "deploy" / "c" / "layout.py"), *words)


def test_the_layout_in_c_and_the_table_are_those_of_the_declaration() -> None:
    checked = laid_out(SOURCES.parents[1], "--check")
    assert (checked.returncode, checked.stdout) == (0, "")


BATTERY = '    battery: Annotated[int, WireField(-5, 300, "%", "charge")] = 0\n'
ASKS = """
import sys
from patrol.radio.message import Position, decode, encode
frame = encode(Position(1, 7, 3500, 600, 613, 5283, 250, ((3, -4),)))
assert decode(frame).battery == 250
print(frame.hex())
"""


@needs_cc
def test_a_field_that_is_declared_is_in_both_and_in_the_table(tmp_path: Path) -> None:
    root = SOURCES.parents[1]
    for folder in ("patrol", "deploy/c"):
        shutil.copytree(root / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__", "radio*"))
    shutil.copytree(root / "patrol" / "radio", tmp_path / "patrol" / "radio")
    shutil.copy(root / "deploy" / "c" / "radio.c", tmp_path / "deploy" / "c")
    (tmp_path / "docs").mkdir()
    shutil.copy(root / "docs" / "radio.md", tmp_path / "docs")
    declared = tmp_path / "patrol" / "radio" / "message.py"
    trail = "    trail: tuple[tuple[int, int], ...] = ()\n"
    declared.write_text(declared.read_text(encoding="utf-8").replace(trail, BATTERY + trail), encoding="utf-8")
    assert laid_out(tmp_path, "--check").returncode == 1
    made = laid_out(tmp_path)
    assert made.returncode == 0, made.stderr
    assert "| `battery` | -5 to 300 | % | charge |" in (tmp_path / "docs" / "radio.md").read_text(encoding="utf-8")
    built = subprocess.run(["make", "-C", tmp_path / "deploy" / "c", "check"], capture_output=True, check=False)
    assert built.returncode == 0, built.stderr
    asked = python(tmp_path, "-c", ASKS)
    frame = asked.stdout.strip()
    assert asked.returncode == 0, asked.stderr
    radio = tmp_path / "deploy" / "c" / "radio-checked"
    line = "1 7 3500 600 613 5283 250 3 -4"
    assert through(radio, ["frames"], f"{line}\n".encode()).decode().strip() == frame
    assert read(radio, [bytes.fromhex(frame)]) == [line]
    assert read(radio, [bytes.fromhex(VECTORS["frames"][0]["frame"])]) == ["refused"]  # it lacks the new field
    with pytest.raises(Rejected):
        decode(bytes.fromhex(frame))


def test_python_refuses_and_accepts_the_others() -> None:
    for vector in VECTORS["refused"]:
        with pytest.raises(Rejected):
            decode(bytes.fromhex(vector["frame"]), key_of(vector))
    for vector in VECTORS["accepted"]:
        assert decode(bytes.fromhex(vector["frame"])) == position_of(vector)


@needs_cc
@pytest.mark.parametrize("vector", VECTORS["frames"], ids=lambda vector: vector["frame"])
def test_c_writes_and_reads_the_vectors(vector: dict[str, Any], radio: Path, tmp_path: Path) -> None:
    words = with_key(key_of(vector), tmp_path)
    line = line_of(position_of(vector))
    assert through(radio, ["frames", *words], f"{line}\n".encode()).decode() == f"{vector['frame']}\n"
    assert read(radio, [bytes.fromhex(vector["frame"])], words) == [line]
    assert through(radio, ["send", *words], f"{line}\n".encode()).hex() == vector["packet"]
    assert through(radio, ["receive", *words], bytes.fromhex(vector["packet"])).decode() == f"{line}\n"


@needs_cc
def test_c_refuses_and_accepts_the_others(radio: Path, tmp_path: Path) -> None:
    for vector in VECTORS["refused"]:
        assert read(radio, [bytes.fromhex(vector["frame"])], with_key(key_of(vector), tmp_path)) == ["refused"], vector
    for vector in VECTORS["accepted"]:
        assert read(radio, [bytes.fromhex(vector["frame"])]) == [line_of(position_of(vector))]


def hostile(count: int) -> Iterator[bytes]:
    """Random bytes, and frames with bytes that were changed, taken out or put in, by a hash of their number."""
    heads = bytes.fromhex("909298c0c2c4c5c7cacbcccfd0d3d9dcdddf")
    whole = [bytes.fromhex(vector["frame"]) for name in VECTORS for vector in VECTORS[name] if vector["frame"]]
    for n in range(count):
        if n % 8 == 0:
            length = mix(n, 0) % (MAX_FRAME + 8)
            yield bytes(mix(n, 1, at) & 0xFF for at in range(length))
            continue
        frame = bytearray(whole[mix(n, 2) % len(whole)])
        for change in range(1 + mix(n, 3) % 3):
            at = mix(n, 4, change) % (len(frame) + 1)
            new = mix(n, 5, change)
            byte = heads[new % len(heads)] if new & 1024 else new & 0xFF
            match mix(n, 6, change) % 4:
                case 0:
                    frame[at : at + 1] = bytes([byte])
                case 1:
                    frame[at:at] = bytes([byte])
                case 2:
                    del frame[at : at + 1]
                case _:
                    frame[at : at + 1] = bytes([frame[at] ^ 1 << new % 8]) if at < len(frame) else b""
        yield bytes(frame)


@needs_cc
@pytest.mark.parametrize("key", [None, KEY], ids=["open", "keyed"])
def test_c_and_python_agree_on_hostile_bytes(key: bytes | None, radio: Path, tmp_path: Path) -> None:
    frames = [frame for frame in hostile(HOSTILE) if len(frame) < 250]
    expected = [line_in(frame, key) for frame in frames]
    found = read(radio, frames, with_key(key, tmp_path))
    differ = [(frame.hex(), want, got) for frame, want, got in zip(frames, expected, found, strict=True) if want != got]
    assert differ == []
    accepted = sum(line != "refused" for line in expected)
    assert accepted > HOSTILE // 100 if key is None else accepted > 0, "the changes leave some frames whole"


@needs_cc
def test_c_and_python_find_the_same_packets_in_noise(radio: Path) -> None:
    noise = b"".join(frame + END if n % 3 else packet(frame[:MAX_FRAME]) for n, frame in enumerate(hostile(3000)))
    expected = [line_in(frame, None) for frame in Unpacker().feed(noise)]
    assert through(radio, ["receive"], noise).decode().split("\n")[:-1] == expected
    assert len(expected) > 500


@needs_cc
@pytest.mark.parametrize("digits", [507, 509, 510, 511, 512, 2000])
def test_lines_of_hex_of_any_length_are_read_within_their_bounds(digits: int, tmp_path: Path) -> None:
    checked = tmp_path / "radio"
    sources = [SOURCES / name for name in ("radio.c", "position.c", "packet.c")]
    flags = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
    subprocess.run(["cc", *flags, "-o", checked, *sources], check=True, capture_output=True)
    good = VECTORS["accepted"][0]["frame"]
    done = subprocess.run([checked, "read"], input=f"{'9' * digits}\n{good}".encode(), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    *refused, last = done.stdout.decode().splitlines()
    assert set(refused) == {"refused"}
    assert last == line_of(position_of(VECTORS["accepted"][0])), "a line without an end holds nothing of the one before"


@needs_cc
def test_what_is_no_position_and_what_is_no_key_is_said(radio: Path, tmp_path: Path) -> None:
    wrong = (
        b"1 7 3500 600 613\n70000 7 0 0 0 0\n1 7 0 0 0 6284\n1 7 0 0 0 0 5\n1 7 0 0 0 0" + 10 * b" 1" + b"\nhello\n\n"
    )
    done = subprocess.run([radio, "frames"], input=wrong, capture_output=True, check=True)
    assert done.stdout == b""
    assert done.stderr.count(b"radio: no position: ") == 7
    (tmp_path / "short").write_bytes(b"short")
    for words in (["-k", tmp_path / "short"], ["-k", tmp_path / "none"], ["-g", "here"], ["-i", "x"], ["-x"]):
        assert subprocess.run([radio, "send", *words], capture_output=True, check=False).returncode == 2
    for verbs in ([], ["listen"]):
        assert subprocess.run([radio, *verbs], capture_output=True, check=False).returncode == 2


@needs_cc
@pytest.mark.processes
def test_a_microcontroller_takes_part_in_a_keyed_fleet_over_a_serial_line(radio: Path, key_file: Path) -> None:
    modems = Modems(2)
    line = open_serial(f"serial{modems.devices[0]}", {1: "f/position/a", 2: "f/position/b"})
    mailbox = Mailbox(["f/position/b"], bytes, MAX_FRAME, 8)
    line.subscribe("f/position/*", mailbox)
    post = line.broadcast("f/position/a")
    try:
        with open(modems.devices[1], "r+b", buffering=0) as device:  # noqa: PTH123 - both ways at once, unbuffered
            send = subprocess.Popen([radio, "send", "-k", key_file], stdin=subprocess.PIPE, stdout=device)
            receive = subprocess.Popen([radio, "receive", "-k", key_file], stdin=device, stdout=subprocess.PIPE)
            said = Position.of(2, 3, 1.5, Pose(4.0, -5.0, 1.0), ((-220, 0),))
            assert send.stdin is not None
            assert receive.stdout is not None
            send.stdin.write(f"{line_of(said)}\n".encode())
            send.stdin.close()
            assert send.wait(PATIENCE_S) == 0
            heard = mailbox.get(PATIENCE_S)
            own = Position.of(1, 3, 1.5, Pose(40.0, 50.0, 6.0))
            post(encode(own))
            post(encode(own, KEY))
            lines = [receive.stdout.readline().decode() for _ in range(2)]
            receive.kill()
            receive.wait(PATIENCE_S)
            receive.stdout.close()
    finally:
        line.close()
        modems.close()
    assert heard is not None
    assert decode(heard[1], KEY) == said
    assert lines == ["refused\n", f"{line_of(own)}\n"]


@pytest.fixture
def group() -> Iterator[tuple[Group, str]]:
    address = f"239.255.77.2:{free_port(socket.SOCK_DGRAM)}"
    member = open_group(f"udp/{address}#iface=lo")
    yield member, address
    member.close()


@needs_cc
@pytest.mark.processes
def test_a_microcontroller_takes_part_in_a_multicast_group(radio: Path, group: tuple[Group, str]) -> None:
    member, address = group
    where = ["-g", address, "-i", "127.0.0.1"]
    mailbox = Mailbox(["f/position/b"], bytes, MAX_FRAME, 8)
    member.subscribe("f/position/*", mailbox)
    said, own = Position.of(2, 3, 1.5, Pose(4.0, 5.0, 1.0)), Position.of(1, 3, 1.5, Pose(40.0, 50.0, 6.0))
    assert through(radio, ["send", *where, "-n", "f/position/b"], f"{line_of(said)}\n".encode()) == b""
    heard = mailbox.get(PATIENCE_S)
    assert heard is not None
    assert decode(heard[1]) == said
    post = member.broadcast("f/position/a")
    receive = subprocess.Popen([radio, "receive", *where], stdout=subprocess.PIPE)
    try:
        assert receive.stdout is not None
        os.set_blocking(receive.stdout.fileno(), False)
        line = b""
        until = time.monotonic() + PATIENCE_S
        while not line and time.monotonic() < until:  # it says nothing when it has joined
            post(encode(own))
            time.sleep(0.05)
            line = receive.stdout.readline()
    finally:
        receive.kill()
        receive.wait(PATIENCE_S)
    receive.stdout.close()
    assert line.decode() == f"{line_of(own)}\n"
