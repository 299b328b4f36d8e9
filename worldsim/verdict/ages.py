"""The ages of the ground of each zone in a run, and of ground while it was open to view, recomputed from the poses."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from patrol.changing.open_ground import STANDING, OpenAges
from patrol.ground.marks import middle
from patrol.measures.zoned import MOST_KEPT, ZonedGround, best_weighted_s, zone_weights
from patrol.summary.model import ClosedOut, ZoneFigures
from patrol.zones.spec import ELSEWHERE, Weighing, points_of, weighing_at, zones_in_force
from worldsim.checks.check import JournalReading
from worldsim.checks.ground import GroundOpen, TrueFog

if TYPE_CHECKING:
    from patrol.ground.terrain import BoolGrid
    from patrol.journal import TickRecord
    from patrol.measures.zoned import Weights
    from worldsim.checks.check import JudgedRun

STANDING_EVENTS = tuple(status.name.lower() for status in STANDING)
"""Events after which a robot's body may stand in the way of others."""

Ages = NDArray[np.float64]
"""(ticks,), s: the age of the stalest point of some ground in each tick, NaN where it does not count."""


@dataclass(frozen=True, eq=False)
class ZoneFacts:
    """The ages of the ground of a run's zones that weigh and were in force, and of the ground in none of them."""

    figures: dict[str, Any]  # entries of the summary
    ages_s: dict[str, Ages]  # by name


@dataclass(frozen=True, eq=False)
class OpenFacts:
    """The ages of ground while it was open to view, in a run in which some was not."""

    figures: dict[str, Any]  # entries of the summary
    ages_s: Ages  # greatest open age in each tick
    zones_s: dict[str, Ages]  # the same by zone with a wanted age


@dataclass(slots=True)
class _Part:
    """A part of the ground."""

    points: NDArray[np.int64]  # flat indices
    # age of its stalest point in each tick, ticks; NaN where it does not count
    stalest: list[float] = field(default_factory=list)
    mean: float = 0.0  # sum over these ticks of the mean age, ticks


class ZoneAges(JournalReading):
    """The ages of the ground of each zone, and the weighted MFoW, tick by tick."""

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        prepared = run.prepared
        self._weighing = [zone for zone in prepared.scenario.zones if zone.weighs]
        self._classes = lru_cache(maxsize=MOST_KEPT)(self._find_classes)
        self._zones = ZonedGround(prepared)
        self._bests: dict[Weighing, float | None] = {}
        self._ticks: Counter[Weighing] = Counter()
        self._fog = run.reading(TrueFog).fog
        self._weights = dict(zone_weights(prepared))
        self._wanted = {zone.name: zone.age for zone in prepared.scenario.zones}
        self._weighted: list[float] = []
        elsewhere = prepared.patrolled.copy()
        self._parts: dict[str, _Part] = {}
        for zone in self._weighing:
            points = points_of(zone, prepared.terrain)
            elsewhere &= ~points
            self._parts[zone.name] = _Part(np.flatnonzero(prepared.patrolled & points))
        if elsewhere.any():
            self._parts[ELSEWHERE] = _Part(np.flatnonzero(elsewhere))

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if some zone has a weight or a wanted age."""
        return any(zone.weighs for zone in run.prepared.scenario.zones)

    def tick(self, record: TickRecord) -> None:
        """Look at the fog after the tick's observations."""
        last_seen = self._fog.last_seen.reshape(-1)
        weighing = weighing_at(self._weighing, record.k * self._step)
        names = dict(weighing)
        self._weights |= {name: weight for name, weight in weighing if weight is not None}
        if weighing not in self._bests:
            self._bests[weighing] = best_weighted_s(self._run.prepared, self._weights_under(weighing))
        self._ticks[weighing] += 1
        ages = ((weight, record.k - max(int(last_seen[points].min()), 0)) for weight, points in self._classes(weighing))
        self._weighted.append(max(weight * age for weight, age in ages))
        for name, part in self._parts.items():
            if name not in names and name != ELSEWHERE:
                # One entry a tick in any case: all parts have columns of the same length.
                part.stalest.append(np.nan)
                continue
            ticks = np.maximum(last_seen[part.points], 0)
            part.stalest.append(record.k - int(ticks.min()))
            part.mean += record.k - float(ticks.mean())

    def facts(self) -> ZoneFacts | None:
        """Return the figures; None before the first tick."""
        if not self._weighted:
            return None
        step = self._step
        parts = {name: part for name, part in self._parts.items() if not np.isnan(part.stalest).all()}
        zones = {name: self._figures(name, part).document() for name, part in parts.items()}
        best_s = {"best_weighted_s": self._best_weighted_s(), "zones": zones}
        figures = _age_figures("mfow_weighted", np.array(self._weighted) * step) | best_s
        return ZoneFacts(figures, {name: np.array(part.stalest) * step for name, part in parts.items()})

    def _find_classes(self, weighing: Weighing) -> list[tuple[float, NDArray[np.int64]]]:
        """Return the weights of the ground while some zones are in force, and the points of each."""
        patrolled, weights = self._run.prepared.patrolled, self._weights_under(weighing)
        distinct = np.unique(weights[patrolled]).tolist()
        return [(weight, np.flatnonzero(patrolled & (weights == weight))) for weight in distinct]

    def _weights_under(self, weighing: Weighing) -> Weights:
        weights = self._zones.under(weighing)
        assert weights is not None
        return weights

    def _best_weighted_s(self) -> float | None:
        bests = {weighing: best for weighing, best in self._bests.items() if best is not None}
        if len(bests) < len(self._bests):
            return None
        if len(bests) == 1:
            return next(iter(bests.values()))
        return sum(best * self._ticks[weighing] for weighing, best in bests.items()) / self._ticks.total()

    def _figures(self, name: str, part: _Part) -> ZoneFigures:
        wanted = self._wanted.get(name)
        stalest = np.array(part.stalest)
        ages = stalest[~np.isnan(stalest)] * self._step
        return ZoneFigures(
            weight=self._weights.get(name, 1.0),
            area_m2=len(part.points) * self._run.prepared.terrain.point_area,
            fog_mean_s=part.mean / len(ages) * self._step,
            wanted_s=wanted,
            kept_share=None if wanted is None else float(np.mean(ages <= wanted)),
            **_age_figures("mfow", ages),
        )


class AgesOpen(JournalReading):
    """The ages of the ground while it was open to view, tick by tick; and when some was not."""

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._open_ground = run.reading(GroundOpen).open_ground
        self._fog = run.reading(TrueFog).fog
        self._ages = OpenAges(run.prepared.patrolled)
        self._zones = [zone for zone in run.prepared.scenario.zones if zone.age is not None]
        grounds = {z.name: points_of(z, run.prepared.terrain).reshape(-1)[self._ages.points] for z in self._zones}
        self._grounds = {name: ground for name, ground in grounds.items() if ground.any()}
        self._in_zones: dict[str, list[float]] = {name: [] for name in self._grounds}
        self._spells: list[ClosedOut] = []  # without the one that goes on
        self._spell: ClosedOut | None = None
        self._closed_out: BoolGrid | None = None

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if parts of the ground close, or bodies without a driver may bar a way."""
        events = run.journal.events
        return run.prepared.scenario.changes_ground or any(event.kind in STANDING_EVENTS for event in events)

    def tick(self, record: TickRecord) -> None:
        """Look at the fog after the tick's observations."""
        self._ages.tick(record.k, self._open_ground.closed_out, self._fog.last_seen)
        if self._open_ground.closed_out is not self._closed_out:
            self._closed_out = self._open_ground.closed_out
            self._note_closed_out(record.k, self._closed_out)
        in_force = zones_in_force(self._zones, record.k * self._step)
        for name, ground in self._grounds.items():
            self._in_zones[name].append(float(self._ages.now[ground].max()) if name in in_force else np.nan)

    def facts(self) -> OpenFacts | None:
        """Return the figures; None before the first tick, and where nothing closes and no way was barred."""
        ages = np.array(self._ages.greatest) * self._step
        spells = [*self._spells, *([self._spell] if self._spell else [])]
        if not ages.size or not (spells or self._run.prepared.scenario.changes_ground):
            return None
        figures: dict[str, Any] = _age_figures("mfow_reachable", ages)
        figures |= {"closed_out_share": float(np.mean(self._ages.closed_share))}
        figures |= {"closed_out": [spell.document() for spell in spells]}
        return OpenFacts(figures, ages, {name: np.array(zone) * self._step for name, zone in self._in_zones.items()})

    def _note_closed_out(self, k: int, closed_out: BoolGrid) -> None:
        terrain, spell = self._run.prepared.terrain, self._spell
        if not closed_out.any():
            self._spells += [] if spell is None else [spell.model_copy(update={"until_s": k * self._step})]
            self._spell = None
            return
        area_m2 = float(np.count_nonzero(closed_out) * terrain.point_area)
        if spell is None or area_m2 > spell.area_m2:
            x, y = middle(closed_out, terrain)
            since_s = k * self._step if spell is None else spell.since_s
            self._spell = ClosedOut(since_s=since_s, until_s=None, area_m2=area_m2, x=x, y=y)


def _age_figures(name: str, ages_s: Ages) -> dict[str, float]:
    """Return the mean of the ages over all ticks and over their second half, and the greatest, as the summary's.

    For example, ages of 1, 2, 3 and 6 s have the mean 3 s, the late mean 4.5 s and the maximum 6 s.
    """
    late_s = ages_s[ages_s.size // 2 :]
    means = {f"{name}_mean_s": float(ages_s.mean()), f"{name}_late_mean_s": float(late_s.mean())}
    return means | {f"{name}_max_s": float(ages_s.max())}
