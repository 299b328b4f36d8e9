"""The tables of a hunt: what was met how often, and what never: `python -m tests.chaos.table build/chaos`."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

from tests.chaos.coverage import PAIRED, SINGLES, pairs

ENOUGH = 100
"""Seeds after which everything must have been met."""

ENOUGH_FOR_PAIRS = 500
"""Seeds after which every pair of kinds and features must have been met."""

NO_PAIRS = frozenset(
    {
        *((f"feature closures by {how}", "feature zone: one-way") for how in ("rates", "times")),
        *((f"feature {what}", "feature zone: age") for what in ("narrow view", "poor quality")),
        *((f"fault {kind}", "feature zone: one-way") for kind in ("close", "open")),
    }
)
"""Pairs that no scenario may have: closures leave no one-way zone, and a wanted age needs a tour to compare with."""


def read_seeds(file: Path) -> list[dict[str, Any]]:
    """Return the lines of a hunt's file; none where there is no file."""
    if not file.exists():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def all_pairs() -> set[tuple[str, str]]:
    """Return the pairs that can be met."""
    paired = sorted(name for name in SINGLES if name.split()[0] in PAIRED and name != "feature direct radio")
    return set(combinations(paired, 2)) - NO_PAIRS


def missing(seeds: Sequence[dict[str, Any]]) -> list[str]:
    """Return what should have been met by so many seeds, and was not."""
    met = {name for seed in seeds for name in seed["met"]}
    never = [name for name in SINGLES if name not in met] if len(seeds) >= ENOUGH else []
    if len(seeds) >= ENOUGH_FOR_PAIRS:
        met_pairs = {pair for seed in seeds for pair in pairs(seed["met"])}
        never += [" with ".join(pair) for pair in sorted(all_pairs() - met_pairs)]
    return never


def main() -> int:
    """Print the tables."""
    seeds = read_seeds(Path(sys.argv[1]) / "seeds.jsonl")
    counts = Counter(name for seed in seeds for name in seed["met"])
    print(f"{len(seeds)} seeds, median {median(seed['seconds'] for seed in seeds):.1f} s")
    for name in SINGLES:
        print(f"{counts[name]:5} {name}")
    met_pairs = {pair for seed in seeds for pair in pairs(seed["met"])}
    print(f"{len(met_pairs & all_pairs())} of {len(all_pairs())} pairs")
    for pair in sorted(all_pairs() - met_pairs):
        print("   never", *pair)
    return 0


if __name__ == "__main__":
    sys.exit(main())
