"""The ages of the ground while it was open to view, recomputed from the poses and the closures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.closures.open_ground import OpenAges, OpenGround
from patrol.journal import Status
from patrol.zones.ground import points_of
from patrol.zones.spec import zones_in_force
from worldsim.verdict.common.check import JournalReading
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.common.true_fog import TrueFog

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


@dataclass(frozen=True, eq=False)
class OpenFacts:
    """The figures of a run with closures."""

    mfow_open_mean_s: float  # mean over all ticks of the greatest open age
    mfow_open_late_mean_s: float  # the same over the second half
    mfow_open_max_s: float  # the greatest open age of all ticks
    closed_out_share: float  # share of ground times time that was closed out
    ages_s: NDArray[np.float64]  # (ticks,), greatest open age in each tick; not in the summary
    # the same by zone with a wanted age, NaN while not in force; not in the summary
    zones_s: dict[str, NDArray[np.float64]]

    def figures(self) -> dict[str, float]:
        """Return what the summary has of it."""
        return {name: value for name, value in vars(self).items() if name not in ("ages_s", "zones_s")}


class GroundOpen(JournalReading):
    """The ground that is open to view, tick by tick.

    `open_ground` is what each robot can get to and see; None where the scenario has no closures.
    """

    needs = (RobotsThere, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._ground = readings[ClosedGround]
        self.open_ground = OpenGround(run.prepared) if run.prepared.scenario.closures else None

    def tick(self, record: TickRecord) -> None:
        """Take in the places of the robots."""
        if self.open_ground is not None:
            places = {row.number: (row.x, row.y) for row in record.robots if row.status is Status.ALIVE}
            self.open_ground.tick(record.k, self._ground.terrain, self._ground.closed.names, places)


class AgesOpen(JournalReading):
    """The ages of the ground while it was open to view, tick by tick."""

    needs = (RobotsThere, GroundOpen, TrueFog)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._ground = readings[GroundOpen]
        self._fog = readings[TrueFog].fog
        self._ages = OpenAges(run.prepared.patrolled)
        self._zones = [zone for zone in run.prepared.scenario.zones if zone.age is not None]
        grounds = {
            zone.name: points_of(zone, run.prepared.terrain).reshape(-1)[self._ages.points] for zone in self._zones
        }
        self._grounds = {name: ground for name, ground in grounds.items() if ground.any()}
        self._in_zones: dict[str, list[float]] = {name: [] for name in self._grounds}

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has closures."""
        return bool(run.prepared.scenario.closures)

    def tick(self, record: TickRecord) -> None:
        """Look at the fog after the tick's observations."""
        assert self._ground.open_ground is not None
        self._ages.tick(record.k, self._ground.open_ground.closed_out, self._fog.last_seen)
        in_force = zones_in_force(self._zones, record.k * self._run.step)
        for name, ground in self._grounds.items():
            self._in_zones[name].append(float(self._ages.now[ground].max()) if name in in_force else np.nan)

    def facts(self) -> OpenFacts | None:
        """Return the figures; None before the first tick."""
        ages = np.array(self._ages.greatest) * self._run.step
        if not ages.size:
            return None
        return OpenFacts(
            mfow_open_mean_s=float(ages.mean()),
            mfow_open_late_mean_s=float(ages[ages.size // 2 :].mean()),
            mfow_open_max_s=float(ages.max()),
            closed_out_share=float(np.mean(self._ages.closed_share)),
            ages_s=ages,
            zones_s={name: np.array(of_zone) * self._run.step for name, of_zone in self._in_zones.items()},
        )
