"""Faults planted into fogwatch on purpose (`tests.chaos.bugs`): the verdict or the hunt must find each of them.

python -m tests.chaos.planted >build/chaos/planted.jsonl         # all
python -m tests.chaos.planted "a loss drops half as much"        # one
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from fogwatch.inprocess import fault_free_mfow, run_in_process
from patrol.prepare import Prepared
from tests.chaos.bugs import BUGS, Bug
from tests.chaos.coverage import of_scenario
from tests.chaos.examine import TRACES_DIFFER
from tests.chaos.swarm import random_fleet
from tests.random_building import draws_into

MOST_SEEDS = 60
"""Seeds after which a fault that was not found has survived."""


class Seeds:
    """Scenarios by seed, drawn once for all planted faults."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._drawn: dict[tuple[int, str], tuple[Prepared, set[str]]] = {}

    def draw(self, seed: int, settings: Mapping[str, Any]) -> tuple[Prepared, set[str]]:
        """Return a scenario, and its features and kinds of faults."""
        key = seed, repr(settings)
        if key not in self._drawn:
            prepared = random_fleet(seed, self._folder, settings, draws_into(self._folder))
            met = of_scenario(prepared.scenario) | {fault.kind for fault in prepared.scenario.faults}
            self._drawn[key] = prepared, met
        return self._drawn[key]


def find(bug: Bug, seeds: Seeds, most: int = MOST_SEEDS) -> tuple[int, int, tuple[str, ...]] | None:
    """Look for a planted fault, seed by seed.

    Args:
        bug: The fault.
        seeds: The scenarios.
        most: Seeds that are looked at.

    Returns:
        The seed that found it, the number of seeds that were run, and the checks that failed there; None where it has
        survived.
    """
    ran = 0
    for seed in range(1, most + 1):
        prepared, met = seeds.draw(seed, bug.settings)
        if bug.needs and bug.needs not in met:
            continue
        ran += 1
        baseline_s = fault_free_mfow(prepared) if bug.check == "recovery" else None
        with pytest.MonkeyPatch.context() as patch:
            bug.plant(patch)
            found = _found_by(bug, prepared, baseline_s)
        if found:
            return seed, ran, found
    return None


def _found_by(bug: Bug, prepared: Prepared, baseline_s: float | None) -> tuple[str, ...]:
    """Return the checks that a planted fault fails; a check that only warns counts where it is meant."""
    try:
        first = run_in_process(prepared, baseline_s=baseline_s)
        checks = first.verdict.checks
        found = tuple(c.name for c in checks if not c.ok or (c.warnings and c.name == bug.check))
        if found or bug.check != TRACES_DIFFER:
            return found
        again = run_in_process(prepared, keep=False, verify_fog=False)
    except Exception as error:  # noqa: BLE001 - finds it too
        return (type(error).__name__,)
    return () if again.summary.trace_hash == first.summary.trace_hash else (TRACES_DIFFER,)


def main() -> int:
    """Look for the planted faults, and print a line for each as JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.planted")
    parser.add_argument("names", nargs="*", help="of planted faults (default: all)")
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        seeds = Seeds(Path(folder))
        for what in parser.parse_args().names or BUGS:
            bug = BUGS[what]
            seed, ran, checks = find(bug, seeds) or (None, None, ())
            survivors += bug.check not in checks
            line = {"what": what, "kind": bug.kind, "check": bug.check, "seed": seed, "ran": ran, "checks": checks}
            print(json.dumps(line), flush=True)
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
