"""Fleets in one process: the processor time of one robot's tick, with decision, motion, fog, radio and verdict.

Fleets of all sizes are measured over the same ticks, since a patrol gets harder while it goes on: at its beginning each
robot has unseen ground next to it. The end of the verdict and the summary do not count: on new ground the summary looks
for the best tour, which takes many times as long as a small fleet's ticks, and is kept for later runs.

With several workers it is wall time, since one process does not have the time of others.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bench.grounds import KILOMETRE, square, write_map
from bench.runner import Bench
from fogwatch.inprocess import run_in_process
from patrol.journal import TickRecord
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from worldsim.world import World

SIZES = (5, 50, 100, 200, 500, 1000)
AREA_SIZE = 100
SIDES = (500, 2000)
"""Other squares, m, for a fleet of that size."""

WORKERS = 2
"""Processes for the decisions of the largest fleet."""

LOSS = 0.2
STEP_S = 0.5
SKIPPED = 40
"""Ticks that do not count: caches fill, and all robots choose their first place at once."""
COUNTED = 130


def main() -> None:
    """Measure fleets of several sizes, with and without lost frames, and on other squares."""
    bench = Bench("fleets", processes=3, values=1, warmups=0, loops=1, options={"skipped": SKIPPED, "counted": COUNTED})
    skipped, counted = bench.option("skipped"), bench.option("counted")

    def measure(name: str, size: int, side: int = KILOMETRE, loss: float = 0.0, workers: int = 1) -> None:
        make = partial(square_scenario, size, side=side, loss=loss)
        bench.time(name, partial(fleet_time, make, skipped, counted, workers), inner_loops=size * counted)

    lossy = f"{100.0 * LOSS:g} % of frames lost"
    for size in SIZES:
        measure(f"a robot's tick, {size} robots", size)
        measure(f"a robot's tick, {size} robots, {lossy}", size, loss=LOSS)
    measure(f"a robot's tick, {SIZES[-1]} robots, {WORKERS} workers, wall", SIZES[-1], workers=WORKERS)
    measure(
        f"a robot's tick, {SIZES[-1]} robots, {WORKERS} workers, wall, {lossy}", SIZES[-1], loss=LOSS, workers=WORKERS
    )
    for side in SIDES:
        measure(f"a robot's tick, {AREA_SIZE} robots on {(side / KILOMETRE) ** 2:g} km2", AREA_SIZE, side)
    bench.end()


def square_scenario(size: int, folder: Path, side: int = KILOMETRE, loss: float = 0.0) -> dict[str, Any]:
    """Return the scenario of a fleet on a square with obstacles.

    Args:
        size: Number of robots.
        folder: Where the map is written.
        side: Of the square, m.
        loss: Share of the frames that are lost.
    """
    path = write_map(square(side), 1.0, folder / f"square-{side}.yaml")
    return {
        "name": f"square-{side}-{size}",
        "terrain": {"map": str(path)},
        "point": 1.0,
        "step": STEP_S,
        "robots": {"count": size, "model": "holonomic"},
        "faults": [{"kind": "loss", "rate": loss}] if loss else [],
    }


def fleet_time(
    make: Callable[[Path], Mapping[str, Any]], skipped: int, counted: int, workers: int, loops: int
) -> float:
    """Run a fleet, and measure its ticks after the first ones, with what the verdict does in each.

    Args:
        make: Makes the scenario in a folder.
        skipped: Ticks at the beginning that do not count.
        counted: Ticks after them.
        workers: Processes for the decisions.
        loops: Runs.

    Returns:
        The time of the ticks that count, of all runs together, s.

    Raises:
        RuntimeError: The verdict of a run is not valid.
    """
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        scenario = {**make(Path(folder)), "duration": (skipped + counted) * STEP_S}
        prepared = prepare(load_scenario(scenario))
        return sum(_run_time(prepared, skipped, workers) for _ in range(loops))


def _run_time(prepared: Prepared, skipped: int, workers: int) -> float:
    clock = time.process_time if workers == 1 else time.perf_counter
    begun_s = ended_s = 0.0

    def begin(_world: World) -> Callable[[TickRecord], None]:
        nonlocal begun_s
        begun_s = clock()
        return after_tick

    def after_tick(record: TickRecord) -> None:
        nonlocal begun_s, ended_s
        ended_s = clock()
        if record.k < skipped:
            begun_s = ended_s

    outcome = run_in_process(prepared, keep=False, watch=begin, workers=workers)
    if not outcome.verdict.valid:
        raise RuntimeError("the run's verdict is not valid")
    return ended_s - begun_s


if __name__ == "__main__":
    main()
