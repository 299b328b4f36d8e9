"""Calibration of the sensor range, which the paper does not give: the one that fits its Tables 2 and 3 best.

MFoW is a maximum, and fine points reveal slivers that coarse ones hide, so each size of points has its own range.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from experiments.paper.printed import paper
from experiments.paper.tables import PaperSetup, TableComparison, compare, fit_of, plan_of
from experiments.sweeps.plan import Plan
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Fit
from patrol.errors import BadInput


@dataclass(frozen=True, slots=True)
class RadiusFit:
    """The fit of a sensor range."""

    radius: float  # the sensor range, m
    near: Fit  # over the cells that the range is fitted to
    whole: Fit  # over all cells

    @property
    def miss(self) -> float:
        """The quantity to minimise: |ln| of the median ratio."""
        return abs(math.log(self.near.median_ratio))


def radius_setups(
    point: float, radii: Sequence[float], seeds: tuple[int, ...], settings: Mapping[str, object]
) -> dict[str, PaperSetup]:
    """Return a setup for each sensor range, by the ends of their cases' names.

    `point`, the side of one grid point, and the ranges are in m. `settings` are of every cell, by dotted field.
    """
    if not radii or any(not math.isfinite(radius) or radius <= 0.0 for radius in radii) or len({*radii}) < len(radii):
        raise BadInput("--ranges: expected different numbers above 0, in m, such as 10,11,12,13,14")
    return {f" range {radius:g}": PaperSetup(point, radius, seeds, settings) for radius in radii}


def calibration_plan(setups: Mapping[str, PaperSetup]) -> Plan:
    """Return the runs of the tables that the range is fitted to."""
    return plan_of([paper().table(number) for number in paper().fit_tables], setups)


def fit_radii(setups: Mapping[str, PaperSetup], outcome: SweepOutcome) -> list[RadiusFit]:
    """Compute the fit of each sensor range, in the setups' order; ranges without results are left out."""
    fits = []
    for end, setup in setups.items():
        beside = [compare(paper().table(number), setup, outcome, end) for number in paper().fit_tables]
        near, overall = fit_of(beside, paper().fit_below), fit_of(beside)
        if near is not None and overall is not None:
            fits.append(RadiusFit(setup.sensor_range, near, overall))
    return fits


def best_radius(fits: Sequence[RadiusFit]) -> RadiusFit | None:
    """Return the sensor range that fits best."""
    return min(fits, key=lambda one: one.miss, default=None)


def crossing(fits: Sequence[RadiusFit]) -> float | None:
    """Return the sensor range at which the median ratio is 1, interpolated linearly in its logarithm.

    It is in m; None if the ratio does not pass 1 between the ranges that were tried.
    """
    ordered = sorted(fits, key=lambda one: one.radius)
    for smaller, larger in itertools.pairwise(ordered):
        a, b = math.log(smaller.near.median_ratio), math.log(larger.near.median_ratio)
        if a == 0.0:
            return smaller.radius
        if a * b <= 0.0:
            return smaller.radius + (larger.radius - smaller.radius) * a / (a - b)
    return None


def fits_as_json(point: float, seeds: Sequence[int], fits: Sequence[RadiusFit]) -> dict[str, Any]:
    """Return the content of calibration.json."""
    best = best_radius(fits)
    return {
        "point": point,
        "seeds": list(seeds),
        "tables": list(paper().fit_tables),
        "below": paper().fit_below,
        "radius": best.radius if best else None,
        "crossing": crossing(fits),
        "fits": [{"radius": fit.radius, "near": asdict(fit.near), "all": asdict(fit.whole)} for fit in fits],
    }


def fit_as_json(comparisons: Sequence[TableComparison]) -> dict[str, Any] | None:
    """Return the content of fit.json: the fit of the tables together that the sensor range is fitted to.

    None unless all those tables were run.
    """
    wanted = [comparison for comparison in comparisons if comparison.table.number in paper().fit_tables]
    near, overall = fit_of(wanted, paper().fit_below), fit_of(wanted)
    if len(wanted) < len(paper().fit_tables) or near is None or overall is None:
        return None
    return {
        "tables": list(paper().fit_tables),
        "below": paper().fit_below,
        "near": asdict(near),
        "all": asdict(overall),
    }
