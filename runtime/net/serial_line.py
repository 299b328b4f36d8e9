"""Positions over a serial line, such as that of a radio modem, without Zenoh: what one writes, all others read.

Only frames are sent, in packets, and no keys: a position says whose it is. A
contact does not; it belongs to the robot whose position came before it. (Zenoh has a link of this kind, but its Python
package is built without it: "Unicast not supported for serial protocol".)

A *packet* is the frame and its checksum, stuffed so that it holds no zero byte (COBS: consistent overhead byte
stuffing), and a zero byte that ends it: four bytes more than the frame. The checksum is CRC-16 with polynomial 0x1021,
beginning at 0xFFFF, inverted, high byte first. (Not inverted, it would be right again with a zero byte behind it.)
A receiver that begins in the middle of a packet, or gets one spoilt by noise, is in step again at the next zero
byte. The checksum is against noise; against forgers there is the fleet's key.
"""

from __future__ import annotations

import fcntl
import os
import select
import struct
import termios
import threading
import tty
from binascii import crc_hqx
from collections.abc import Iterator, Mapping

from patrol.radio.message import CONTACT, MAX_FRAME, MAX_FRAMES, Rejected, decode
from runtime.net.mailbox import Carrier, Post
from runtime.security.keys import SERIAL_LOCATOR, line_speed

END = b"\0"
PACKET_OVERHEAD = 4
"""Bytes that a packet has more than its frame, whose length is below 253."""

MAX_PACKET = MAX_FRAME + PACKET_OVERHEAD

_CRC_BYTES = 2
_ALL_ONES = 0xFFFF
_LONGEST_RUN = 254


def packet(frame: bytes) -> bytes:
    """Pack a frame of at most `MAX_FRAME` bytes for the line.

    For example, a frame of 28 bytes takes 32 on the line.
    """
    return _stuff_bytes(frame + _frame_checksum(frame)) + END


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
            self._add_piece(piece)
            frame = None if self._skips else _frame_in(bytes(self._begun))
            if frame is not None:
                yield frame
            elif self._begun or self._skips:
                self.spoilt += 1
            self._begun.clear()
            self._skips = False
        self._add_piece(unfinished)

    def _add_piece(self, piece: bytes) -> None:
        if self._skips or len(self._begun) + len(piece) >= MAX_PACKET:
            self._skips = True
            self._begun.clear()
        else:
            self._begun += piece


def _frame_in(stuffed: bytes) -> bytes | None:
    """Unpack the frame in a packet without its end; None where it has arrived wrong."""
    body = _unstuff_bytes(stuffed)
    if body is None or len(body) <= _CRC_BYTES:
        return None
    frame, checksum = body[:-_CRC_BYTES], body[-_CRC_BYTES:]
    return frame if checksum == _frame_checksum(frame) else None


def _frame_checksum(frame: bytes) -> bytes:
    return (crc_hqx(frame, _ALL_ONES) ^ _ALL_ONES).to_bytes(_CRC_BYTES, "big")


def _stuff_bytes(body: bytes) -> bytes:
    """Remove zero bytes: before each run of others stands its length plus one.

    For example, the bytes 11 00 22 become 02 11 02 22.
    """
    runs = body.split(END)
    # A longer run would need a second length byte, which frames of `MAX_FRAME` bytes never do.
    assert all(len(run) < _LONGEST_RUN for run in runs)
    return b"".join(bytes((len(run) + 1,)) + run for run in runs)


def _unstuff_bytes(stuffed: bytes) -> bytes | None:
    """Undo `_stuff_bytes`; return None where the lengths do not add up."""
    runs = []
    begin = 0
    while begin < len(stuffed):
        until = begin + stuffed[begin]
        if until > len(stuffed):
            return None
        runs.append(stuffed[begin + 1 : until])
        begin = until
    return END.join(runs)


MAX_WAITING = MAX_FRAMES * MAX_PACKET
"""Bytes that may wait to be sent, those of one tick: when a slow line has more, new frames are dropped, not late."""

_READ = 4096
_AGAIN_S = 1.0


class SerialDown(Exception):
    """A serial line cannot be opened here; one line says why."""


class SerialLine(Carrier):
    """One end of a serial line (`runtime.net.mailbox.Air`). It does not hear its own messages.

    A line that goes down, such as that of an adapter that is unplugged, is opened again when it is back. `dropped`
    counts frames that the line did not take.
    """

    def __init__(self, device: str, speed: int, callers: Mapping[int, str]) -> None:
        """Open the line, or raise SerialDown.

        The speed is a constant of `termios`. `callers` are the keys under which the robots send, by their numbers.
        """
        super().__init__()
        self.dropped = 0
        self._device = device
        self._speed = speed
        self._callers = dict(callers)
        self._writing = threading.Lock()
        self._cut_off = False
        self._last_caller: str | None = None
        self._over = threading.Event()
        self._fd: int | None = None
        try:
            self._fd = _open_line(device, speed)
        except (OSError, termios.error) as error:
            raise SerialDown(f"cannot open {device} ({error.args[-1]})") from None
        self._wakes, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._run_listener, daemon=True)
        self._thread.start()

    def broadcast(self, key: str) -> Post:
        """Make a publisher of frames; one that the line does not take at once is lost.

        The key is not sent: it marks this end's own sender, whose frames `subscribe` leaves out.
        """
        self._own.add(key)
        return self._send_frame

    def close(self) -> bool:
        """Close the line."""
        if not self._over.is_set():
            self._over.set()
            os.write(self._wake, END)
            self._thread.join()
            self._take_down()
            os.close(self._wake)
            os.close(self._wakes)
        return True

    def _send_frame(self, frame: bytes) -> None:
        with self._writing:
            # What came before was cut off, so it is ended first.
            outgoing = (END if self._cut_off else b"") + packet(frame)
            try:
                if self._fd is None or _count_waiting(self._fd) > MAX_WAITING:
                    self.dropped += 1
                    return
                written = os.write(self._fd, outgoing)
            except OSError:  # the line is down, or full
                self.dropped += 1
                return
            # The end byte is missing then, so the next frame would be read as a part of this one.
            self._cut_off = written < len(outgoing)
            self.dropped += self._cut_off

    def _run_listener(self) -> None:
        unpacker = Unpacker()
        while not self._over.is_set():
            if self._fd is None and not self._bring_up():
                self._over.wait(_AGAIN_S)
                continue
            for frame in unpacker.feed(self._read_bytes()):
                self._take_frame(frame)

    def _read_bytes(self) -> bytes:
        """Read the bytes that come next; none when the line has gone down, or it is time to leave."""
        fd = self._fd
        assert fd is not None
        select.select([fd, self._wakes], [], [])
        if self._over.is_set():
            return b""
        try:
            received = os.read(fd, _READ)
        except BlockingIOError:
            return b""
        except OSError:
            received = b""
        if not received:
            self._take_down()
        return received

    def _take_frame(self, frame: bytes) -> None:
        try:
            number = decode(frame).robot
        except Rejected:
            return
        if number != CONTACT:
            self._last_caller = self._callers.get(number)
        if self._last_caller is not None:
            self._deliver_frame(self._last_caller, frame)

    def _bring_up(self) -> bool:
        try:
            fd = _open_line(self._device, self._speed)
        except (OSError, termios.error):
            return False
        with self._writing:
            self._fd = fd
        return True

    def _take_down(self) -> None:
        with self._writing:
            fd, self._fd = self._fd, None
            if fd is not None:
                os.close(fd)


def open_serial(locator: str, callers: Mapping[int, str]) -> SerialLine:
    """Open a serial line, ``serial/DEVICE``, perhaps with ``#baud=SPEED``; raise SerialDown when that fails.

    `callers` are the keys under which the robots send, by their numbers.
    """
    match = SERIAL_LOCATOR.fullmatch(locator)
    speed = None if match is None else line_speed(match[2])
    if match is None or speed is None:
        raise SerialDown("not a serial line; write serial/dev/ttyUSB0#baud=57600")
    return SerialLine(match[1], speed, callers)


def _open_line(device: str, speed: int) -> int:
    """Open a line that passes all bytes as they are, eight bits each, for this process alone."""
    fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        fcntl.ioctl(fd, termios.TIOCEXCL)
        tty.setraw(fd)
        settings = termios.tcgetattr(fd)
        settings[2] |= termios.CLOCAL | termios.CREAD
        settings[2] &= ~(termios.CSTOPB | termios.CRTSCTS)  # an earlier user of the line may have set them
        # The speeds of input and output.
        settings[4] = settings[5] = speed
        termios.tcsetattr(fd, termios.TCSANOW, settings)
        termios.tcflush(fd, termios.TCIOFLUSH)
    except (OSError, termios.error):
        os.close(fd)
        raise
    return fd


def _count_waiting(fd: int) -> int:
    """Count the bytes that the line has taken and not sent yet."""
    waiting: int = struct.unpack("i", fcntl.ioctl(fd, termios.TIOCOUTQ, struct.pack("i", 0)))[0]
    return waiting
