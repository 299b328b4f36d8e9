"""The charge of each robot over a run, for the summary, read from the journal's rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from patrol.energy.batteries import Batteries
from patrol.journal.records import CHARGING, DOCKING, Status
from patrol.scenario import load_scenario

if TYPE_CHECKING:
    from patrol.journal.records import Header, TickRecord


@dataclass(slots=True)
class _Robot:
    """The totals of one robot's battery; times in ticks."""

    least: float
    end: float
    charges: int = 0
    docked: int = 0
    living: int = 0
    away: int = 0
    empty: int | None = None
    was_docked: bool = False


class BatteryTotals:
    """Follows the batteries of a run tick by tick; see `figures`."""

    def __init__(self, header: Header) -> None:
        """Start before the first tick."""
        self._step = float(header.scenario["step"])
        self._batteries: Batteries | None = None
        self._robots: dict[int, _Robot] = {}
        self._names = {robot.number: robot.name for robot in header.robots}
        robots = header.scenario.get("robots", {})
        if any(group.get("battery") for group in (robots if isinstance(robots, list) else [robots])):
            self._batteries = batteries = Batteries(load_scenario(header.scenario, opens_classes=False))
            for number in batteries.numbers:
                share = batteries.share(number) or 0.0
                self._robots[number] = _Robot(share, share)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        batteries = self._batteries
        if batteries is None:
            return
        batteries.tick(record.robots)
        for row in record.robots:
            robot = self._robots.get(row.number)
            if robot is None:
                continue
            docked = row.number in batteries.docked
            robot.end = batteries.share(row.number) or 0.0
            robot.least = min(robot.least, robot.end)
            robot.charges += docked and not robot.was_docked
            robot.docked += docked
            robot.was_docked = docked
            robot.living += row.status is Status.ALIVE
            robot.away += row.status is Status.ALIVE and row.state in (DOCKING, CHARGING)
            if robot.empty is None and batteries.is_empty(row.number):
                robot.empty = record.k

    def figures(self) -> dict[str, dict[str, Any]]:
        """Return `patrol.summary.model.BatteryFigures` of each robot that has a battery, by name."""
        step = self._step
        return {
            self._names[number]: {
                "least_share": robot.least,
                "end_share": robot.end,
                "charges": robot.charges,
                "docked_s": robot.docked * step,
                "patrol_share": 1.0 - robot.away / robot.living if robot.living else None,
                "empty_s": None if robot.empty is None else robot.empty * step,
            }
            for number, robot in self._robots.items()
        }
