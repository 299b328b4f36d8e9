"""The numbers that a page states for constants are those of the code.

A constant that is halved, doubled or off by a step no longer agrees with its page.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"

PAGES = ("algorithm.md", "progress.md")

STATED: tuple[tuple[str, str, str, float], ...] = (
    # module, constant, the words of a page with its value in place of {}, and the page's unit in the code's
    ("agent.policies.choice", "NEAR_M", "a^2 / (L + {} m)", 1.0),
    ("agent.policies.pursuit", "NO_NEARER_S", "has come no nearer for {} s (", 1.0),
    ("agent.policies.pursuit", "AT_HAND_S", "s ({} s while less than a stride away)", 1.0),
    ("agent.policies.pursuit", "LEFT_OUT_S", "leaves out that place for {} s, and twice", 1.0),
    ("agent.policies.pursuit", "LONGEST_S", "each further time, up to {} s;", 1.0),
    ("agent.policies.commitment", "RANDOM_MOVE", "stay in free choices, at {} % of ticks", 100.0),
    ("patrol.tours.round", "STRETCH", "less than {} sensor ranges along it from the first one (`STRETCH`)", 1.0),
    ("agent.policies.stochastic", "CHOICES", "up to {} near ones (`CHOICES`)", 1.0),
    ("agent.policies.stochastic", "STALE", "older than {} (`STALE`)", 1.0),
    ("agent.policies.stochastic", "MOVES", "by {} small moves (`MOVES`)", 1.0),
    ("agent.policies.stochastic", "SPELL", "stays the same for {} (`SPELL`)", 1.0),
    ("agent.policies.stochastic", "SPREAD", "{} (`SPREAD`) of the mean time", 1.0),
    ("agent.policies.stochastic", "TURNED", "by {} ranges of the sensor (`TURNED`)", 1.0),
    ("agent.policies.stochastic", "PERIOD_S", "Every {} s (`PERIOD_S`)", 1.0),
    ("agent.policies.stochastic", "MOVES_FIRST", "with {} moves for each station (`MOVES_FIRST`)", 1.0),
    ("agent.policies.stochastic", "STUCK_S", "stood still for {} s (`STUCK_S`)", 1.0),
    ("patrol.measures.best_tour", "CROWDED", "than {} (`CROWDED`)", 1.0),
    ("agent.policies.shared_round", "LOSSES_S", "over about the last {} s more than", 1.0),
    ("agent.policies.shared_round", "LOSSY", "more than {} % of positions were lost (`LOSSY`", 100.0),
    ("patrol.zones.division", "KEPT", "for a wanted age times {} more (`KEPT`)", 1.0),
    ("agent.policies.committed", "PERIOD_S", "After a period of {} s with an MFoW", 1.0),
    ("agent.policies.committed", "BROKEN", "with an MFoW of {} (`BROKEN`) times", 1.0),
    ("patrol.measures.best_tour", "MOST_ROBOTS", "in a fleet of more than {} robots", 1.0),
    ("patrol.tours.search", "MOST_POINTS", "too large for the search ({} million points", 1e-6),
    ("agent.bodies.manoeuvre", "REVERSE", "Reverse costs {} times forward", 1.0),
    ("agent.bodies.manoeuvre", "GEAR_CHANGE", "a change of gear {} turning radii", 1.0),
    ("agent.bodies.manoeuvre", "ASKEW", "or {} rad. 4. **Bumps.**", 1.0),
    ("agent.bodies.standoff", "CALM_S", "those within {} s of each other add up", 1.0),
    ("agent.bodies.standoff", "STILL_S", "after {} s of bumps it gives way as well", 1.0),
    ("agent.bodies.standoff", "AGAIN_S", "block each other again within {} s", 1.0),
    ("agent.bodies.standoff", "BACKS_OFF_S", "for up to {} s to a place that is drawn", 1.0),
    ("agent.bodies.differential", "ASKEW", "a misalignment of up to {} rad", 1.0),
    ("agent.bodies.differential", "GENTLY", "{} of it each step", 1.0),
    ("patrol.measures.stays", "TRAPPED_S", "until the stay has lasted {} s;", 1.0),
)


def words(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize(("module", "name", "says", "unit"), STATED, ids=lambda value: str(value)[:40])
def test_a_constant_is_what_its_page_says(module: str, name: str, says: str, unit: float) -> None:
    page = words("\n".join((DOCS / page_name).read_text(encoding="utf-8") for page_name in PAGES))
    value = getattr(import_module(module), name)
    assert says.format(f"{unit * value:g}") in page
    for other in (0.5 * value, 2.0 * value, 1.01 * value):
        assert says.format(f"{unit * other:g}") not in page
