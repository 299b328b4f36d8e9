"""An estimate of how long runs take on this machine, from the first ticks of a few of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from experiments.sweeps.plan import Run
from experiments.sweeps.worker import run_scenario
from patrol.errors import BadInput
from patrol.scenario import Scenario

MOST = 6
"""Number of runs that are tried."""

TICKS = 100
"""Number of ticks of each."""

LOADING_TICKS = 2
"""Number of ticks of a run before the first, which is not timed: it loads what a worker loads once for all its runs."""

ENOUGH_S = 15.0
"""Wall time after which no further run is tried, s."""


def seconds_per_run(runs: Sequence[Run], clock: Callable[[], float] = time.perf_counter) -> float | None:
    """Estimate the mean wall time of a run, s, by trying some of them, spread over the list.

    None if none of the tried runs can be made. `clock` gives the time in s.
    """
    from patrol.prepare import prepare  # here: loads kernels

    estimates_s: list[float] = []
    begun = clock()
    for index in range(min(MOST, len(runs))):
        run = runs[index * len(runs) // min(MOST, len(runs))]
        scenario = run.scenario
        short = _cut(scenario, TICKS)
        try:
            if not estimates_s:
                run_scenario(_cut(scenario, LOADING_TICKS), run.games)
            first = clock()
            prepared = prepare(short)
            ready = clock()
            run_scenario(prepared, run.games)
        except BadInput:  # the sweep reports it
            continue
        estimates_s.append(ready - first + (clock() - ready) * scenario.ticks / short.ticks)
        if clock() - begun > ENOUGH_S:
            break
    return sum(estimates_s) / len(estimates_s) if estimates_s else None


def _cut(scenario: Scenario, ticks: int) -> Scenario:
    """Return the first ticks of a scenario."""
    return scenario.model_copy(update={"duration": scenario.step * min(ticks, scenario.ticks)})
