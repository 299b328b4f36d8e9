"""The charge of each robot over a run: from the journal's rows into the summary, and from there to people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from patrol.energy.batteries import Batteries
from patrol.journal.records import CHARGING, DOCKING, Status
from patrol.scenario import load_scenario
from patrol.summary.metric import FiguresTable

if TYPE_CHECKING:
    from patrol.journal.records import Event, Header, TickRecord
    from patrol.scenario import Scenario
    from patrol.summary.model import Summary

MOST_NAMED = 40
"""Robots with an empty battery that are named in a line, at most."""


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

    def __init__(self, header: Header, events: Sequence[Event]) -> None:
        """Start before the first tick."""
        del events
        self._step = float(header.scenario["step"])
        self._batteries: Batteries | None = None
        self._robots: dict[int, _Robot] = {}
        self._names = {robot.number: robot.name for robot in header.robots}
        robots = header.scenario.get("robots", {})
        if any(group.get("battery") for group in (robots if isinstance(robots, list) else [robots])):
            # Only where a battery is named: loading takes longer than the rest.
            scenario = load_scenario(header.scenario, opens_classes=False)
            self._batteries = batteries = Batteries(scenario.roster, scenario.docks, scenario.step)
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
            # A stay at a dock counts once, when it begins.
            robot.charges += docked and not robot.was_docked
            robot.docked += docked
            robot.was_docked = docked
            robot.living += row.status is Status.ALIVE
            robot.away += row.status is Status.ALIVE and row.state in (DOCKING, CHARGING)
            if robot.empty is None and batteries.is_empty(row.number):
                robot.empty = record.k

    def figures(self, events: Sequence[Event]) -> dict[str, Any]:
        """Return the summary's `patrol.summary.model.BatteryFigures` of each robot that has a battery."""
        del events
        step = self._step
        batteries = {
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
        return {"robots": {name: {"battery": battery} for name, battery in batteries.items()}}


def battery_lines(summary: Summary) -> list[str]:
    """Describe how far batteries ran down, how often robots charged, and which got empty."""
    batteries = {name: (robot, robot.battery) for name, robot in summary.robots.items() if robot.battery is not None}
    if not batteries:
        return []
    name, (_, lowest) = min(batteries.items(), key=lambda item: item[1][1].least_share)
    charges = sum(battery.charges for _, battery in batteries.values())
    patrol = living = 0.0  # ticks
    for robot, battery in batteries.values():
        ticks = robot.decisions + robot.missed
        patrol, living = patrol + (battery.patrol_share or 0.0) * ticks, living + ticks
    line = f"batteries   least charge {100.0 * lowest.least_share:.0f} % ({name}), charged {charges} times"
    line += f", {100.0 * patrol / max(living, 1.0):.0f} % of the time on patrol"
    empty = [name for name, (_, battery) in batteries.items() if battery.empty_s is not None]
    return [f"{line}; empty: {', '.join(empty[:MOST_NAMED])}" if empty else line]


def battery_table(summary: Summary, scenario: Scenario, end_s: float) -> FiguresTable:
    """Return the charge of each robot that has a battery."""
    del scenario, end_s
    rows = [
        (
            name,
            f"{100.0 * battery.least_share:.0f}",
            f"{100.0 * battery.end_share:.0f}",
            f"{battery.charges}",
            f"{battery.docked_s:.0f}",
            "-" if battery.patrol_share is None else f"{100.0 * battery.patrol_share:.0f}",
            "never" if battery.empty_s is None else f"{battery.empty_s:g}",
        )
        for name, robot in summary.robots.items()
        if (battery := robot.battery) is not None
    ]
    heads = ("robot", "least charge (%)", "at the end (%)", "times charged", "charged for (s)", "on patrol (%)")
    return FiguresTable((*heads, "empty at (s)"), rows, range(1, 7))
