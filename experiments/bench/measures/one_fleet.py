"""One fleet in one process of its own, so that its peak memory is its own too.

As a program (``python -P -m experiments.bench.measures.one_fleet LIFELINE``) it reads a task as JSON from the standard
input and answers with a JSON line. It ends early when the pipe LIFELINE ends, since its parent is gone then.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

from experiments.bench.tools.procfs import peak_mb
from experiments.inprocess import run_in_process
from patrol.journal import TickRecord
from patrol.prepare import prepare
from patrol.process.lifeline import heed
from patrol.process.starting.seldom import SELDOM
from patrol.process.starting.warmup import warm
from patrol.scenario import Scenario, load_scenario
from worldsim.run_record import COMPLETED
from worldsim.world import World

PACKAGES = ("patrol", "agent", "worldsim")
"""The packages whose kernels a fleet needs."""

PATIENCE_S = 600.0
"""A fleet whose ticks do not count yet after this wall time is given up, s."""

MEMORY_SHARE = 0.9
"""The share of the machine's memory that a fleet may ask for: one that wants more fails instead of the machine."""


@dataclass(frozen=True, slots=True)
class FleetReadings:
    """What one fleet in one process did.

    Attributes:
        skipped: Ticks before those that count.
        before_s: Processor time for terrain, starts, static fields, world and minds, before the first tick, s.
        before_wall_s: The same in wall time, s.
        wall: For each tick that counts, its wall time, s.
        processor: The same in processor time of the whole process, s.
        closing_s: Processor time after the last tick, for verdict and summary, s.
        closing_wall_s: The same in wall time, s.
        peak_mb: Peak of the resident memory, 10^6 bytes.
        frame_bytes: Mean bytes of a robot's frames in one tick.
        valid: Whether the verdict is.
        completed: Whether all ticks of the scenario were done.
        mfow_late_s: Mean MFoW of the second half, s.
        trace: The trace hash.
    """

    skipped: int
    before_s: float
    before_wall_s: float
    wall: list[float]
    processor: list[float]
    closing_s: float
    closing_wall_s: float
    peak_mb: float
    frame_bytes: float
    valid: bool
    completed: bool
    mfow_late_s: float
    trace: str


def run_fleet(scenario: Scenario, seconds: float, skip: int, threads: int) -> FleetReadings:
    """Run a fleet in this process until its scenario or the time is over.

    Args:
        scenario: Loaded.
        seconds: Wall time for the ticks that count, s.
        skip: Ticks at the beginning that do not count.
        threads: Minds that step at once.

    Returns:
        The readings; verdict and summary are those of the ticks that were run.
    """
    begun = _clocks()
    prepared = prepare(scenario)
    marks: list[tuple[float, float]] = []

    def mark(_: object = None) -> None:
        marks.append(_clocks())

    def before_the_first(_: World) -> Any:
        mark()
        return mark

    def over() -> bool:
        if len(marks) > skip + 1:
            return marks[-1][0] - marks[skip][0] > seconds
        return marks[-1][0] - marks[0][0] > PATIENCE_S

    records: list[int] = []

    def count(record: TickRecord) -> None:
        records.append(sum(len(frame) for _, frame in record.frames))

    outcome = run_in_process(
        prepared, keep=False, watch=before_the_first, progress=count, stop=over, threads=threads, verify_fog=True
    )
    ended = _clocks()
    counted = marks[skip:]
    end = outcome.journal.end
    return FleetReadings(
        skipped=min(skip, len(marks) - 1),
        before_s=marks[0][1] - begun[1],
        before_wall_s=marks[0][0] - begun[0],
        wall=[later[0] - earlier[0] for earlier, later in pairwise(counted)],
        processor=[later[1] - earlier[1] for earlier, later in pairwise(counted)],
        closing_s=ended[1] - marks[-1][1],
        closing_wall_s=ended[0] - marks[-1][0],
        peak_mb=peak_mb(),
        frame_bytes=sum(records) / max(len(records), 1) / len(prepared.scenario.roster),
        valid=outcome.verdict.valid,
        completed=end is not None and end.reason == COMPLETED,
        mfow_late_s=float(outcome.summary["mfow_late_mean_s"]),
        trace="" if end is None else end.trace_hash,
    )


def _clocks() -> tuple[float, float]:
    """Wall time and the processor time of this process, s."""
    return time.perf_counter(), time.process_time()


def main() -> int:
    """Run the fleet that the standard input describes.

    Returns:
        The exit code.
    """
    heed(int(sys.argv[1]), patience=0)
    task = json.loads(sys.stdin.read())
    most = int(MEMORY_SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
    warm(PACKAGES, lambda _: None, SELDOM)
    scenario = load_scenario(task["scenario"], task["settings"])
    readings = run_fleet(scenario, task["seconds"], task["skip"], task["threads"])
    print(json.dumps(asdict(readings)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
