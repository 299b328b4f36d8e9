"""The features of scenarios that have figures of their own in a run's summary.

A new one is entered here. The world asks its totals for entries of summary.json, the terminal for its lines, and a
report for its table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from patrol.summary.batteries import BatteryTotals, battery_lines, battery_table
from patrol.summary.closed_out import closed_out_lines, closed_out_table
from patrol.summary.closures import ClosureTotals, closure_lines, closure_table
from patrol.summary.intruders import IntruderTotals, intruder_lines, intruder_table
from patrol.summary.zones import zone_lines, zone_table

if TYPE_CHECKING:
    from patrol.journal.records import Event, Header, TickRecord
    from patrol.scenario import Scenario
    from patrol.summary.metric import FiguresTable
    from patrol.summary.model import Summary


class Totals(Protocol):
    """The totals of a feature, tick by tick."""

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        ...

    def figures(self, events: Sequence[Event]) -> Mapping[str, Any]:
        """Return entries of summary.json, those of robots by name under ``robots``; `events` are all of the run."""
        ...


@dataclass(frozen=True, slots=True)
class Feature:
    """A feature's figures; see the module."""

    name: str  # of its section in a report, which links name; the heading is the same with a capital
    lines: Callable[[Summary], list[str]]  # none in a run without the feature
    table: Callable[[Summary, Scenario, float], FiguresTable]  # by the run's end in s; without rows in such a run
    # made with all events of the run, or with none while it goes on; None where the verdict computes the figures
    totals: Callable[[Header, Sequence[Event]], Totals] | None = None


FEATURES = (
    Feature("zones", zone_lines, zone_table),
    Feature("closures", closure_lines, closure_table, ClosureTotals),
    Feature("closed out", closed_out_lines, closed_out_table),
    Feature("intruders", intruder_lines, intruder_table, IntruderTotals),
    Feature("batteries", battery_lines, battery_table, BatteryTotals),
)
