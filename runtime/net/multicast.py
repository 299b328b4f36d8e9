"""Positions by multicast, without Zenoh: one datagram each, to all processes that can hear it.

A datagram is the key, a zero byte, and the frame. Subscriptions are not announced, so nothing needs to arrive before a
frame does, and nothing but frames is ever sent. Zenoh's own multicast needs no router either, but its members pass
their subscriptions on to each other: where four of them started on a busy machine, that filled the network for ten
seconds.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading

from runtime.net.mailbox import Carrier, Post

_LONGEST = 2048
_POLL_S = 0.2


class GroupDown(Exception):
    """A multicast group cannot be joined here; one line says why."""


class Group(Carrier):
    """A member of a multicast group (`runtime.net.mailbox.Air`). It does not hear its own messages."""

    def __init__(self, out: socket.socket, into: socket.socket, address: tuple[str, int]) -> None:
        super().__init__()
        self._out = out
        self._into = into
        self._address = address
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._hear_frames, daemon=True)
        self._thread.start()

    def broadcast(self, key: str) -> Post:
        """Make a publisher under a key; a frame that the network does not take at once is lost."""
        # The network returns what this host sends to the group.
        self._own.add(key)
        head = key.encode() + b"\0"

        def post(frame: bytes) -> None:
            with contextlib.suppress(OSError):  # the network is down, or full
                self._out.sendto(head + frame, self._address)

        return post

    def close(self) -> bool:
        """Leave the group."""
        if not self._over.is_set():
            self._over.set()
            self._thread.join()
            self._out.close()
            self._into.close()
        return True

    def _hear_frames(self) -> None:
        while not self._over.is_set():
            try:
                datagram = self._into.recv(_LONGEST)
            except OSError:  # nothing came, or the network is down
                continue
            # Keys hold no zero byte, so the first one ends the key.
            head, _, frame = datagram.partition(b"\0")
            self._deliver_frame(head.decode(errors="replace"), frame)


def open_group(locator: str) -> Group:
    """Join a group, ``udp/GROUP:PORT``, perhaps with ``#iface=NAME``; raise GroupDown when that fails."""
    address, _, iface = locator.removeprefix("udp/").partition("#iface=")
    group, _, port = address.partition(":")
    out, into = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    try:
        index = socket.if_nametoindex(iface) if iface else 0
        out.setblocking(False)
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, struct.pack("4s4si", bytes(4), bytes(4), index))
        into.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        into.bind((group, int(port)))
        member = struct.pack("4s4si", socket.inet_aton(group), bytes(4), index)
        into.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
        into.settimeout(_POLL_S)
    except OSError as error:
        out.close()
        into.close()
        raise GroupDown(f"cannot join the group at {locator} ({error.strerror or error})") from None
    return Group(out, into, (group, int(port)))
