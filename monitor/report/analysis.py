"""Computes everything that a report shows about a run, in one replay."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from monitor.observation.fault_bands import Band, bands_of, intruder_bands
from monitor.replay.belief_errors import BeliefErrors, BeliefWatcher, exact_by_construction
from monitor.replay.replay import Watcher, play
from monitor.replay.run import Run
from monitor.replay.run_files import SUMMARY
from monitor.replay.visits import VisitCounter, Visits
from patrol.best_tour import NO_BOUND, best_tour
from patrol.errors import quoted
from patrol.journal.records import Status
from patrol.prepare import sensor_footprint

NO_TOUR = "no tour for this ground or sensor"
"""What stands beside the best tour found where there is none."""


@dataclass(frozen=True, eq=False)
class Analysis:
    """A run with everything that its report shows.

    Attributes:
        run: The run.
        bands: Its faults over time.
        intruders: Its intruders over time.
        visits: Statistics of the fog, point by point.
        beliefs: Believed fog compared with the true one. None if they must be equal, and if deliveries are unknown.
        untested: Whether beliefs accept frames without checking their tags, because the fleet's key is not known.
        wrong_from: The first tick whose replayed fog differs from the one measured; None if all agree. A difference
            means that the scenario, its map or the journal was changed after the run.
    """

    run: Run
    bands: tuple[Band, ...]
    intruders: tuple[Band, ...]
    visits: Visits
    beliefs: BeliefErrors | None
    untested: bool
    wrong_from: int | None


def analyse(run: Run, watchers: Sequence[Watcher] = ()) -> Analysis:
    """Replay a run and compute its analysis.

    Args:
        run: The run.
        watchers: More watchers for the same replay.

    Returns:
        The analysis.
    """
    footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
    visits = VisitCounter(run.prepared.patrolled, run.ticks)
    beliefs, untested = None, False
    if not run.direct and not exact_by_construction(run):
        untested = run.keyless
        beliefs = BeliefWatcher(run, footprint, run.key)
    along: list[Watcher] = [visits, *([beliefs] if beliefs else []), *watchers]
    wrong = play(run, along, footprint)
    end_s = run.ticks * run.step
    bands = bands_of(run.events, run.step, end_s)
    intruders = intruder_bands(run.prepared.scenario, end_s)
    return Analysis(run, bands, intruders, visits.result(), beliefs.result() if beliefs else None, untested, wrong)


@dataclass(frozen=True, slots=True)
class Measure:
    """One measured value of a run.

    Attributes:
        name: Its name.
        value: The value; None when unknown.
        unit: Its unit; empty for none.
        note: A remark.
    """

    name: str
    value: float | None
    unit: str
    note: str = ""

    @property
    def text(self) -> str:
        """The value with its unit, as text."""
        if self.value is None:
            return "-"
        if abs(self.value) >= 1000.0:
            number = f"{self.value:,.0f}".replace(",", "\u202f")
        else:
            number = f"{self.value:.4g}" if abs(self.value) >= 100.0 else f"{self.value:.3g}"
        return f"{number} {self.unit}".strip()


def measures(run: Run) -> list[Measure]:
    """The measured values of a run, from its journal alone, so that a run without a summary has them too.

    Args:
        run: The run.
    """
    step, header = run.step, run.journal.header
    mean, bound = float(run.mfow.mean()) * step, header.bound_s
    tour_s = best_tour_s(run)
    area = float(np.count_nonzero(run.prepared.patrolled))
    lower = f"lower bound {bound:.1f} s" if bound else f"lower bound 0: {NO_BOUND}"
    decisions = run.decision_ms[~np.isnan(run.decision_ms)]
    return [
        Measure("mean MFoW", mean, "s", lower),
        Measure("largest MFoW", float(run.mfow.max()) * step, "s"),
        Measure("best tour found", tour_s, "s", _tour_note(run) if tour_s is not None else NO_TOUR),
        _ratio(run, "mean MFoW / best tour", mean, tour_s, area, "no tour"),
        _ratio(run, "mean MFoW / bound", mean, bound or None, area, "the lower bound is 0"),
        Measure("mean fog", float(run.fog_mean.mean()) * step, "s"),
        Measure("seen", 100.0 * float(run.seen[-1]) / area, "%", f"of {header.patrolled_area_m2:.0f} m²"),
        Measure("delivered", _delivered(run), "%", "as robots report" if run.direct else "of the robots' frames"),
        Measure("collisions", float(run.bumped.sum()), "", "moves cancelled"),
        Measure("driven", float(run.driven.sum()), "m", "all robots"),
        Measure("median decision time", float(np.median(decisions)) if len(decisions) else None, "ms"),
        Measure(
            "robots at the end", float(np.count_nonzero(run.final_status == Status.ALIVE)), "", f"of {len(run.names)}"
        ),
    ]


def best_tour_s(run: Run) -> float | None:
    """The MFoW that all robots that are not spare keep on the best tour found, s; None where there is no tour.

    It does not count who was dead, paused or lost in the run.

    Args:
        run: The run.
    """
    shares = {spec.number: 1.0 for spec in run.prepared.scenario.roster if not spec.spare}
    return best_tour(run.prepared).bound_s(shares)


def _tour_note(run: Run) -> str:
    """Which robots the best tour is for."""
    count = sum(not spec.spare for spec in run.prepared.scenario.roster)
    return "for 1 robot that is never down" if count == 1 else f"for all {count} robots, as if none were ever down"


def warnings_of(run: Run) -> Sequence[str]:
    """The warnings of the verdict in summary.json, one line each; none without a verdict."""
    warnings = (verdict_of(run) or {}).get("warnings")
    return [str(line) for line in warnings] if isinstance(warnings, list) else []


def disagreement(run: Run) -> str:
    """One line for a run whose summary its journal does not confirm, as far as it is quick to tell; else empty.

    Args:
        run: The run.
    """
    stated, end = run.summary or {}, run.journal.end
    found = {
        "trace_hash": None if end is None else run.trace,
        "ended": None if end is None else end.reason,
        "ticks": run.ticks,
        "mfow_mean_s": float(run.mfow.mean()) * run.step,
        "mfow_max_s": float(run.mfow.max()) * run.step,
        "mfow_end_s": float(run.mfow[-1]) * run.step,
    }
    lines = [
        f"{SUMMARY} states {field} = {quoted(stated[field])}, and the journal gives {quoted(value)}"
        for field, value in found.items()
        if field in stated and not _equal(stated[field], value)
    ]
    if end is not None and end.trace_hash != run.trace:
        lines.append("the journal's ticks do not have the trace hash that its end states")
    return f"{'; '.join(lines)}. `fogwatch judge` compares the rest, and judges the run again." if lines else ""


def _equal(stated: object, found: object) -> bool:
    """Whether two values are equal, numbers but for the rounding of another machine."""
    if isinstance(stated, int | float) and isinstance(found, int | float):
        return math.isclose(stated, found, rel_tol=1e-9)
    return stated == found


def outcome_of(run: Run) -> str:
    """The verdict in a few words, such as "valid, with warnings"; "not judged" without one."""
    verdict = verdict_of(run)
    outcome = "not judged" if verdict is None else str(verdict.get("outcome", "unknown"))
    return f"{outcome}, with warnings" if warnings_of(run) else outcome


def _ratio(run: Run, name: str, mean: float, of: float | None, area: float, without: str) -> Measure:
    """A mean MFoW over what it is compared with (s), once all is seen and the run is long enough for that."""
    if not of:
        return Measure(name, None, "", without)
    why = "" if run.seen[-1] == area else "not all was seen"
    if not why and run.ticks * run.step < 4.0 * of:
        why = "run too short"
    return Measure(name, None if why else mean / of, "", why)


def direct_of(run: Run) -> Mapping[str, Any]:
    """The part of the summary about direct radio (`worldsim.output.direct_radio`); empty without one."""
    said = (run.summary or {}).get("direct")
    return said if isinstance(said, dict) else {}


def _delivered(run: Run) -> float | None:
    """The delivered share of the robots' frames that were delivered or dropped, in percent."""
    if run.direct:
        share = direct_of(run).get("heard_share")
        return None if share is None else 100.0 * float(share)
    delivered, lost = int(run.links.delivered[1:].sum()), int(run.links.lost[1:].sum())
    return 100.0 * delivered / (delivered + lost) if delivered + lost else None


def state_of(run: Run, going: bool = False) -> tuple[str, str]:
    """How a run ended.

    Args:
        run: The run.
        going: Whether it may still be running.

    Returns:
        A word, and a sentence if the run is incomplete (else empty).
    """
    time = f"{run.ticks * run.step:g} s of {run.prepared.scenario.duration:g} s"
    if run.ended == "completed":
        return "completed", ""
    if run.ended is not None:
        return run.ended, f"The run ended early ({run.ended}), after {time}."
    if going:
        return (
            "still going",
            f"The run is still going: {time} so far. Repeat this at its end for the rest and the verdict.",
        )
    torn = " in the middle of a record" if run.truncated else ""
    return "cut off", f"The run was cut off: its journal stops{torn} after {time}. It has no verdict."


def verdict_of(run: Run) -> Mapping[str, Any] | None:
    """The verdict in summary.json; None without one."""
    verdict = (run.summary or {}).get("verdict")
    return verdict if isinstance(verdict, dict) and isinstance(verdict.get("checks"), list) else None
