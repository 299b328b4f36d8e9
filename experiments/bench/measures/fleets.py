"""Fleets in one process: how many robot-seconds they simulate in a second of one core, and what memory they need.

A *robot-second* is one second of one robot's patrol: decision, motion, fog, radio and verdict. Divided by processor
time it is the unit in which simulators compare, whatever the fleet, the step and the number of cores.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from experiments.bench.grounds import KILOMETRE, square, write_map
from experiments.bench.measures.one_fleet import FleetReadings
from experiments.bench.tools.groups import FLEETS
from experiments.bench.tools.measure import Effort, Measured, Task, Unmeasured
from experiments.paper.printed import paper
from experiments.paper.tables import PaperSetup, plan_of
from experiments.sweeps.pool import cores

SIZES = (5, 50, 100, 200, 500, 1000)
QUICK_MOST = 50
"""The largest fleet of a quick benchmark."""

AREA_SIZE = 100
SIDES = (500, 2000)
"""Other squares, m, for a fleet of that size."""

LARGE, SMALL = 1000, 100
"""Fleets whose cost per robot is compared."""

LONGER = {500: 2.0, 1000: 4.0}
"""How much longer large fleets run than others, since each of their ticks takes longer."""

LOSS = 0.2
STEP_S = 0.5
DURATION_S = 5000.0
SKIP_TICKS, SKIP_QUICK = 40, 4
"""Ticks that do not count: caches fill, and all robots choose their first place at once."""

CELL = "table 3 f3 g4"
"""The paper's cell that is run at fine points: 3 holonomic robots, straight paths, 10,000 ticks."""

CELL_POINT_M, CELL_SENSOR_M = 0.1, 12.0
CELL_QUICK_S = 50.0
"""The simulated time of a quick benchmark."""

CELL_PATIENCE_S = 600.0

BLOCKS = 5
"""Into how many stretches a run is divided, each of which is one reading."""


def tasks() -> list[Task]:
    """The measures of fleets in one process."""
    found = []
    for size in SIZES:
        for rate in (0.0, LOSS):
            lost = f", {100.0 * rate:g} % lost" if rate else ""
            found.append(Task(FLEETS, f"{size} robots{lost}", partial(_fleet, size, loss=rate)))
    found += [
        Task(FLEETS, f"{AREA_SIZE} robots on {(side / KILOMETRE) ** 2:g} km2", partial(_fleet, AREA_SIZE, side=side))
        for side in SIDES
    ]
    found.append(Task(FLEETS, f"{LARGE} robots beside {SMALL}", partial(_growth, 0.0)))
    found.append(Task(FLEETS, f"{LARGE} robots, {100.0 * LOSS:g} % lost, beside none lost", partial(_growth, LOSS)))
    found.append(Task(FLEETS, f"{CELL} at {CELL_POINT_M:g} m", _paper_cell))
    threads = cores()
    if threads > 1:
        found += [
            Task(FLEETS, f"{size} robots, {threads} threads", partial(_fleet, size, threads=threads))
            for size in (200, LARGE)
        ]
    return found


def square_scenario(size: int, folder: Path, loss: float = 0.0, side: int = KILOMETRE) -> dict[str, Any]:
    """The scenario of a fleet on a square with obstacles.

    Args:
        size: Number of robots.
        folder: Where the map is written.
        loss: Share of the frames that are lost.
        side: Of the square, m.

    Returns:
        As in a scenario file.
    """
    path = write_map(square(side), 1.0, folder / f"square-{side}.yaml")
    return {
        "name": f"square-{side}-{size}",
        "terrain": {"map": str(path)},
        "point": 1.0,
        "step": STEP_S,
        "duration": DURATION_S,
        "robots": {"count": size, "model": "holonomic"},
        "faults": [{"kind": "loss", "rate": loss}] if loss else [],
    }


def _fleet(
    size: int, effort: Effort, *, loss: float = 0.0, threads: int = 1, side: int = KILOMETRE
) -> Sequence[Measured]:
    if effort.quick and size > QUICK_MOST:
        return []
    return measures_of(_readings(size, effort, loss=loss, threads=threads, side=side), size)


def _growth(loss: float, effort: Effort) -> Sequence[Measured]:
    """By how much a robot's tick costs more in a large fleet than in a small one, or with frames lost than without."""
    if effort.quick:
        return []
    fewer = LARGE if loss else SMALL
    large, beside = _readings(LARGE, effort, loss=loss), _readings(fewer, effort)
    return [growth_of(_valid(large), LARGE, _valid(beside), fewer)]


def growth_of(large: FleetReadings, size: int, beside: FleetReadings, fewer: int) -> Measured:
    """By how much a robot's tick costs more in one fleet than in another, over the same ticks of their patrols.

    Ticks cost more as a patrol goes on, so what one fleet did beyond the other's last tick does not count.

    Args:
        large: Readings of the one.
        size: Number of its robots.
        beside: Readings of the other.
        fewer: Number of its robots.

    Raises:
        Unmeasured: One of them did no tick.
    """
    ticks = min(len(large.processor), len(beside.processor))
    own, other = (
        [spent / (count * robots) for spent, count in blocks(readings.processor[:ticks])]
        for readings, robots in ((large, size), (beside, fewer))
    )
    ratio = tuple(more / less for more, less in zip(own, other, strict=True))
    says = f"stretch by stretch, over the same {ticks} ticks"
    return Measured("processor time per robot and tick, as a ratio", "", ratio, says=says)


def _paper_cell(effort: Effort) -> Sequence[Measured]:
    """How long a run of the paper takes at points of 10 cm, from its preparation to its verdict."""
    setup = PaperSetup(CELL_POINT_M, CELL_SENSOR_M, (1,), {"duration": CELL_QUICK_S} if effort.quick else {})
    settings = {case.name: case.settings for case in plan_of([paper().tables[3]], {"": setup}).cases}[CELL]
    return measures_of_whole(run_apart({"name": "paper"}, CELL_PATIENCE_S, skip=0, settings=settings))


def measures_of_whole(readings: FleetReadings) -> list[Measured]:
    """How long a whole run took, from its preparation to its verdict.

    Args:
        readings: Of all its ticks.

    Raises:
        Unmeasured: The run's verdict is not valid, or the run ended before its last tick.
    """
    if not _valid(readings).completed:
        raise Unmeasured(f"the run ended after {len(readings.wall)} ticks, before its last")
    says = f"{len(readings.wall)} ticks, from preparation to verdict"
    processor = readings.before_s + sum(readings.processor) + readings.closing_s
    wall = readings.before_wall_s + sum(readings.wall) + readings.closing_wall_s
    return [
        Measured("processor time", "s", (processor,), says=says),
        Measured("the whole run", "s, wall", (wall,), says=says),
    ]


def _readings(
    size: int, effort: Effort, *, loss: float = 0.0, threads: int = 1, side: int = KILOMETRE
) -> FleetReadings:
    """The readings of a fleet, made once: whatever compares fleets compares the runs of the rows above it."""
    return _run_once(size, effort, loss, threads, side)


@cache
def _run_once(size: int, effort: Effort, loss: float, threads: int, side: int) -> FleetReadings:
    skip = SKIP_QUICK if effort.quick else SKIP_TICKS
    seconds = effort.seconds * LONGER.get(size, 1.0)
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        return run_apart(square_scenario(size, Path(folder), loss, side), seconds, threads=threads, skip=skip)


def _valid(readings: FleetReadings) -> FleetReadings:
    if not readings.valid:
        raise Unmeasured("the run's verdict is not valid")
    return readings


def measures_of(readings: FleetReadings, size: int) -> list[Measured]:
    """What the readings of a fleet come to.

    Args:
        readings: Of its run.
        size: Number of its robots.

    Raises:
        Unmeasured: The run's verdict is not valid, or it was too short.
    """
    ticks = len(_valid(readings).wall)
    processor, wall = blocks(readings.processor), blocks(readings.wall)
    simulated = [size * STEP_S * count for _, count in processor]
    closing = readings.closing_s + sum(readings.processor)
    whole = f"{size * STEP_S * ticks / closing:.4g} with the verdict's and the summary's end"
    return [
        Measured(
            "robot-seconds per second and core",
            "robot-s/s",
            tuple(robot_s / spent for robot_s, (spent, _) in zip(simulated, processor, strict=True)),
            says=f"{whole}; {ticks} ticks after the first {readings.skipped}",
        ),
        Measured("times real time", "x", tuple(STEP_S * count / spent for spent, count in wall)),
        Measured("processor time per robot and tick", "ms", tuple(1e3 * s / (n * size) for s, n in processor)),
        Measured("peak memory", "MB", (readings.peak_mb,)),
        Measured("memory per robot", "MB", (readings.peak_mb / size,)),
        Measured("bytes sent per robot and tick", "bytes", (readings.frame_bytes,)),
        Measured("until the first tick", "s, wall", (readings.before_wall_s,)),
        Measured("verdict and summary after the last tick", "s", (readings.closing_s,), says="processor time"),
    ]


def blocks(ticks: Sequence[float], count: int = BLOCKS) -> list[tuple[float, int]]:
    """The readings of ticks as those of a few stretches, so that ticks of different kinds count as they come.

    Args:
        ticks: One reading for each.
        count: How many stretches, if there are as many ticks.

    Returns:
        For each stretch the sum of its readings and the number of its ticks.

    Raises:
        Unmeasured: There is no tick.
    """
    if not ticks:
        raise Unmeasured("no tick was done in the time given")
    bounds = [round(len(ticks) * place / min(count, len(ticks))) for place in range(min(count, len(ticks)) + 1)]
    return [(sum(ticks[first:last]), last - first) for first, last in pairwise(bounds)]


def run_apart(
    scenario: Mapping[str, Any],
    seconds: float,
    *,
    threads: int = 1,
    skip: int = SKIP_QUICK,
    settings: Mapping[str, object] | None = None,
) -> FleetReadings:
    """Run a fleet in a process of its own.

    Args:
        scenario: As in a scenario file.
        seconds: Wall time for its ticks, s.
        threads: Minds that step at once.
        skip: Ticks at the beginning that do not count.
        settings: What else is set in the scenario, by dotted field.

    Raises:
        Unmeasured: The process failed.
    """
    task = {
        "scenario": scenario,
        "settings": dict(settings or {}),
        "seconds": seconds,
        "skip": skip,
        "threads": threads,
    }
    lifeline, ours = os.pipe()
    try:
        command = [sys.executable, "-P", "-m", "experiments.bench.measures.one_fleet", str(lifeline)]
        done = subprocess.run(
            command, input=json.dumps(task), capture_output=True, text=True, check=False, pass_fds=[lifeline]
        )
    finally:
        os.close(lifeline)
        os.close(ours)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise Unmeasured(f"the fleet's process failed: {last}")
    return FleetReadings(**json.loads(done.stdout))
