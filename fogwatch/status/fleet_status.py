"""The state of a fleet, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from fogwatch.cli.columns import aligned
from fogwatch.launch.terminal.live_table import duration_text
from patrol.printable import printable


@dataclass(frozen=True, slots=True)
class RobotStatus:
    """The state of one robot."""

    name: str
    status: str  # of its process, such as "alive", "paused" or "dead"
    doing: str = ""  # as its mind reports; empty without a report
    # age of its last position, with a world as other robots heard it; None if none was heard
    heard_s: float | None = None
    place: tuple[float, float] | None = None  # x and y, m; None when unknown
    tick: int | None = None  # last one that it has reported; None when unknown
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
    robots: tuple[RobotStatus, ...]  # in roster order or, without a roster, by name
    faults: tuple[str, ...] = ()  # those in force that operators have requested, as in a scenario
    warnings: tuple[str, ...] = ()  # what is wrong with the fleet as a whole
    unknown: tuple[str, ...] = ()  # what this look cannot tell, and what would

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
        return "\n".join(map(printable, self._lines()))

    def _lines(self) -> Iterator[str]:
        yield f"fleet {self.fleet} at {self.router}"
        yield f"world   {_world_text(self.world)}"
        if self.mfow_s is not None:
            yield f"MFoW    {self.mfow_s:.1f} s{'' if self.world is not None else ', as heard since this look began'}"
        yield ""
        rows = [("robot", "process", "doing", "position", "x m", "y m", "wrong")]
        rows += [
            (
                robot.name,
                robot.status,
                robot.doing or "-",
                "-" if robot.heard_s is None else f"{robot.heard_s:.1f} s ago",
                *(("-", "-") if robot.place is None else (f"{robot.place[0]:.1f}", f"{robot.place[1]:.1f}")),
                robot.wrong,
            )
            for robot in self.robots
        ]
        yield from aligned(rows)
        yield ""
        yield from (f"fault in force: {fault}" for fault in self.faults)
        yield from (f"warning: {warning}" for warning in self.warnings)
        yield from (f"unknown: {unknown}" for unknown in self.unknown)
        yield "all well" if self.well else f"not well: {self._counts()}"

    def _counts(self) -> str:
        wrong, warnings = sum(bool(robot.wrong) for robot in self.robots), len(self.warnings)
        robots = [f"{wrong} of {len(self.robots)} robots"] if wrong else []
        return ", ".join([*robots, *([f"warnings: {warnings}"] if warnings else [])])


class FleetWatch(Protocol):
    """Looks at a fleet, again and again."""

    def look(self, seconds: float) -> FleetStatus | None:
        """Listen, then return the state; None when asked to end before there was one."""
        ...

    def close(self) -> None:
        """Disconnect."""
        ...


def _world_text(world: WorldStatus | None) -> str:
    if world is None:
        return "none"
    at = f"tick {world.tick}" + (f" of {world.ticks}" if world.ticks else "") + f", {duration_text(world.time_s)}"
    if world.ended is not None:
        return f"{at}; ended: {world.ended}"
    return f"{at}; {f'{world.ticks_per_s:.1f} ticks/s' if world.running else 'paused'}"
