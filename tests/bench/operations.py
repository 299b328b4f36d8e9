"""Operations of three fixed fleets, which do not depend on the machine: what makes decisions slow is seen in counts.

    python -m tests.bench.operations        # counts them, and writes operations.json

Counted are, for a robot's tick: calls of functions, Python's and C's; points that waves settle; robots looked at by
keeping right and by free choice.
"""

import cProfile
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from agent.bodies import keeping_right
from agent.kernels.wave import SETTLED, STATUS
from agent.policies import choice
from agent.routes import wave
from bench.fleets import square_scenario
from fogwatch.inprocess import InProcessFleet, run_in_process
from patrol.prepare import prepare
from patrol.scenario import load_scenario

WRITTEN = Path(__file__).with_name("operations.json")

TICKS = 30
SKIPPED = 5
"""Ticks at the beginning that do not count: they fill caches."""

SIDE_M = 200


def fleets(folder: Path) -> Mapping[str, Mapping[str, Any]]:
    """Return the scenarios by name; `folder` is where a map is written."""
    cars: dict[str, Any] = {"terrain": {"builtin": "site"}, "point": 0.5, "step": 0.5, "duration": 0.5 * TICKS}
    cars["robots"] = {"count": 5, "model": "car"}
    square = {**square_scenario(40, folder, side=SIDE_M), "duration": 0.5 * TICKS}
    return {
        "five cars": cars,
        "forty robots": square,
        "forty robots, a fifth of all frames lost": {**square, "faults": [{"kind": "loss", "rate": 0.2}]},
    }


def count(scenario: Mapping[str, Any]) -> dict[str, float]:
    """Run a fleet, and return its operations in a robot's tick."""
    counted = {"calls": 0, "points settled": 0, "robots looked at": 0}
    prepared = prepare(load_scenario(scenario))
    profile = cProfile.Profile()
    phase_b = InProcessFleet.phase_b

    def profiled(fleet: InProcessFleet, k: int, heard: Any) -> Any:
        if k < SKIPPED:
            return phase_b(fleet, k, heard)
        with _counting(counted):
            profile.enable()
            try:
                return phase_b(fleet, k, heard)
            finally:
                profile.disable()

    with patch.object(InProcessFleet, "phase_b", profiled):
        outcome = run_in_process(prepared, keep=False)
    assert outcome.verdict.valid
    # From Python 3.12 on comprehensions are no calls.
    entries = ((getattr(entry.code, "co_name", ""), entry.callcount) for entry in profile.getstats())
    counted["calls"] = sum(calls for name, calls in entries if not name.endswith("comp>"))
    turns = len(prepared.scenario.roster) * (TICKS - SKIPPED)
    return {name: round(number / turns, 1) for name, number in counted.items()}


@contextmanager
def _counting(counted: dict[str, int]) -> Iterator[None]:
    """Count what kernels do within the context."""

    def settling(kernel: Callable[..., Any]) -> Callable[..., Any]:
        def settle(state: NDArray[np.uint8], *rest: Any) -> Any:
            found = kernel(state, *rest)
            counted["points settled"] += int(np.count_nonzero(state & STATUS == SETTLED))
            return found

        return settle

    def looking(kernel: Callable[..., Any]) -> Callable[..., Any]:
        def look(robots: Any, *rest: Any) -> Any:
            counted["robots looked at"] += len(robots)
            return kernel(robots, *rest)

        return look

    kernels = [(keeping_right, "note_motions"), (choice, "any_nearer"), (choice, "those_within")]
    with ExitStack() as patches:
        for kernel in ("settle", "settle_box"):
            patches.enter_context(patch.object(wave, kernel, settling(getattr(wave, kernel))))
        for module, kernel in kernels:
            patches.enter_context(patch.object(module, kernel, looking(getattr(module, kernel))))
        yield


def main() -> None:
    """Count, and write down what was counted."""
    with TemporaryDirectory() as folder:
        counts = {name: count(scenario) for name, scenario in fleets(Path(folder)).items()}
    WRITTEN.write_text(f"{json.dumps(counts, indent=2)}\n", encoding="utf-8")
    print(json.dumps(counts, indent=2))


if __name__ == "__main__":
    main()
