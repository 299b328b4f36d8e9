from __future__ import annotations

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.net.serial_line import END, MAX_PACKET, PACKET_OVERHEAD, Unpacker, packet
from patrol.pose import Pose
from patrol.radio.message import MAX_FRAME, Position, encode

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
