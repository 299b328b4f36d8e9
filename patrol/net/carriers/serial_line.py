"""Positions over a serial line, such as that of a radio modem, without Zenoh: what one writes, all others read.

Only frames are sent, packed as `patrol.net.carriers.serial_frames` says, and no keys: a position says whose it is. A
contact does not; it belongs to the robot whose position came before it. (Zenoh has a link of this kind, but its Python
package is built without it: "Unicast not supported for serial protocol".)
"""

from __future__ import annotations

import fcntl
import os
import re
import select
import struct
import termios
import threading
import tty
from collections.abc import Mapping
from typing import Any

from patrol.net.carriers.multicast import Datagram
from patrol.net.carriers.serial_frames import END, MAX_PACKET, Unpacker, packet
from patrol.net.mailbox import Mailbox, Post
from patrol.radio.message import CONTACT, MAX_FRAMES, Rejected, decode

DEFAULT_BAUD = 57600
MAX_WAITING = MAX_FRAMES * MAX_PACKET
"""Bytes that may wait to be sent, those of one tick: when a slow line has more, new frames are dropped, not late."""

_LOCATOR = re.compile(r"serial(/[^\s#]+)(?:#baud=(\d{1,8}))?")
_READ = 4096
_AGAIN_S = 1.0


class SerialDown(Exception):
    """A serial line cannot be opened here; one line says why."""


def is_serial(locator: str) -> bool:
    """Return True if a locator is that of a serial line, at a speed that this system has.

    It is ``serial/DEVICE``, perhaps with ``#baud=SPEED``.
    """
    match = _LOCATOR.fullmatch(locator)
    return match is not None and _speed(match[2]) is not None


class SerialLine:
    """One end of a serial line (`patrol.net.mailbox.Air`). It does not hear what it sends itself.

    A line that goes down, such as that of an adapter that is unplugged, is opened again when it is back. `dropped`
    counts frames that the line did not take.
    """

    def __init__(self, device: str, speed: int, callers: Mapping[int, str]) -> None:
        """Open the line, or raise SerialDown.

        The speed is a constant of `termios`. `callers` are the keys under which the robots send, by their numbers.
        """
        self.dropped = 0
        self._device = device
        self._speed = speed
        self._callers = dict(callers)
        self._own: set[str] = set()
        self._subscriptions: list[tuple[str, Mailbox[Any]]] = []
        self._writing = threading.Lock()
        self._cut_off = False
        self._last_caller: str | None = None
        self._over = threading.Event()
        self._fd: int | None = None
        try:
            self._fd = _opened(device, speed)
        except (OSError, termios.error) as error:
            raise SerialDown(f"cannot open {device} ({error.args[-1]})") from None
        self._wakes, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def broadcast(self, key: str) -> Post:
        """Make a publisher of frames; one that the line does not take at once is lost.

        The key is not sent: it marks this end's own sender, whose frames `subscribe` leaves out.
        """
        self._own.add(key)
        return self._send

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Put frames into a mailbox, under one key or, where it ends in ``*``, under all that begin like it."""
        self._subscriptions.append((key, mailbox))

    def close(self) -> bool:
        """Close the line."""
        if not self._over.is_set():
            self._over.set()
            os.write(self._wake, END)
            self._thread.join()
            self._down()
            os.close(self._wake)
            os.close(self._wakes)
        return True

    def _send(self, frame: bytes) -> None:
        with self._writing:
            # What came before was cut off, so it is ended first.
            data = (END if self._cut_off else b"") + packet(frame)
            try:
                if self._fd is None or _waiting(self._fd) > MAX_WAITING:
                    self.dropped += 1
                    return
                written = os.write(self._fd, data)
            except OSError:  # the line is down, or full
                self.dropped += 1
                return
            self._cut_off = written < len(data)
            self.dropped += self._cut_off

    def _listen(self) -> None:
        unpacker = Unpacker()
        while not self._over.is_set():
            if self._fd is None and not self._up():
                self._over.wait(_AGAIN_S)
                continue
            for frame in unpacker.feed(self._read()):
                self._deliver(frame)

    def _read(self) -> bytes:
        """Read the bytes that come next; none when the line has gone down, or it is time to leave."""
        fd = self._fd
        assert fd is not None
        select.select([fd, self._wakes], [], [])
        if self._over.is_set():
            return b""
        try:
            data = os.read(fd, _READ)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._down()
        return data

    def _deliver(self, frame: bytes) -> None:
        try:
            number = decode(frame).robot
        except Rejected:
            return
        if number != CONTACT:
            self._last_caller = self._callers.get(number)
        key = self._last_caller
        if key is None or key in self._own:
            return
        for pattern, mailbox in list(self._subscriptions):
            if key == pattern or (pattern.endswith("*") and key.startswith(pattern[:-1])):
                mailbox.deliver(key, Datagram(frame))

    def _up(self) -> bool:
        try:
            fd = _opened(self._device, self._speed)
        except (OSError, termios.error):
            return False
        with self._writing:
            self._fd = fd
        return True

    def _down(self) -> None:
        with self._writing:
            fd, self._fd = self._fd, None
            if fd is not None:
                os.close(fd)


def open_serial(locator: str, callers: Mapping[int, str]) -> SerialLine:
    """Open a serial line, ``serial/DEVICE``, perhaps with ``#baud=SPEED``; raise SerialDown when that fails.

    `callers` are the keys under which the robots send, by their numbers.
    """
    match = _LOCATOR.fullmatch(locator)
    speed = None if match is None else _speed(match[2])
    if match is None or speed is None:
        raise SerialDown("not a serial line; write serial/dev/ttyUSB0#baud=57600")
    return SerialLine(match[1], speed, callers)


def _speed(baud: str | None) -> int | None:
    """Return the number by which `termios` knows a speed; None for one that it does not have."""
    speed: int | None = getattr(termios, f"B{int(baud or DEFAULT_BAUD)}", None)
    return speed or None


def _opened(device: str, speed: int) -> int:
    """Open a line that passes all bytes as they are, eight bits each, for this process alone."""
    fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        fcntl.ioctl(fd, termios.TIOCEXCL)
        tty.setraw(fd)
        settings = termios.tcgetattr(fd)
        settings[2] |= termios.CLOCAL | termios.CREAD
        settings[2] &= ~(termios.CSTOPB | termios.CRTSCTS)  # an earlier user of the line may have set them
        settings[4] = settings[5] = speed
        termios.tcsetattr(fd, termios.TCSANOW, settings)
        termios.tcflush(fd, termios.TCIOFLUSH)
    except (OSError, termios.error):
        os.close(fd)
        raise
    return fd


def _waiting(fd: int) -> int:
    """Count the bytes that the line has taken and not sent yet."""
    waiting: int = struct.unpack("i", fcntl.ioctl(fd, termios.TIOCOUTQ, struct.pack("i", 0)))[0]
    return waiting
