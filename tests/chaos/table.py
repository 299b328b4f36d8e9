"""The tables of a hunt: what was met how often, and which check found which planted fault.

python -m tests.chaos.table build/chaos docs/results        # writes chaos-met.csv and chaos-planted.csv there
"""

from __future__ import annotations

import csv
import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any

from tests.chaos.coverage import PAIRED, SINGLES, pairs

ENOUGH = {"body": 30, "policy": 40, "fault": 100, "terrain": 100, "feature": 300, "state:": 500}
"""Seeds after which all of a family must have been met: about fifteen times as many as its rarest member takes."""

ENOUGH_FOR_PAIRS = 500
"""Seeds after which every pair of kinds of faults and features must have been met."""

SEEDS, PLANTED = "seeds.jsonl", "planted.jsonl"
BY_PROCESSES = "feature direct radio"
"""What only seeds that are run as processes meet, which a hunt may leave out."""

NO_TOUR = ("narrow view", "poor quality", "several bodies", "vertices")
"""Features with which ground has no tour that a wanted age could be compared with."""

NO_PAIRS = frozenset({*((f"feature {what}", "feature zone: age") for what in NO_TOUR)})
"""Pairs that no scenario has: ages need a tour."""


def read_lines(file: Path) -> list[dict[str, Any]]:
    """Return the lines of a file of a hunt; none where there is no file."""
    if not file.exists():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def all_pairs() -> set[tuple[str, str]]:
    """Return the pairs that can be met."""
    paired = sorted(name for name in SINGLES if name.split()[0] in PAIRED and name != BY_PROCESSES)
    return set(combinations(paired, 2)) - NO_PAIRS


def missing(seeds: Sequence[dict[str, Any]]) -> list[str]:
    """Return what should have been met by so many seeds, and was not."""
    met = {name for seed in seeds for name in seed["met"]}
    expected = [name for name in SINGLES if name != BY_PROCESSES and len(seeds) >= ENOUGH[name.split()[0]]]
    never = [name for name in expected if name not in met]
    if len(seeds) >= ENOUGH_FOR_PAIRS:
        never += [" with ".join(pair) for pair in sorted(all_pairs() - _pairs_met(seeds))]
    return never


def write_met(seeds: Sequence[dict[str, Any]], file: Path) -> None:
    """Write how many seeds have met each fault, feature, policy, body, terrain and state."""
    counts = Counter(name for seed in seeds for name in seed["met"])
    names = [(name, *name.split(" ", 1)) for name in SINGLES]
    rows = [(family.rstrip(":"), member, counts[name]) for name, family, member in names]
    _write_csv(file, ("family", "name", "seeds"), rows)


def write_finders(planted: Sequence[dict[str, Any]], file: Path) -> None:
    """Write which checks find each planted fault, and with which seed.

    ``seeds`` is the first seed that finds it, counted from 1; ``run`` are those of them that have what it is planted
    into.
    """
    rows = [
        (line["what"], line["kind"] or line["check"], ", ".join(line["checks"]), line["seed"], line["ran"])
        for line in planted
    ]
    _write_csv(file, ("planted", "in", "found_by", "seeds", "run"), rows)


def totals(seeds: Sequence[dict[str, Any]]) -> str:
    """Return what a hunt did, in a sentence."""
    broke = [f"{seed['seed']} ({seed['broke']})" for seed in seeds if seed["broke"]]
    met, can = len(_pairs_met(seeds) & all_pairs()), len(all_pairs())
    processes = sum(seed["processes"] for seed in seeds)
    spent_s = [seed["cpu_s"] for seed in seeds]
    return (
        f"{len(seeds)} seeds, {processes} of them as processes too, in the median {median(spent_s):.1f} s of processor "
        f"time, at most {max(spent_s):.0f} s; {met} of {can} pairs met; broke: {', '.join(broke) or 'none'}"
    )


def _write_csv(file: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with file.open("w", encoding="utf-8", newline="") as out:
        csv.writer(out, lineterminator="\n").writerows((head, *rows))


def _pairs_met(seeds: Sequence[dict[str, Any]]) -> set[tuple[str, str]]:
    return {pair for seed in seeds for pair in pairs(seed["met"])}


def main() -> int:
    """Write the tables of a hunt's folder into another folder, and print what the hunt did."""
    hunt, out = map(Path, sys.argv[1:])
    if seeds := read_lines(hunt / SEEDS):
        write_met(seeds, out / "chaos-met.csv")
        print(totals(seeds))
    if planted := read_lines(hunt / PLANTED):
        write_finders(planted, out / "chaos-planted.csv")
    return 0


if __name__ == "__main__":
    sys.exit(main())
