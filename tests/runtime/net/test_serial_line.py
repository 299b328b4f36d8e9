import json
import os
import pickle
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.pose import Pose
from patrol.radio.message import MAX_FRAME, Position, decode, encode
from runtime.net.mailbox import Mailbox
from runtime.net.serial_line import (
    END,
    MAX_PACKET,
    PACKET_OVERHEAD,
    SerialDown,
    SerialLine,
    Unpacker,
    open_serial,
    packet,
)
from runtime.security.keys import check_radio
from tests.fleets import COARSE
from tests.routers import PATIENCE_S, take_messages
from tests.serial_lines import Modems
from tests.worldsim.test_fleet_by_hand import Hand

A, B, C = "f/position/a", "f/position/b", "f/position/c"
CALLERS = {1: A, 2: B, 3: C}


@pytest.fixture
def modems() -> Iterator[Modems]:
    modems = Modems(3)
    yield modems
    modems.close()


@pytest.fixture
def pty() -> Iterator[tuple[int, int]]:
    """A pseudo-terminal: nobody reads the first end, the second is a line."""
    ends = os.openpty()
    yield ends
    for end in ends:
        os.close(end)


@pytest.fixture
def lines(modems: Modems) -> Iterator[list[SerialLine]]:
    lines = [open_serial(f"serial{device}#baud=9600", CALLERS) for device in modems.devices]
    yield lines
    for line in lines:
        assert line.close()
        assert line.close(), "closing twice does no harm"


def frame_of(robot: int, k: int = 0) -> bytes:
    return encode(Position.of(robot, k, 0.5 * k, Pose(1.0, 2.0, 0.5)))


def box() -> Mailbox[bytes]:
    return Mailbox((A, B, C), bytes, longest=64, room=8)


def test_all_hear_a_frame_but_its_sender_and_a_contact_belongs_to_whoever_spoke_last(
    modems: Modems, lines: list[SerialLine]
) -> None:
    boxes = [box(), box(), box()]
    for line, mailbox in zip(lines, boxes, strict=True):
        line.subscribe("f/position/*", mailbox)
    contact = encode(Position.of_contact(0, 0.0, 3.0, 4.0))
    post = lines[0].broadcast(A)
    lines[1].broadcast(B)
    post(frame_of(1))
    post(contact)
    for mailbox in boxes[1:]:
        assert take_messages(mailbox, 2) == [(A, frame_of(1)), (A, contact)]
    modems.say(0, packet(frame_of(1, 7)) + packet(contact) + packet(frame_of(3, 8)))
    assert take_messages(boxes[0], 1) == [(C, frame_of(3, 8))], "its own echo is no news"
    assert bytes(modems.carried[0]) == packet(frame_of(1)) + packet(contact)
    assert len(modems.carried[0]) == len(frame_of(1)) + len(contact) + 2 * PACKET_OVERHEAD


def test_noise_strangers_and_contacts_of_nobody_are_not_heard(modems: Modems, lines: list[SerialLine]) -> None:
    mailbox = box()
    lines[0].subscribe("f/position/*", mailbox)
    contact = encode(Position.of_contact(0, 0.0, 3.0, 4.0))
    modems.say(0, packet(contact) + b"AT+RESET\r\n\0" + packet(b"no frame") + packet(frame_of(9)) + packet(contact))
    modems.say(0, packet(frame_of(2)))
    assert take_messages(mailbox, 1) == [(B, frame_of(2))]
    assert mailbox.get() is None


def test_a_stranger_does_not_pass_for_whoever_spoke_before(modems: Modems, lines: list[SerialLine]) -> None:
    mailbox = box()
    lines[0].subscribe("f/position/*", mailbox)
    contact = encode(Position.of_contact(0, 0.0, 3.0, 4.0))
    modems.say(0, packet(frame_of(2)) + packet(frame_of(9)) + packet(contact) + packet(frame_of(3)))
    assert take_messages(mailbox, 2) == [(B, frame_of(2)), (C, frame_of(3))]
    assert mailbox.get() is None


def test_what_a_line_does_not_take_is_dropped_and_never_sent_late(pty: tuple[int, int]) -> None:
    master, slave = pty
    with closing(SerialLine(os.ttyname(slave), 13, CALLERS)) as line:
        post = line.broadcast(A)
        sent = 0
        while line.dropped == 0:
            post(frame_of(1, sent))
            sent += 1
        read = bytearray()
        os.set_blocking(master, False)
        post(frame_of(1, sent))
        while True:
            try:
                read += os.read(master, 65536)
            except BlockingIOError:
                break
        post(frame_of(1, 99_999))
        until = time.monotonic() + PATIENCE_S
        while not read.endswith(packet(frame_of(1, 99_999))) and time.monotonic() < until:
            try:
                read += os.read(master, 65536)
            except BlockingIOError:
                time.sleep(0.01)
    assert read.endswith(b"\0" + packet(frame_of(1, 99_999)))


def test_what_another_program_set_on_a_line_holds_no_frame_back(pty: tuple[int, int]) -> None:
    _, slave = pty
    settings = termios.tcgetattr(slave)
    settings[2] |= termios.CSTOPB | termios.CRTSCTS
    termios.tcsetattr(slave, termios.TCSANOW, settings)
    with closing(SerialLine(os.ttyname(slave), 13, CALLERS)):
        assert termios.tcgetattr(slave)[2] & (termios.CSTOPB | termios.CRTSCTS) == 0


def test_a_line_that_goes_down_drops_frames_and_comes_back(tmp_path: Path) -> None:
    device = tmp_path / "ttyUSB0"
    first, second = os.openpty(), os.openpty()
    tty.setraw(second[1])  # what is not raw yet echoes
    device.symlink_to(os.ttyname(first[1]))
    line = open_serial(f"serial{device}", CALLERS)
    mailbox = box()
    line.subscribe("f/position/*", mailbox)
    post = line.broadcast(A)
    try:
        os.write(first[0], packet(frame_of(2, 1)))
        assert take_messages(mailbox, 1) == [(B, frame_of(2, 1))]
        device.unlink()
        os.close(first[0])
        until = time.monotonic() + PATIENCE_S
        while line.dropped == 0 and time.monotonic() < until:
            post(frame_of(1))
            time.sleep(0.01)
        assert line.dropped > 0
        device.symlink_to(os.ttyname(second[1]))
        while not mailbox.get(0.2) and time.monotonic() < until:
            os.write(second[0], packet(frame_of(2, 2)))
        post(frame_of(1, 3))
        assert packet(frame_of(1, 3)) in os.read(second[0], 4096)
    finally:
        line.close()
        for descriptor in (first[1], *second):
            os.close(descriptor)


@pytest.mark.parametrize("locator", ["serial/dev/null", "serial/no/such/line"])
def test_what_is_no_line_is_said_in_one_line(locator: str) -> None:
    with pytest.raises(SerialDown, match="cannot open /"):
        open_serial(locator, CALLERS)


@pytest.mark.parametrize("locator", ["serial/dev/ttyUSB0", "serial/dev/ttyUSB0#baud=1200"])
def test_a_line_is_a_place_where_robots_hear_each_other(locator: str) -> None:
    assert check_radio(locator, "--radio", "direct") == locator


@pytest.mark.parametrize(
    "locator", ["serial", "serial/dev/ttyUSB0#baud=12345", "serial/dev/tty USB0", "serial/x#baud="]
)
def test_other_lines_are_refused(locator: str) -> None:
    with pytest.raises(BadInput, match="a serial line, serial/dev/ttyUSB0#baud=57600"):
        check_radio(locator, "--radio", "direct")


SENDER = """
import sys
import termios
from runtime.net.serial_line import open_serial
from patrol.radio.message import Position, encode
from patrol.pose import Pose
line = open_serial(f"serial{sys.argv[1]}", {1: "f/position/a", 2: "f/position/b"})
post = line.broadcast("f/position/b")
for k in range(10):
    post(encode(Position.of(2, k, 0.5 * k, Pose(10.0 + k, 20.0, 0.0))))
sys.stdin.read()
line.close()
"""


@pytest.mark.processes
def test_positions_pass_from_one_process_to_another(modems: Modems, lines: list[SerialLine]) -> None:
    mailbox = Mailbox((A, B, C), bytes, longest=64, room=10)
    lines[0].subscribe("f/position/*", mailbox)
    lines[1].close()
    sender = subprocess.Popen([sys.executable, "-c", SENDER, modems.devices[1]], stdin=subprocess.PIPE)
    try:
        heard = take_messages(mailbox, 10)
    finally:
        sender.communicate(timeout=PATIENCE_S)
    assert sender.returncode == 0
    assert [key for key, _ in heard] == [B] * 10
    assert [decode(frame).pose.x for _, frame in heard] == [10.0 + k for k in range(10)]


@pytest.mark.processes
def test_a_fleet_patrols_whose_robots_hear_each_other_over_serial_lines(modems: Modems, tmp_path: Path) -> None:
    radio = {"via": "direct", "trail": 2, "budget": {"bits_per_s": 2400, "overhead": PACKET_OVERHEAD}}
    scenario: dict[str, Any] = {
        **COARSE,
        "duration": 20,
        "pace": 4,
        "robots": [{"name": "a", "model": "holonomic"}, {"name": "b", "model": "holonomic"}],
        "radio": radio,
    }
    hand = Hand(tmp_path)
    hand.write(scenario)
    try:
        hand.start_router()
        hand.start_world("--radio", f"serial{modems.devices[2]}")
        for robot, device in zip(("a", "b"), modems.devices, strict=False):
            hand.start_agent(robot, "--radio", f"serial{device}")
        assert [hand.code(name) for name in ("world", "a", "b")] == [0, 0, 0], hand.said("world")
    finally:
        hand.end()
    summary = json.loads((hand.out / "summary.json").read_text(encoding="utf-8"))
    assert summary["verdict"]["valid"]
    for counts in summary["direct"]["links"].values():
        assert 1 <= counts["heard"] <= counts["sent"] <= 40
    assert summary["messages"]["frames"] >= 1, "the world overhears them too"
    bits = 8 * sum(map(len, modems.carried))
    assert 0 < bits <= 2400 * (20 + 1)


frames = st.binary(min_size=1, max_size=MAX_FRAME)


def test_a_packet_is_the_stuffed_frame_with_its_checksum_and_a_zero() -> None:
    # The catalogues' check value of this CRC-16, of "123456789", is 0xD64E.
    assert packet(b"123456789") == b"\x0c123456789\xd6\x4e\0"
    assert packet(b"\0\0") == b"\x01\x01\x03\xe2\xf0\0"


@given(st.lists(frames, max_size=8), st.integers(1, 80))
def test_frames_arrive_as_they_were_however_the_line_cuts_them(sent: list[bytes], cut: int) -> None:
    line = b"".join(map(packet, sent))
    unpacker = Unpacker()
    assert [frame for at in range(0, len(line), cut) for frame in unpacker.feed(line[at : at + cut])] == sent
    assert unpacker.spoilt == 0


@given(frames)
def test_a_packet_has_one_zero_and_four_bytes_more_than_its_frame(frame: bytes) -> None:
    assert packet(frame).count(END) == 1
    assert len(packet(frame)) == len(frame) + PACKET_OVERHEAD <= MAX_PACKET


@pytest.mark.parametrize("k", range(0, 400, 37))
def test_no_flipped_bit_gives_another_frame_and_the_next_packet_is_whole(k: int) -> None:
    frame = encode(Position.of(1 + k % 5, k, 0.5 * k, Pose(0.37 * k, 256.0, 0.1 * k % 6.0), ((-k, 0), (0, 256))))
    whole = packet(frame)
    for bit in range(8 * len(whole)):
        line = bytearray(whole)
        line[bit // 8] ^= 1 << bit % 8
        unpacker = Unpacker()
        assert list(unpacker.feed(bytes(line) + END + packet(b"next"))) == [b"next"]
        assert unpacker.spoilt >= 1


@given(st.binary(max_size=500), frames)
def test_after_any_noise_and_a_zero_the_next_frame_is_heard(noise: bytes, frame: bytes) -> None:
    assert list(Unpacker().feed(noise + END + packet(frame)))[-1] == frame


@pytest.mark.parametrize("flood", [b"\x01" * 1_000_000, b"\xff" * 1_000_000], ids=["ones", "highest"])
def test_a_flood_without_an_end_is_not_kept(flood: bytes) -> None:
    unpacker = Unpacker()
    for at in range(0, len(flood), 4096):
        assert list(unpacker.feed(flood[at : at + 4096])) == []
        assert len(pickle.dumps(unpacker)) < MAX_PACKET + 200
    assert list(unpacker.feed(END)) == []
    assert unpacker.spoilt == 1
