"""A replay window: which of the last sequences of one sender have been used."""

from __future__ import annotations

SPAN = 64
"""How many sequences are remembered, the newest included."""

_MASK = (1 << SPAN) - 1


class ReplayWindow:
    """The newest sequence used, and which of the `SPAN` - 1 before it were (RFC 4303, 3.4.3, for IPsec).

    A sender's sequences go on with time, also over a restart of the sender, so that a window outlives it.
    """

    __slots__ = ("_used", "newest")

    def __init__(self) -> None:
        self.newest = -1
        self._used = 0

    @classmethod
    def resumed(cls, newest: int, used: int) -> ReplayWindow:
        """A window that goes on from where another one was.

        Args:
            newest: Of the other one.
            used: Of the other one.
        """
        window = cls()
        window.newest, window._used = newest, used & _MASK
        return window

    @property
    def used(self) -> int:
        """Bit i says whether the sequence i before the newest was used."""
        return self._used

    def fresh(self, sequence: int) -> bool:
        """Whether a sequence has not been used yet; one that is older than the window counts as used.

        Args:
            sequence: Of a frame.
        """
        ago = self.newest - sequence
        return ago < 0 or (ago < SPAN and not self._used >> ago & 1)

    def use(self, sequence: int) -> bool:
        """Mark a sequence as used.

        Args:
            sequence: Of a frame.

        Returns:
            Whether it was fresh.
        """
        if not self.fresh(sequence):
            return False
        if sequence > self.newest:
            self._used = (self._used << min(sequence - self.newest, SPAN)) & _MASK
            self.newest = sequence
        self._used |= 1 << (self.newest - sequence)
        return True
