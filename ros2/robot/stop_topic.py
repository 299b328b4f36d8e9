"""The topic that stops a robot: true stops it, false releases it, and whatever cannot be read stops it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ros2.wire.mailbox import Received, RosMailbox
from ros2.wire.messages import Bool

OLDER = "a false on it was sent before the stop, by its sender's clock, and releases nothing; publish it again"
TIMELESS = "a false on it does not say when it was sent, and releases nothing"


@dataclass(frozen=True, slots=True)
class _Stop:
    sent_ns: int
    sender: bytes = b""
    sequence: int | None = None


class StopTopic(RosMailbox[Bool]):
    """Takes in the topic as its messages come, so that a flood pushes nothing out.

    Several nodes may publish there, and a late subscriber gets the last message of each, in any order. So a true always
    stops, and a false releases only what was sent before it. What one sender says is ordered by its own count;
    otherwise the senders' clocks decide, and in doubt the robot stays where it is.

    If `held`, the topic has stopped the robot before this process began; what was sent before then releases nothing.
    `clock` returns the time, ns since the epoch.
    """

    def __init__(self, held: bool, clock: Callable[[], int]) -> None:
        super().__init__()
        self._clock = clock
        self._stop = _Stop(clock()) if held else None
        self._stopped = False
        self._ignored = ""

    def put(self, received: Received[Bool]) -> None:
        """Take in a message; called from any thread."""
        with self._changed:
            if received.message.data:
                # A clock that is ahead must not make a stop that nothing releases.
                now_ns = self._clock()
                sent_ns = now_ns if received.sent_ns is None else min(received.sent_ns, now_ns)
                if self._stop is None or sent_ns >= self._stop.sent_ns:
                    self._stop = _Stop(sent_ns, received.sender, received.sequence)
                self._stopped, self._ignored = True, ""
            elif self._stop is not None:
                self._ignored = self._objection(self._stop, received)
                # Our own clock may have been put back since; then the next false releases.
                kept = replace(self._stop, sent_ns=min(self._stop.sent_ns, self._clock()))
                self._stop = kept if self._ignored else None
        super().put(received)

    def refuse(self, reason: str, line: str) -> None:
        """Take a message that cannot be used for a stop; called from any thread."""
        with self._changed:
            self._stop = _Stop(self._clock())
            self._stopped, self._ignored = True, ""
        super().refuse(reason, line)

    def heed(self) -> tuple[bool, bool, str]:
        """Take the requests that have come since the last call.

        Returns whether the topic stopped the robot in the meantime, whether it holds it now, and why a false has not
        released it, empty if none was ignored.
        """
        with self._changed:
            found = self._stopped, self._stop is not None, self._ignored
            self._stopped, self._ignored = False, ""
            return found

    def _objection(self, stop: _Stop, received: Received[Bool]) -> str:
        """Return why a false does not release the robot; empty if it does."""
        if received.sequence is not None and stop.sequence is not None and received.sender == stop.sender:
            return "" if received.sequence > stop.sequence else OLDER
        if received.sent_ns is None:
            return TIMELESS
        return "" if received.sent_ns > stop.sent_ns else OLDER
