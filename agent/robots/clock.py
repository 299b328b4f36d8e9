"""The ticks of a fleet as a robot counts them without a world.

Tick k begins at ``epoch + k * step`` on a clock that all robots share, such as Unix time.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from patrol.radio.message import CONTACT, MAX_TIME_MS, Rejected, decode, ms_to_s
from runtime.messages.phases import PHASE_B_SHARE

SET_S = 1.0
"""A wait for a tick that is longer than a step by so much means that the clock was set back, s."""
SAY_AGAIN_S = 10.0
"""Time between two lines about that, and until the clock is read again, s."""


class KeptClock:
    """An `agent.ports.FleetClock` that the robot keeps itself; `why` says why no tick comes, empty if they come."""

    def __init__(
        self,
        step_s: float,
        epoch_s: float,
        now: Callable[[], float],
        leave: Callable[[float], bool],
        say: Callable[[str], None] = lambda _line: None,
    ) -> None:
        """Begin with the current tick; `epoch_s` is when tick 0 began on the shared clock, which `now` reads in s.

        `step_s` is in wall time. `leave` waits for a number of seconds, and returns True as soon as it is time to
        leave. `say` takes a line for people.
        """
        self.why = ""
        self._say = say
        self._step_s = step_s
        self._epoch_s = epoch_s
        self._now = now
        self._leave = leave
        self._k = -1

    def tick(self) -> int | None:
        """Wait for the next tick, skipping those that have passed meanwhile; None when it is time to leave."""
        passed = math.floor((self._now() - self._epoch_s) / self._step_s)
        self._k = max(self._k + 1, passed, 0)
        return None if self._wait_until(self._begin) else self._k

    def decide(self) -> bool:
        """Wait until this tick's positions should have come; False when the tick is over or it is time to leave."""
        if self._wait_until(self._begin + PHASE_B_SHARE * self._step_s):
            return False
        return self._now() < self._begin + self._step_s

    def advance(self, ticks: int) -> None:
        """Count so many ticks more from the next one on, as another robot does that began earlier."""
        self._epoch_s -= ticks * self._step_s

    @property
    def _begin(self) -> float:
        return self._epoch_s + self._k * self._step_s

    def _wait_until(self, moment: float) -> bool:
        """Wait; True when it is time to leave."""
        while (left := moment - self._now()) > 0.0:
            # A tick lies at most a step ahead unless the clock was set back; the first may be long in coming.
            is_back = self._k > 0 and left - self._step_s > SET_S
            self.why = f"the clock was set back, so no tick comes for {left:.0f} s; set it right" if is_back else ""
            if is_back:
                self._say(self.why)
            if self._leave(min(left, SAY_AGAIN_S)):
                return True
        self.why = ""
        return self._leave(0.0)


def epoch_of(frame: bytes, heard_s: float, step_s: float, key: bytes | None = None) -> float | None:
    """Compute when tick 0 began on the shared clock, s, by a position that has just been heard.

    It is None for a frame that holds no robot's position, or a count that no robot follows. With `key` the frame has to
    bear the fleet's tag; without one it may be forged.
    """
    try:
        position = decode(frame, key)
    except Rejected:
        return None
    if position.robot == CONTACT or position.sequence > latest_tick(step_s, heard_s):
        return None
    return heard_s - position.sequence * step_s


def latest_tick(step_s: float, now_s: float) -> int:
    """Return the latest tick to which another robot's count may lead.

    All robots refuse the same counts, whenever they look: those that began before a moment which moves only every ten
    days. Robots that look before and after it has moved can differ. A fleet of up to 29 days is joined at any time, and
    from the latest tick it takes ten days or more until the time no longer fits into frames.
    `step_s` is the wall time of a tick, `now_s` Unix time.
    """
    block_s = 0.2 * ms_to_s(MAX_TIME_MS)
    return int((3.0 * block_s + now_s % block_s) / step_s)
