"""Where robots' frames wait, each under the key of its sender."""

from __future__ import annotations

from collections.abc import Mapping

from patrol.net.mailbox import Mailbox
from patrol.radio.message import CONTACT, MAX_FRAME, Rejected, decode


class FrameMailbox(Mailbox[bytes]):
    """Frames that wait, without positions of another robot than the key's: certificates guard keys alone.

    `numbers` are the senders' numbers by key. When more than `room` frames of a sender wait, the oldest is dropped.
    """

    def __init__(self, numbers: Mapping[str, int], room: int = 256) -> None:
        super().__init__(numbers, bytes, MAX_FRAME, room)
        self._numbers = numbers

    def put(self, key: str, message: bytes, size: int = 0) -> None:
        """Put one frame in; called from any thread.

        Bytes that are no frame are put in too, for the reader to refuse.
        """
        try:
            claimed = decode(message).robot
        except Rejected:
            claimed = CONTACT
        if claimed not in (CONTACT, self._numbers.get(key, claimed)):
            self.refused["forged"] += 1
            return
        super().put(key, message, size)
