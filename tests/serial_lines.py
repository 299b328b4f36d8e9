"""A radio modem for each of several robots, made of pseudo-terminals: what one writes, all others read."""

import contextlib
import os
import select
import threading
import tty


class Modems:
    """Pairs of a pseudo-terminal, each the serial line of one robot, and a thread that passes bytes between them.

    Attributes:
        devices: The files that robots open.
        carried: All bytes that have been written, by line.
    """

    def __init__(self, count: int) -> None:
        pairs = [os.openpty() for _ in range(count)]
        for _, line in pairs:
            tty.setraw(line)
        self.devices = [os.ttyname(line) for _, line in pairs]
        self.carried = [bytearray() for _ in pairs]
        self._masters = [master for master, _ in pairs]
        self._lines = [line for _, line in pairs]
        self._wakes, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._pass_on, daemon=True)
        self._thread.start()

    def say(self, line: int, data: bytes) -> None:
        """Let a robot's modem receive bytes.

        Args:
            line: Its place among the devices.
            data: Any.
        """
        os.write(self._masters[line], data)

    def close(self) -> None:
        """Unplug everything."""
        os.write(self._wake, b"\0")
        self._thread.join()
        for descriptor in (*self._masters, *self._lines, self._wake, self._wakes):
            os.close(descriptor)

    def _pass_on(self) -> None:
        while True:
            ready, _, _ = select.select([*self._masters, self._wakes], [], [])
            if self._wakes in ready:
                return
            for master in ready:
                data = os.read(master, 4096)
                self.carried[self._masters.index(master)] += data
                for other in self._masters:
                    if other != master:
                        with contextlib.suppress(BlockingIOError):
                            os.write(other, data)
