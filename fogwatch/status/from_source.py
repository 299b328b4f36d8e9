"""The state of a fleet from what a page would show of it (`monitor.observation.source.Source`)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from fogwatch.launch.terminal.live_table import duration_text
from fogwatch.status.fleet_status import FleetStatus, RobotStatus, WorldStatus
from monitor.observation.source import RobotShape, RobotState, Source, State, Static
from patrol.journal.records import Status
from patrol.process.lifeline import Ending

_PROCESS_WRONG = {
    Status.PAUSED: "its process is paused",
    Status.DEAD: "its process was killed",
    Status.LOST: "its process has gone",
}
_NO_WORLD = "the true fog and the true positions: no world simulates these robots"
POLL_S = 0.2


@dataclass(frozen=True, slots=True)
class Look:
    """A fleet as a source shows it."""

    static: Static
    state: State
    observed_s: float  # simulated time for which the source has been observed

    @property
    def forget_after_s(self) -> float:
        """Silence after which robots forget each other, s."""
        return float(self.static.scenario["radio"]["forget_after"])

    @property
    def undecided(self) -> list[str]:
        """Names of the robots that may be silent: their processes are there, and this look was too short to tell."""
        if self.observed_s > self.forget_after_s or self.state.ended is not None:
            return []
        maybe = Status.ALIVE if self.static.has_truth else Status.LOST
        robots = zip(self.static.robots, self.state.robots, strict=True) if self.state.robots else ()
        return [shape.name for shape, robot in robots if robot.status is maybe and robot.heard_s is None]


class SourceWatch:
    """Looks at a source."""

    def __init__(
        self,
        source: Source,
        router: str,
        ending: Ending,
        patience_s: float = 0.0,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take over a source, which `close` closes.

        The first look may take `patience_s` longer while a robot has not been heard. `ending` ends a look early. `now`
        gives the wall clock in s.
        """
        self._source, self._router, self._ending, self._now = source, router, ending, now
        self._patience_s = patience_s
        self._static = source.static()
        self._look: Look | None = None
        self._first_s: float | None = None

    def look(self, seconds: float) -> FleetStatus | None:
        """See `FleetWatch`."""
        until = self._now() + seconds
        longest = until + self._patience_s
        self._patience_s = 0.0
        while (now := self._now()) < until or self._is_undecided(now < longest):
            state = self._source.wait(min(max(until - now, 0.01), POLL_S))
            if state is not None:
                if self._first_s is None:
                    self._first_s = state.time_s
                self._look = Look(self._static, state, state.time_s - self._first_s)
            if self._ending:
                break
        return None if self._look is None else fleet_status(self._look, self._router)

    def _is_undecided(self, may_wait: bool) -> bool:
        """Return whether to look on: there is no state yet, or a robot may be silent in a fleet that goes on."""
        look = self._look
        return look is None or (may_wait and look.state.running and not look.state.gone and bool(look.undecided))

    def close(self) -> None:
        """See `FleetWatch`."""
        self._source.close()


def fleet_status(look: Look, router: str) -> FleetStatus:
    """Judge a fleet as a source shows it."""
    static, state = look.static, look.state
    simulated = static.has_truth
    robots = zip(static.robots, state.robots, strict=True) if state.robots else ()
    return FleetStatus(
        fleet=static.name,
        router=router,
        world=WorldStatus(state.k, static.ticks, state.time_s, state.running, state.ticks_per_s, state.ended)
        if simulated
        else None,
        mfow_s=state.mfow_s,
        robots=tuple(_robot(look, *robot) for robot in robots),
        faults=tuple(" ".join(f"{field}={value}" for field, value in fault.items()) for fault in state.faults),
        warnings=(state.note,) if state.note else (),
        unknown=_unknown(look),
    )


def _unknown(look: Look) -> tuple[str, ...]:
    """Say what the look cannot tell."""
    silent = look.undecided
    heard = f"whether {', '.join(silent)} can be heard: {look.observed_s:.1f} s of this run are too short to tell"
    return (*((heard,) if silent else ()), *(() if look.static.has_truth else (_NO_WORLD,)))


def _robot(look: Look, shape: RobotShape, robot: RobotState) -> RobotStatus:
    return RobotStatus(
        name=shape.name,
        status="silent" if robot.status is Status.LOST and not look.static.has_truth else robot.status.name.lower(),
        doing=robot.state,
        heard_s=robot.heard_s,
        place=None if robot.pose is None else (robot.pose.x, robot.pose.y),
        wrong=_wrong(look, shape, robot),
    )


def _wrong(look: Look, shape: RobotShape, robot: RobotState) -> str:
    """Say what is wrong with a robot; empty if nothing is."""
    simulated = look.static.has_truth
    if robot.status is Status.ABSENT:
        return "" if shape.spare or simulated else "is not there"
    if simulated and robot.status in _PROCESS_WRONG:
        return _PROCESS_WRONG[robot.status]
    if robot.status is Status.LEFT:
        return ""
    heard_s = look.observed_s if robot.heard_s is None else robot.heard_s
    if heard_s > look.forget_after_s:
        since = "" if robot.heard_s is not None else "more than "
        what = "no other robot has heard it" if simulated else "no position"
        return f"{what} for {since}{duration_text(heard_s)}"
    if robot.trapped is not None:
        before = "" if robot.trapped.exact else "before "
        return f"trapped since {before}{duration_text(robot.trapped.since_s)}"
    return robot.radio_wrong
