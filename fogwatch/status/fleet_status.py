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
    """One robot.

    Attributes:
        name: Its name.
        status: Of its process, such as "alive", "paused" or "dead".
        doing: What its mind reports to be doing; empty without a report.
        heard_s: Age of its last position, s; None if none was heard. With a world: as other robots have heard it.
        place: x and y, m; None when unknown.
        tick: The last tick that it has reported; None when unknown.
        wrong: What is wrong with it, and since when; empty if nothing is.
    """

    name: str
    status: str
    doing: str = ""
    heard_s: float | None = None
    place: tuple[float, float] | None = None
    tick: int | None = None
    wrong: str = ""


@dataclass(frozen=True, slots=True)
class WorldStatus:
    """The world that simulates the fleet.

    Attributes:
        tick: The last tick done.
        ticks: Of the whole run.
        time_s: Simulated time, s.
        running: Whether ticks follow each other; False while it is paused.
        ticks_per_s: Ticks per second of wall time.
        ended: Why no more ticks follow; None while more may follow.
    """

    tick: int
    ticks: int | None
    time_s: float
    running: bool
    ticks_per_s: float
    ended: str | None = None


@dataclass(frozen=True, slots=True)
class FleetStatus:
    """A fleet.

    Attributes:
        fleet: Its name.
        router: The locator of its router, which answers.
        world: The world; None where there is none.
        mfow_s: MFoW, s: the true one or, without a world, as the positions heard since the look began have it.
        robots: In roster order or, without a roster, by name.
        faults: Faults in force that operators have requested, as in a scenario.
        warnings: What is wrong with the fleet as a whole.
        unknown: What this look cannot tell, and what would.
    """

    fleet: str
    router: str
    world: WorldStatus | None
    mfow_s: float | None
    robots: tuple[RobotStatus, ...]
    faults: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()

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
        """Listen, then return the state; None when asked to end before there was one.

        Args:
            seconds: How long to listen, s.
        """
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
