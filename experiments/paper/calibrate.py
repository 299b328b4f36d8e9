"""The sensor range that the paper does not give: the one whose runs come nearest to its Tables 2 and 3.

MFoW is a maximum, so fine points show slivers that coarse ones hide: a radius belongs to a size of points.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from experiments.paper.tables import PaperSetup, TableComparison, compare, fit_of, paper, plan_of
from experiments.sweeps.plan import Plan
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Fit
from patrol.errors import BadInput


@dataclass(frozen=True, slots=True)
class RadiusFit:
    """How near a radius (m) comes. near: over the cells that the radius is fitted to. whole: over all of them."""

    radius: float
    near: Fit
    whole: Fit

    @property
    def miss(self) -> float:
        """What is minimised: how far the median ratio is from 1, as |ln|."""
        return abs(math.log(self.near.median_ratio))


def radius_setups(
    point: float, radii: Sequence[float], seeds: tuple[int, ...], settings: Mapping[str, object]
) -> dict[str, PaperSetup]:
    """A setup for each radius (m), by the end of its cases' names. BadInput for radii that make no sense."""
    if not radii or any(not math.isfinite(radius) or radius <= 0.0 for radius in radii) or len({*radii}) < len(radii):
        raise BadInput("--ranges: expected different numbers above 0, in m, such as 10,11,12,13,14")
    return {f" range {radius:g}": PaperSetup(point, radius, seeds, settings) for radius in radii}


def calibration_plan(setups: Mapping[str, PaperSetup]) -> Plan:
    """The runs of the tables that a radius is fitted to, with every setup."""
    return plan_of([paper().table(number) for number in paper().fit_tables], setups)


def fit_radii(setups: Mapping[str, PaperSetup], outcome: SweepOutcome) -> list[RadiusFit]:
    """How near each radius comes, in the setups' order; one without any run is left out."""
    found = []
    for end, setup in setups.items():
        beside = [compare(paper().table(number), setup, outcome, end) for number in paper().fit_tables]
        near, whole = fit_of(beside, paper().fit_below), fit_of(beside)
        if near is not None and whole is not None:
            found.append(RadiusFit(setup.sensor_range, near, whole))
    return found


def best_radius(fits: Sequence[RadiusFit]) -> RadiusFit | None:
    """The radius that comes nearest."""
    return min(fits, key=lambda one: one.miss, default=None)


def crossing(fits: Sequence[RadiusFit]) -> float | None:
    """Between the radii tried, where the median ratio passes 1 (linear in its logarithm); None where it does not."""
    ordered = sorted(fits, key=lambda one: one.radius)
    for one, other in itertools.pairwise(ordered):
        a, b = math.log(one.near.median_ratio), math.log(other.near.median_ratio)
        if a == 0.0:
            return one.radius
        if a * b <= 0.0:
            return one.radius + (other.radius - one.radius) * a / (a - b)
    return None


def fits_as_json(point: float, seeds: Sequence[int], fits: Sequence[RadiusFit]) -> dict[str, Any]:
    """For calibration.json."""
    best = best_radius(fits)
    return {
        "point": point,
        "seeds": list(seeds),
        "tables": list(paper().fit_tables),
        "below": paper().fit_below,
        "radius": best.radius if best else None,
        "crossing": crossing(fits),
        "fits": [{"radius": one.radius, "near": asdict(one.near), "all": asdict(one.whole)} for one in fits],
    }


def fit_as_json(comparisons: Sequence[TableComparison]) -> dict[str, Any] | None:
    """The fit of those tables together that a radius is fitted to, for fit.json; None unless all of them are there."""
    wanted = [one for one in comparisons if one.table.number in paper().fit_tables]
    near, whole = fit_of(wanted, paper().fit_below), fit_of(wanted)
    if len(wanted) < len(paper().fit_tables) or near is None or whole is None:
        return None
    return {"tables": list(paper().fit_tables), "below": paper().fit_below, "near": asdict(near), "all": asdict(whole)}
