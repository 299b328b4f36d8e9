"""Everything that a report tells of a run, found in one pass over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from monitor.replay.beliefs import BeliefErrors, BeliefWatcher, exact_by_construction
from monitor.replay.replay import Watcher, play
from monitor.replay.run import Run
from monitor.replay.visits import VisitCounter, Visits
from monitor.report.faultbands import Band, bands_of
from patrol.errors import BadInput
from patrol.ground.footprint import sensor_footprint
from patrol.journal.records import Status
from patrol.radio.fleet_key import fleet_key


@dataclass(frozen=True, eq=False)
class Analysis:
    """A run and what came out of it.

    beliefs: None where they are exact by construction, and where nobody knows what reached whom. untested: the fleet's
    key cannot be read, so beliefs take frames without a test of their tags. wrong_from: the first tick whose replayed
    fog is not as measured, which means that the scenario, its map or the journal is not what the run had.
    """

    run: Run
    bands: tuple[Band, ...]
    visits: Visits
    beliefs: BeliefErrors | None
    untested: bool
    wrong_from: int | None


def analyse(run: Run, watchers: Sequence[Watcher] = ()) -> Analysis:
    """Play the run once; watchers: who else goes along."""
    footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
    visits = VisitCounter(run.prepared.patrolled, run.ticks)
    beliefs, untested = None, False
    if not run.direct and not exact_by_construction(run):
        try:
            key = fleet_key(run.prepared.scenario)
        except BadInput:
            key, untested = None, True
        beliefs = BeliefWatcher(run, footprint, key)
    along: list[Watcher] = [visits, *([beliefs] if beliefs else []), *watchers]
    wrong = play(run, along, footprint)
    bands = bands_of(run.events, run.step, run.ticks * run.step)
    return Analysis(run, bands, visits.result(), beliefs.result() if beliefs else None, untested, wrong)


@dataclass(frozen=True, slots=True)
class Measure:
    """One number of a run for people. value: None where it is not known."""

    name: str
    value: float | None
    unit: str
    note: str = ""

    @property
    def text(self) -> str:
        """The number with its unit."""
        if self.value is None:
            return "-"
        if abs(self.value) >= 1000.0:
            number = f"{self.value:,.0f}".replace(",", "\u202f")
        else:
            number = f"{self.value:.4g}" if abs(self.value) >= 100.0 else f"{self.value:.3g}"
        return f"{number} {self.unit}".strip()


def measures(run: Run) -> list[Measure]:
    """What a run came to, from its journal alone, so that a run that was cut off has it too."""
    step, header = run.step, run.journal.header
    mean, bound = float(run.mfow.mean()) * step, header.bound_s
    area = float(np.count_nonzero(run.prepared.patrolled))
    settled = run.seen[-1] == area and run.ticks * step >= 4.0 * bound > 0.0
    decisions = run.decision_ms[~np.isnan(run.decision_ms)]
    return [
        Measure("mean MFoW", mean, "s", f"lower bound {bound:.1f} s" if bound else ""),
        Measure("largest MFoW", float(run.mfow.max()) * step, "s"),
        Measure("mean MFoW / bound", mean / bound if settled else None, "", "" if settled else "not settled"),
        Measure("mean fog", float(run.fog_mean.mean()) * step, "s"),
        Measure("seen", 100.0 * float(run.seen[-1]) / area, "%", f"of {header.patrolled_area_m2:.0f} m²"),
        Measure("delivered", _delivered(run), "%", "by what robots say" if run.direct else "of the robots' frames"),
        Measure("collisions", float(run.bumped.sum()), "", "moves cancelled"),
        Measure("driven", float(run.driven.sum()), "m", "all robots"),
        Measure("decision, median", float(np.median(decisions)) if len(decisions) else None, "ms"),
        Measure("robots at the end", float(np.count_nonzero(run.standing == Status.ALIVE)), "", f"of {len(run.names)}"),
    ]


def direct_of(run: Run) -> Mapping[str, Any]:
    """What the summary of a run with direct radio says of it (`worldsim.output.direct_radio`); empty without one."""
    said = (run.summary or {}).get("direct")
    return said if isinstance(said, dict) else {}


def _delivered(run: Run) -> float | None:
    """The delivered share of the robots' frames whose fate is known, in percent."""
    if run.direct:
        share = direct_of(run).get("heard_share")
        return None if share is None else 100.0 * float(share)
    delivered, lost = int(run.links.delivered[1:].sum()), int(run.links.lost[1:].sum())
    return 100.0 * delivered / (delivered + lost) if delivered + lost else None


def state_of(run: Run, going: bool = False) -> tuple[str, str]:
    """How a run ended: a word, and a sentence for one that is not whole (else empty). going: it may not be over."""
    until = f"what there is reaches to {run.ticks * run.step:g} s of {run.prepared.scenario.duration:g} s"
    if run.ended == "completed":
        return "completed", ""
    if run.ended is not None:
        return run.ended, f"The run ended early ({run.ended}); {until}."
    if going:
        return "still going", f"The run is still going; {until}. Ask again later for the rest and for the verdict."
    torn = " in the middle of a record" if run.truncated else ""
    return "cut off", f"The run was cut off: its journal stops{torn} without an end; {until}, and nobody judged it."


def verdict_of(run: Run) -> Mapping[str, Any] | None:
    """The verdict in summary.json, None without one."""
    verdict = (run.summary or {}).get("verdict")
    return verdict if isinstance(verdict, dict) and isinstance(verdict.get("checks"), list) else None
