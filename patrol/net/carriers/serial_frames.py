"""Frames on a line of bytes: their beginnings and ends, and the detection of damaged ones.

A *packet* is the frame and its checksum, stuffed so that it holds no zero byte (COBS: consistent overhead byte
stuffing), and a zero byte that ends it: four bytes more than the frame. The checksum is CRC-16 with polynomial 0x1021,
beginning at 0xFFFF, inverted, high byte first. (Not inverted, it would be right again with a zero byte behind it.)
A receiver that begins in the middle of a packet, or gets one spoilt by noise, is in step again at the next zero
byte. The checksum is against noise; against forgers there is the fleet's key.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Iterator

from patrol.radio.message import MAX_FRAME

END = b"\0"
PACKET_OVERHEAD = 4
"""Bytes that a packet has more than its frame, whose length is below 253."""

MAX_PACKET = MAX_FRAME + PACKET_OVERHEAD

_CRC_BYTES = 2
_ALL_ONES = 0xFFFF
_LONGEST_RUN = 254


def packet(frame: bytes) -> bytes:
    """Pack a frame of at most `MAX_FRAME` bytes for the line."""
    return _stuffed(frame + _checksum(frame)) + END


class Unpacker:
    """Finds the frames in a stream of bytes; whatever comes, it keeps no more than `MAX_PACKET` of them.

    `spoilt` counts packets that were no frame.
    """

    def __init__(self) -> None:
        self.spoilt = 0
        self._begun = bytearray()
        self._skips = False

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Take the next bytes, any number, and yield the frames that end in them."""
        *ended, unfinished = data.split(END)
        for piece in ended:
            self._add(piece)
            frame = None if self._skips else _frame_in(bytes(self._begun))
            if frame is not None:
                yield frame
            elif self._begun or self._skips:
                self.spoilt += 1
            self._begun.clear()
            self._skips = False
        self._add(unfinished)

    def _add(self, piece: bytes) -> None:
        if self._skips or len(self._begun) + len(piece) >= MAX_PACKET:
            self._skips = True
            self._begun.clear()
        else:
            self._begun += piece


def _frame_in(stuffed: bytes) -> bytes | None:
    """Unpack the frame in a packet without its end; None where it has arrived wrong."""
    body = _unstuffed(stuffed)
    if body is None or len(body) <= _CRC_BYTES:
        return None
    frame, checksum = body[:-_CRC_BYTES], body[-_CRC_BYTES:]
    return frame if checksum == _checksum(frame) else None


def _checksum(frame: bytes) -> bytes:
    return (crc_hqx(frame, _ALL_ONES) ^ _ALL_ONES).to_bytes(_CRC_BYTES, "big")


def _stuffed(body: bytes) -> bytes:
    """Remove zero bytes: before each run of others stands its length plus one."""
    runs = body.split(END)
    assert all(len(run) < _LONGEST_RUN for run in runs)
    return b"".join(bytes((len(run) + 1,)) + run for run in runs)


def _unstuffed(stuffed: bytes) -> bytes | None:
    """Undo `_stuffed`; return None where the lengths do not add up."""
    runs = []
    begin = 0
    while begin < len(stuffed):
        until = begin + stuffed[begin]
        if until > len(stuffed):
            return None
        runs.append(stuffed[begin + 1 : until])
        begin = until
    return END.join(runs)
