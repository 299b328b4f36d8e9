"""Distinguishes a router that stands still from robots that are gone.

A stopped router, or one on a stopped machine, keeps its connections, but forwards nothing. So the world asks it a
question that it answers by itself. As long as the answer is due, silence says nothing about robots.
"""

from __future__ import annotations

import math
from collections.abc import Callable

EVERY_S = 1.0
"""Wall time between two questions, s."""
SILENT_S = 1.0
"""Longest time for the router's answer, s."""
SETTLING_S = 2.0
"""Time after the router's return in which tokens of robots that are there may still go, s."""
SAY_S = (3.0, 10.0)
"""Silence of the router after which it is first reported, and time until each next report, s."""


def always() -> bool:
    """Say yes."""
    return True


class RouterWatch:
    """Finds out whether the router answers, by calls of `answers` again and again."""

    def __init__(
        self,
        connected: Callable[[], bool],
        echo: Callable[[], Callable[[], bool]],
        now: Callable[[], float],
        say: Callable[[str], None],
    ) -> None:
        """Start with a router that answers.

        `echo` asks the router something; what it returns says whether the answer has come. `say` reports a line to
        people.
        """
        self._connected = connected
        self._echo = echo
        self._now = now
        self._say = say
        self._back: Callable[[], bool] = always
        self._asked_at = self._returned_at = -math.inf
        self._silent_since: float | None = None
        self._say_at = 0.0
        self._silent_s = 0.0

    @property
    def silent_s(self) -> float:
        """Time for which the router has been silent so far, s of wall time."""
        return self._silent_s + (0.0 if self._silent_since is None else self._now() - self._silent_since)

    def answers(self) -> bool:
        """Return True if the router answers."""
        now = self._now()
        if not self._connected():
            self._back, self._asked_at = always, now  # what was asked is lost; with the next connection ask again
            self._note_silence(now, now)
        elif not self._back():
            if now >= self._asked_at + SILENT_S:
                # Since the question, not since the missing answer was noticed.
                self._note_silence(now, self._asked_at)
        else:
            self._note_return(now)
            # One question at a time: each answer is waited for before the next is asked.
            if now >= self._asked_at + EVERY_S:
                self._asked_at = now
                self._back = self._echo()
        return self._silent_since is None

    def settled(self) -> bool:
        """Return True if the router answers and its other clients have had time to find back to it."""
        return self.answers() and self._now() >= self._returned_at + SETTLING_S

    def _note_silence(self, now: float, since: float) -> None:
        if self._silent_since is None:
            self._silent_since = since
            self._say_at = since + SAY_S[0]
        if now >= self._say_at:
            self._say_at = now + SAY_S[1]
            self._say(f"the router has not answered for {now - self._silent_since:.0f} s: waiting")

    def _note_return(self, now: float) -> None:
        if self._silent_since is None:
            return
        lasted = now - self._silent_since
        # Added up over all silences, for the journal's end.
        self._silent_s += lasted
        self._silent_since, self._returned_at = None, now
        # Only where the silence was reported as well.
        if lasted >= SAY_S[0]:
            self._say(f"the router answers again, after {lasted:.0f} s")
