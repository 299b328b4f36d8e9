"""The state of a fleet, from what a page would show of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from fogwatch.cli.columns import aligned
from fogwatch.terminal.live_table import duration_text
from monitor.live.attach import NoAnswer
from monitor.observation.source import RobotShape, RobotState, Source, State, Static
from patrol.errors import printable
from patrol.journal.records import Status
from runtime.process.lifeline import Ending


@dataclass(frozen=True, slots=True)
class RobotStatus:
    """The state of one robot."""

    name: str
    status: str  # of its process, such as "alive", "paused" or "dead"
    doing: str = ""  # as its mind reports; empty without a report
    # age of its last position, with a world as other robots heard it; None if none was heard
    heard_s: float | None = None
    place: tuple[float, float] | None = None  # x and y, m; None when unknown
    wrong: str = ""  # what is wrong with it, and since when; empty if nothing is


@dataclass(frozen=True, slots=True)
class WorldStatus:
    """The world that simulates the fleet."""

    tick: int  # last one done
    ticks: int | None  # of the whole run; None when unknown
    time_s: float  # simulated
    running: bool  # False while it is paused
    ticks_per_s: float  # per second of wall time
    ended: str | None = None  # why no more ticks follow; None while more may follow


@dataclass(frozen=True, slots=True)
class FleetStatus:
    """The state of a fleet."""

    fleet: str
    router: str  # locator of its router, which answers
    world: WorldStatus | None  # None where there is none
    mfow_s: float | None  # the true one; without a world, by the positions heard since the look began
    robots: tuple[RobotStatus, ...]  # in roster order; none while a world gives no answer
    faults: tuple[str, ...] = ()  # those in force that operators have requested, as in a scenario
    warnings: tuple[str, ...] = ()  # what is wrong with the fleet as a whole
    unknown: tuple[str, ...] = ()  # what this look cannot tell, and what would
    has_world: bool = True  # False if there is no world; one that is there may give no answer

    @property
    def well(self) -> bool:
        """True if nothing is known to be wrong."""
        return not self.warnings and not any(robot.wrong for robot in self.robots)

    @property
    def is_over(self) -> bool:
        """True if its world has ended the run."""
        return self.world is not None and self.world.ended is not None

    def as_json(self) -> dict[str, Any]:
        """Return the state as JSON has it."""
        return {"well": self.well, **asdict(self)}

    def as_text(self) -> str:
        """Write the state for people, in lines."""
        return "\n".join(map(printable, self._status_lines()))

    def _status_lines(self) -> Iterator[str]:
        yield f"fleet {self.fleet} at {self.router}"
        yield f"world   {_world_text(self.world) if self.world or not self.has_world else 'is there'}"
        if self.mfow_s is not None:
            yield f"MFoW    {self.mfow_s:.1f} s{'' if self.world is not None else ', as heard since this look began'}"
        yield ""
        rows = [("robot", "process", "doing", "position", "x m", "y m", "wrong")]
        for robot in self.robots:
            heard_text = "-" if robot.heard_s is None else f"{robot.heard_s:.1f} s ago"
            x, y = ("-", "-") if robot.place is None else (f"{robot.place[0]:.1f}", f"{robot.place[1]:.1f}")
            rows.append((robot.name, robot.status, robot.doing or "-", heard_text, x, y, robot.wrong))
        yield from aligned(rows if self.robots else [])
        yield ""
        yield from (f"fault in force: {fault}" for fault in self.faults)
        yield from (f"warning: {warning}" for warning in self.warnings)
        yield from (f"unknown: {unknown}" for unknown in self.unknown)
        wrong, warnings = sum(bool(robot.wrong) for robot in self.robots), len(self.warnings)
        problems = [f"{wrong} of {len(self.robots)} robots"] * bool(wrong) + [f"warnings: {warnings}"] * bool(warnings)
        yield f"not well: {', '.join(problems)}" if problems else "all well"


def _world_text(world: WorldStatus | None) -> str:
    if world is None:
        return "none"
    progress = f"tick {world.tick}" + (f" of {world.ticks}" if world.ticks else "") + f", {duration_text(world.time_s)}"
    if world.ended is not None:
        return f"{progress}; ended: {world.ended}"
    return f"{progress}; {f'{world.ticks_per_s:.1f} ticks/s' if world.running else 'paused'}"


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
    def robots(self) -> Iterator[tuple[RobotShape, RobotState]]:
        """The robots, each with its state; none while a world gives no answer."""
        return zip(self.static.robots, self.state.robots, strict=bool(self.state.robots))

    @property
    def forget_after_s(self) -> float:
        """Silence after which robots forget each other, s."""
        return float(self.static.scenario["radio"]["forget_after"])

    @property
    def is_alone(self) -> bool:
        """True if no two robots are there that could hear each other."""
        return self.static.has_truth and sum(robot.status is Status.ALIVE for robot in self.state.robots) < 2

    @property
    def undecided(self) -> list[str]:
        """Names of the robots that may be silent: their processes are there, and this look was too short to tell."""
        if self.observed_s > self.forget_after_s or self.state.ended is not None or self.is_alone:
            return []
        maybe = Status.ALIVE if self.static.has_truth else Status.LOST
        return [shape.name for shape, robot in self.robots if robot.status is maybe and robot.heard_s is None]


class FleetWatch:
    """Looks at a fleet, again and again."""

    def __init__(
        self,
        open_source: Callable[[], Source | None],
        fleet: str,
        router: str,
        ending: Ending,
        patience_s: float = 0.0,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Looks call `open_source` until it returns a source, which `close` closes; it returns None when asked to end.

        It raises NoAnswer for a world that is there and gives no answer yet. The first look may take `patience_s`
        longer while a robot has not been heard. `ending` ends a look early. `now` gives the wall clock in s.
        """
        self._open_source, self._fleet, self._router, self._ending = open_source, fleet, router, ending
        self._now, self._patience_s = now, patience_s
        self._source: Source | None = None
        self._look: Look | None = None
        self._first_s: float | None = None

    def look(self, seconds: float) -> FleetStatus | None:
        """Listen, then return the state; None when asked to end before there was one."""
        try:
            source = self._source = self._source or self._open_source()
        except NoAnswer as known:
            return FleetStatus(self._fleet, self._router, None, None, (), warnings=(known.waits,))
        if source is None:
            return None
        static, until = source.static(), self._now() + seconds
        longest = until + self._patience_s
        self._patience_s = 0.0
        while (now := self._now()) < until or self._is_undecided(now < longest):
            state = source.wait(min(max(until - now, 0.01), POLL_S))
            if state is not None:
                if self._first_s is None:
                    self._first_s = state.time_s
                self._look = Look(static, state, state.time_s - self._first_s)
            if self._ending:
                break
        return None if self._look is None else fleet_status(self._look, self._router)

    def _is_undecided(self, may_wait: bool) -> bool:
        """Return whether to look on: there is no state yet, or a robot may be silent in a fleet that goes on."""
        look = self._look
        if look is None:
            return True
        halted = look.static.has_truth and look.state.note  # whom it waits for, or that it has disconnected
        return may_wait and look.state.running and not halted and bool(look.undecided)

    def close(self) -> None:
        """Disconnect."""
        if self._source is not None:
            self._source.close()


def fleet_status(look: Look, router: str) -> FleetStatus:
    """Judge a fleet as a source shows it."""
    static, state = look.static, look.state
    simulated = static.has_truth
    world = WorldStatus(state.k, static.ticks, state.time_s, state.running, state.ticks_per_s, state.ended)
    silent = look.undecided
    stands = simulated and state.running and state.pace is None and look.observed_s == 0.0
    note = state.note or ("no tick has gone by while this look listened" if stands else "")
    notice = f"whether {', '.join(silent)} can be heard: {look.observed_s:.1f} s of this run are too short to tell"
    return FleetStatus(
        fleet=static.name,
        router=router,
        world=world if simulated else None,
        mfow_s=state.mfow_s,
        robots=tuple(_robot_status(look, *robot) for robot in look.robots),
        faults=tuple(" ".join(f"{field}={value}" for field, value in fault.items()) for fault in state.faults),
        warnings=(note,) if note else (),
        unknown=(*([notice] if silent else []), *([] if simulated else [_NO_WORLD])),
        has_world=simulated,
    )


def _robot_status(look: Look, shape: RobotShape, robot: RobotState) -> RobotStatus:
    # Without a world, a robot that is stopped or silent has a process that lives.
    words = {} if look.static.has_truth else {Status.LOST: "silent", Status.PAUSED: "alive"}
    return RobotStatus(
        name=shape.name,
        status=words.get(robot.status, robot.status.name.lower()),
        doing=robot.state,
        heard_s=robot.heard_s,
        place=None if robot.pose is None else (robot.pose.x, robot.pose.y),
        wrong=_robot_problem(look, shape, robot),
    )


def _robot_problem(look: Look, shape: RobotShape, robot: RobotState) -> str:
    """Say what is wrong with a robot; empty if nothing is."""
    simulated = look.static.has_truth
    if robot.status is Status.ABSENT:
        return "" if shape.spare or simulated else "is not there"
    if simulated and robot.status in _PROCESS_WRONG:
        return _PROCESS_WRONG[robot.status]
    if robot.status in (Status.LEFT, Status.PAUSED):
        return robot.state if robot.status is Status.PAUSED else ""  # without a world: stopped, and by whom
    heard_s = look.observed_s if robot.heard_s is None else robot.heard_s
    if heard_s > look.forget_after_s and not look.is_alone:
        since = "" if robot.heard_s is not None else "more than "
        problem = "no other robot has heard it" if simulated else "no position"
        return f"{problem} for {since}{duration_text(heard_s)}"
    if robot.trapped is not None:
        before = "" if robot.trapped.exact else "before "
        return f"trapped since {before}{duration_text(robot.trapped.since_s)}"
    return robot.radio_wrong
