"""The marks of a scenario on a map, and what they look like at a tick."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from patrol.ground.marks import Moment
from patrol.scenario.explain import SECTIONS
from patrol.values import Section

if TYPE_CHECKING:
    from patrol.changing.ground import Closings
    from patrol.ground.marks import Look, Mark
    from patrol.ground.terrain import Terrain
    from patrol.scenario.model import Scenario

Looks = Mapping[str, Mapping[str, "Look"]]
"""The looks of marks that change, by section and name; all others stay as they are."""


def marks_of(scenario: Scenario | Mapping[str, Any], terrain: Terrain) -> list[Mark]:
    """Return what maps show of a scenario; of one in plain values, other sections may be of another version."""
    marks = []
    for name, section in SECTIONS.items():
        if section.mark is Section.mark:
            continue
        entries = scenario.get(name, ()) if isinstance(scenario, Mapping) else getattr(scenario, name)
        for number, says in enumerate(entries, start=1):
            entry = says if isinstance(says, Section) else section.model_validate(says)
            mark = entry.mark(terrain, number)
            marks += [] if mark is None else [mark._replace(section=name)]
    return marks


def looks_at(scenario: Scenario, k: int, closings: Closings | None = None) -> Looks:
    """Return what a scenario's marks look like at a tick; without `closings` nothing is known to be closed."""
    closed, waiting = (frozenset[str](), frozenset[str]()) if closings is None else closings.at(k)
    moment = Moment(k * scenario.step, closed, waiting)
    return {
        name: {entry.name: entry.look(moment) for entry in getattr(scenario, name)}
        for name, section in SECTIONS.items()
        if section.look is not Section.look
    }
