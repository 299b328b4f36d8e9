"""The three named patrols: what each is good for, and what it costs.

    --patrol stochastic    patrol.policy: stochastic, the default
    --patrol paper         patrol.policy: potential-field
    --patrol tour          patrol.policy: committed

All other policies, such as those of the literature, are named by `patrol.policy` alone. One of these is called `tour`
too: the cyclic strategy of the literature (docs/rivals.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from patrol.errors import BadInput, did_you_mean
from patrol.scenario import policies

FIELD = "patrol.policy"

STOCHASTIC = "stochastic"
PAPER = "paper"
TOUR = "tour"


class NamedPatrol(NamedTuple):
    """A patrol that has a short name."""

    policy: str  # value of `patrol.policy`
    price: str  # one line to choose by


PREDICTABLE = "predictable: an intruder that watches gets in more than twice as often as one that does not"
"""The warning of the tour, at the start and the end of each run."""

PATROLS: Mapping[str, NamedPatrol] = MappingProxyType(
    {
        STOCHASTIC: NamedPatrol(policies.STOCHASTIC, "hard to predict, since each next place is drawn; the default"),
        PAPER: NamedPatrol(policies.PAPER, "the paper's final algorithm, with rules of ours where it is open"),
        TOUR: NamedPatrol(policies.COMMITTED, f"the freshest, to clean, inspect or film; {PREDICTABLE}"),
    }
)
"""The patrols by name."""

PRICES = "; ".join(f"{name}: {patrol.price}" for name, patrol in PATROLS.items())
"""All of them in one line, for help texts."""

_NAMES: Mapping[str, str] = MappingProxyType({patrol.policy: name for name, patrol in PATROLS.items()})


def patrol_name(policy: str) -> str:
    """Return the short name of a policy's patrol, ``tour`` for ``committed``, or ``policy NAME`` where it has none.

    For example, `hpcc` has none and gives "policy hpcc".
    """
    return _NAMES.get(policy, f"policy {policy}")


def describe_patrol(policy: str) -> str:
    """Name a run's patrol, and say of the tour that it is predictable."""
    name = patrol_name(policy)
    return f"{name}, {PREDICTABLE}" if name == TOUR else name


def patrol_settings(name: str | None, others: Mapping[str, object]) -> dict[str, object]:
    """Return the settings of a named patrol, by dotted field of the scenario; none for None.

    For example, "tour" gives ``{"patrol.policy": "committed"}``.

    Raises BadInput for an unknown name, and where the other settings, by dotted field, choose a policy too.
    """
    if name is None:
        return {}
    if name not in PATROLS:
        known = did_you_mean(name, list(PATROLS))
        raise BadInput(f"patrol {name}: no such patrol; {known}; for any other policy give --set {FIELD}=POLICY")
    for field in (FIELD, "patrol"):
        if field in others:
            raise BadInput(f"patrol {name}: {field} is set as well, by a preset or by itself; give only one of them")
    return {FIELD: PATROLS[name].policy}
