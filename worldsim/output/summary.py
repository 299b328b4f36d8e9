"""The summary of a run, as in `summary.json`: computed from the journal's records, the verdict and the wall time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from patrol.journal import Event, Header, TickRecord
from patrol.measures.best_tour import best_tour
from patrol.measures.nodes import node_totals
from patrol.summary.features import FEATURES
from patrol.summary.model import Summary
from patrol.summary.totals import RunTotals
from worldsim.output.traffic import Traffic, as_measured

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.checks.progress import RunProgress
    from worldsim.run_record import RunRecord
    from worldsim.verdict.judge import Verdict


class Totals:
    """The running totals of a run; see `summarise`."""

    def __init__(self, header: Header, events: Sequence[Event] = ()) -> None:
        """Start before the first tick; the events are all of the run, as operators may have added faults."""
        self._header = header
        patrolled = round(header.patrolled_area_m2 / header.terrain.point**2)
        self._run = RunTotals(header, float(header.scenario["step"]), patrolled)
        self._traffic = Traffic(header, events)
        self._nodes = node_totals(header)
        self._features = [feature.totals(header, events) for feature in FEATURES if feature.totals is not None]

    def tick(self, record: TickRecord) -> None:
        """Add the next tick."""
        self._run.tick(record)
        self._traffic.tick(record)
        for totals in self._features:
            totals.tick(record)
        if self._nodes is not None:
            self._nodes.tick(record)

    def summary(self, journal: RunRecord, verdict: Verdict, prepared: Prepared) -> tuple[Summary, Verdict]:
        """Return the run's summary after its last tick, when the journal has ended, and the verdict on both.

        The journal's ticks are not read.
        """
        header, end, tour = self._header, journal.end, best_tour(prepared)
        document = self._run.figures(journal.events).document()
        wall_s = end.notes.get("wall_s") if end else None
        document |= {
            "name": header.scenario["name"],
            "policy": header.scenario["patrol"]["policy"],
            "scenario_hash": header.scenario_hash,
            "trace_hash": end.trace_hash if end else None,
            "ended": end.reason if end else None,
            "wall_s": wall_s,
            "realtime_factor": document["simulated_s"] / wall_s if wall_s else None,
            "sensor_range_m": float(header.scenario["sensor"]["range"]),
            "best_tour_s": tour.bound_of_fleet_s(prepared.scenario),
            "best_tour_m": tour.length_m,
            "left_out": None if (left_out := prepared.find_left_out()) is None else asdict(left_out),
            **({} if self._nodes is None else {"nodes": self._nodes.figures()}),
            **_progress_figures(verdict.progress),
            **verdict.figures,
            "links": self._traffic.links(),
            "faults": self._traffic.faults(),
            **_of_processes(journal),
            "verdict": {},
        }
        stays = {} if verdict.progress is None else verdict.progress.stays
        for robot in header.robots:
            stay = stays.get(robot.number)
            document["robots"][robot.name] |= {
                "longest_stay_s": None if stay is None else stay.seconds,
                "longest_stay": None if stay is None else asdict(stay),
            }
        for totals in self._features:
            figures = dict(totals.figures(journal.events))
            for name, of_robot in figures.pop("robots", {}).items():
                document["robots"][name] |= of_robot
            document |= figures
        if header.scenario["radio"].get("via") == "direct":
            document = as_measured(document, journal)
        # Last: this check compares all that the summary says.
        verdict = verdict.with_figures_of(document)
        document["verdict"] = verdict_facts(verdict)
        return Summary.model_validate(document), verdict


def verdict_facts(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict as a summary states it."""
    return {
        "valid": verdict.valid,
        "outcome": verdict.outcome,
        "warnings": list(verdict.warnings),
        "checks": [{**asdict(check), "warnings": list(check.warnings)} for check in verdict.checks],
    }


def summarise(journal: RunRecord, verdict: Verdict, prepared: Prepared) -> tuple[Summary, Verdict]:
    """Compute the summary of a run that has ended, and judge its figures as well."""
    totals = Totals(journal.header, journal.events)
    for record in journal.ticks:
        totals.tick(record)
    return totals.summary(journal, verdict, prepared)


def _progress_figures(progress: RunProgress | None) -> dict[str, Any]:
    """Return where robots were trapped, and the stalest places; a verdict may not have looked for them."""
    if progress is None:
        return {"trapped": [], "stalest": {}}
    return {
        "trapped": [{**asdict(robot), "stale": list(robot.stale)} for robot in progress.trapped],
        "stalest": progress.stalest.document(),
    }


def _of_processes(journal: RunRecord) -> dict[str, Any]:
    """Return the facts about a fleet of processes in the journal's end; none for a fleet in one process."""
    notes = journal.end.notes if journal.end else {}
    facts = {"refused": notes["refused"]} if "refused" in notes else {}
    if "late_commands" in notes:
        names = {robot.number: robot.name for robot in journal.header.robots}
        late = {
            note: {names[robot]: count for robot, count in notes.get(note, {}).items() if robot in names}
            for note in ("late_frames", "too_late", "late_commands")
        }
        # Older journals have none of these: use 0.
        held_up = {note: notes.get(note, 0.0) for note in ("slipped_s", "held_up_s", "longest_held_up_s")}
        facts["deadlines"] = {**late, **held_up}
    return facts
