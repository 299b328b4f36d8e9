"""Who has told the robot to stop. Everybody who has must release it before it drives again."""

from __future__ import annotations

from threading import Lock


class Stops:
    """The stops that hold; called from any thread."""

    def __init__(self) -> None:
        self._held: dict[str, str] = {}
        self._lock = Lock()

    def __bool__(self) -> bool:
        return bool(self._held)

    @property
    def why(self) -> str:
        """Who has stopped the robot, and how to release it; empty if nobody has."""
        with self._lock:
            return "; ".join(f"stopped by {who} ({release})" for who, release in self._held.items())

    def hold(self, who: str, release: str) -> bool:
        """Stop.

        Args:
            who: Who says so.
            release: How to release the robot, in a few words.

        Returns:
            Whether that is new.
        """
        with self._lock:
            new = who not in self._held
            self._held[who] = release
            return new

    def release(self, who: str) -> bool:
        """Release what was stopped by somebody; others' stops still hold.

        Args:
            who: Who says so.

        Returns:
            Whether that is new.
        """
        with self._lock:
            return self._held.pop(who, None) is not None
