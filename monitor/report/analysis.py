"""Computes everything that a report shows about a run, in one replay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from monitor.observation.fault_bands import Band, bands_of, intruder_bands
from monitor.replay.belief_errors import BeliefErrors, BeliefWatcher, exact_by_construction
from monitor.replay.replay import VisitCounter, Visits, Watcher, play
from monitor.replay.run import Run
from monitor.replay.run_files import SUMMARY
from patrol.errors import BadInput, quoted
from patrol.extras import study
from patrol.measures.best_tour import NO_BOUND, best_tour
from patrol.prepare import sensor_footprint
from patrol.summary.metric import Metric, metrics_of
from patrol.summary.model import RobotFigures, Summary, ground_text, unsettled
from runtime.process.aside import Aside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NO_TOUR = "no tour for this ground or sensor"
"""Note beside the best tour found where there is none."""

NO_PLAN = "no plan, or no robot on patrol"
"""Note beside the share of the time that went by a plan, where there is none."""


class MovingIntruder(Protocol):
    """The game of the moving intruder on a run, which the studies play (`experiments.intruders.report_section`)."""

    def table(self) -> str:
        """Return the table of successes as HTML."""
        ...

    def chart(self, run: Run) -> Figure:
        """Draw examples of attempts."""
        ...


@dataclass(frozen=True, eq=False)
class Analysis:
    """A run with everything that its report shows."""

    run: Run
    bands: tuple[Band, ...]
    intruders: tuple[Band, ...]
    visits: Visits
    beliefs: BeliefErrors | None  # None if they must equal the true fog, and if deliveries are unknown
    untested: bool  # beliefs accept frames without checking their tags, as the key is not known
    # first tick whose replayed fog differs (scenario, map or journal changed since); None if all agree
    wrong_from: int | None
    moving: MovingIntruder | None  # None where it cannot be played
    no_moving: str  # why it cannot; empty where it can


def analyse(run: Run, watchers: Sequence[Watcher] = ()) -> Analysis:
    """Replay a run and compute its analysis."""
    footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
    visits = VisitCounter(run.prepared.patrolled, run.ticks)
    beliefs, untested = None, False
    if not run.direct and not exact_by_construction(run):
        untested = run.keyless
        beliefs = BeliefWatcher(run, footprint, run.key)
    along: list[Watcher] = [visits, *([beliefs] if beliefs else []), *watchers]
    moving: MovingIntruder | None = None
    no_moving = ""
    with Aside[MovingIntruder](lambda: study("intruders.report_section").play_on(run)) as game:
        wrong = play(run, along, footprint)
        try:
            moving = game.result()
        except BadInput as why:
            no_moving = str(why)
    end_s = run.ticks * run.step
    bands = bands_of(run.events, run.step, end_s)
    intruders = intruder_bands(run.prepared.scenario, end_s)
    errors = beliefs.result() if beliefs else None
    return Analysis(run, bands, intruders, visits.result(), errors, untested, wrong, moving, no_moving)


@dataclass(frozen=True, slots=True)
class Measure:
    """One measured value of a run."""

    metric: Metric
    value: float | None  # as in summary.json; None when unknown
    note: str = ""

    @property
    def name(self) -> str:
        """Its name."""
        return self.metric.title

    @property
    def text(self) -> str:
        """The value with its unit, as text."""
        return self.metric.text(self.value, ",")


BY_TOUR = Metric("mean MFoW over that of the best tour found", title="mean MFoW / best tour", digits=2, better="lower")
BY_BOUND = Metric("mean MFoW over its lower bound", title="mean MFoW / bound", digits=2, better="lower")
DELIVERED = Metric("share of frames that arrived", "%", "delivered", better="higher")
DECISION = Metric("median over all robots", "ms", "median decision time", digits=2, better="lower")
LIVING = Metric("robots that were alive", title="robots at the end", digits=0, better="higher")
"""Metrics that only a report has."""


def measures(run: Run) -> list[Measure]:
    """List the measured values of a run, from its journal alone, so that a run without a summary has them too.

    Every metric that is declared with a title is among them; those of single robots if they can be summed up.
    """
    figures = run.figures.model_copy(
        update={"best_tour_s": best_tour(run.prepared).bound_of_fleet_s(run.prepared.scenario)}
    )
    left_out = run.prepared.find_left_out()
    notes = {
        "mfow_mean_s": f"lower bound {figures.bound_s:.1f} s" if figures.bound_s else f"lower bound 0: {NO_BOUND}",
        "best_tour_s": NO_TOUR if figures.best_tour_s is None else _tour_note(run),
        "seen_share": f"of {ground_text(figures)}{'' if left_out is None else f'; left out: {left_out.text}'}",
    }
    if figures.planned_share is None:
        notes["planned_share"] = NO_PLAN
    of_run = {
        key: Measure(metric, getattr(figures, key), notes.get(key, metric.note))
        for key, metric in metrics_of(Summary)
        if metric.title
    }
    of_robots = [
        Measure(metric, metric.reduced([getattr(robot, key) for robot in run.robot_figures]), metric.note)
        for key, metric in metrics_of(RobotFigures)
        if metric.title and metric.sweep == "sum"
    ]
    decisions = run.decision_ms[~np.isnan(run.decision_ms)]
    living = sum(robot.status == "alive" for robot in run.robot_figures)
    return [
        *(of_run.pop(key) for key in ("mfow_mean_s", "mfow_max_s", "best_tour_s")),
        _ratio_measure(BY_TOUR, figures, figures.best_tour_s, "no tour"),
        _ratio_measure(BY_BOUND, figures, figures.bound_s, "the lower bound is 0"),
        *of_run.values(),
        Measure(DELIVERED, _delivered_share(run), "as robots report" if run.direct else "of the robots' frames"),
        *of_robots,
        Measure(DECISION, float(np.median(decisions)) if len(decisions) else None),
        Measure(LIVING, living, f"of {len(run.names)}"),
    ]


def _tour_note(run: Run) -> str:
    """Return which robots the best tour is for."""
    speeds = [spec.speed for spec in run.prepared.scenario.roster if not spec.spare]
    if len(speeds) == 1:
        return "for 1 robot that is never down"
    own = "" if len(set(speeds)) == 1 else ", each at its own speed"
    return f"for all {len(speeds)} robots{own}, as if none were ever down"


def warnings_of(run: Run) -> Sequence[str]:
    """Return the warnings of the verdict in summary.json, one line each; none without a verdict."""
    return [] if run.stated.verdict is None else run.stated.verdict.warnings


def disagreement(run: Run) -> str:
    """Return one line on how a run's journal contradicts its summary; empty if it does not.

    It compares only numbers that are at hand.
    """
    end = run.journal.end
    recomputed = run.figures.model_copy(
        update={"trace_hash": None if end is None else run.trace, "ended": None if end is None else end.reason}
    ).document()
    summary = run.stated.document()
    lines = [
        f"{SUMMARY} states {key} = {quoted(summary[key])}, and the journal gives {quoted(value)}"
        for key, value in recomputed.items()
        if key in summary and key not in ("messages", "robots") and not _values_equal(summary[key], value)
    ]
    if end is not None and end.trace_hash != run.trace:
        lines.append("the journal's ticks do not have the trace hash that its end states")
    return f"{'; '.join(lines)}. `fogwatch judge` compares the rest, and judges the run again." if lines else ""


def _values_equal(stated: object, found: object) -> bool:
    """Return whether two values are equal, numbers but for the rounding of another machine.

    For example, 10.0 equals 10.000000001, but not 10.001.
    """
    if isinstance(stated, int | float) and isinstance(found, int | float):
        return math.isclose(stated, found, rel_tol=1e-9)
    return stated == found


def outcome_of(run: Run) -> str:
    """Return the verdict in a few words, such as "valid, with warnings"; "not judged" without one."""
    outcome = "not judged" if run.stated.verdict is None else run.stated.verdict.outcome
    return f"{outcome}, with warnings" if warnings_of(run) else outcome


def _ratio_measure(metric: Metric, figures: Summary, yardstick_s: float | None, without: str) -> Measure:
    """Return the ratio of a mean MFoW to a yardstick, or why there is none."""
    if not yardstick_s:
        return Measure(metric, None, without)
    why = unsettled(figures, yardstick_s)
    return Measure(metric, None if why or figures.mfow_mean_s is None else figures.mfow_mean_s / yardstick_s, why)


def _delivered_share(run: Run) -> float | None:
    """Return the delivered share of the robots' frames that were delivered or dropped; None without any."""
    if run.direct:
        return run.stated.direct.heard_share
    messages = run.figures.messages
    settled = messages.delivered + (messages.dropped or 0)
    return messages.delivered / settled if settled else None


def state_of(run: Run, going: bool = False) -> tuple[str, str]:
    """Return a word for how a run ended, and a sentence if it is incomplete (else empty).

    `going` says that it may still be running.
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
