"""The tables of a hunt: what was met how often, and which check found which planted fault.

python -m tests.chaos.table build/chaos                              # prints them
python -m tests.chaos.table build/chaos docs/results/chaos.md        # puts them at the end of that page
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
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

MARK = "<!-- made by python -m tests.chaos.table; do not edit below -->\n"


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


def tables(seeds: Sequence[dict[str, Any]], planted: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Make the tables, line by line, as Markdown."""
    if seeds:
        yield from _coverage(seeds)
    if planted:
        yield from _finders(planted)


def _coverage(seeds: Sequence[dict[str, Any]]) -> Iterator[str]:
    counts = Counter(name for seed in seeds for name in seed["met"])
    broke = [f"{seed['seed']} ({seed['broke']})" for seed in seeds if seed["broke"]]
    numbers = sorted(seed["seed"] for seed in seeds)
    met, can = len(_pairs_met(seeds) & all_pairs()), len(all_pairs())
    processes = sum(seed["processes"] for seed in seeds)
    spent_s = [seed["cpu_s"] for seed in seeds]
    yield "## What was met\n"
    yield f"{len(seeds)} seeds, {numbers[0]} to {numbers[-1]}, {processes} of them as processes too, in the median"
    yield f"{median(spent_s):.1f} s of processor time, at most {max(spent_s):.0f} s. Of {can} pairs of kinds of faults"
    yield f"and features, {met} were met. Broke: {', '.join(broke) or 'none'}.\n"
    for family in dict.fromkeys(name.split()[0] for name in SINGLES):
        named = [name for name in SINGLES if name.split()[0] == family]
        yield from (f"| {family.rstrip(':')} | seeds |", "|---|---|")
        yield from (f"| {name.partition(' ')[2]} | {counts[name]} |" for name in named)
        yield ""


def _finders(planted: Sequence[dict[str, Any]]) -> Iterator[str]:
    found = sum(line["seed"] is not None for line in planted)
    yield "## Which planted fault is found, by what, and when\n"
    yield f"{found} of {len(planted)} are found. *Seeds* is the first seed that finds the fault, counted from 1;"
    yield "*run* are those of them that have what it is planted into.\n"
    yield "| planted | in | found by | seeds | run |"
    yield "|---|---|---|---|---|"
    for line in planted:
        checks = ", ".join(line["checks"]) or "**nothing**"
        yield f"| {line['what']} | {line['kind'] or line['check']} | {checks} | {line['seed']} | {line['ran']} |"


def _pairs_met(seeds: Sequence[dict[str, Any]]) -> set[tuple[str, str]]:
    return {pair for seed in seeds for pair in pairs(seed["met"])}


def main() -> int:
    """Print the tables, or put them into a page."""
    folder = Path(sys.argv[1])
    made = "\n".join(tables(read_lines(folder / SEEDS), read_lines(folder / PLANTED)))
    for page in map(Path, sys.argv[2:]):
        before, mark, _ = page.read_text(encoding="utf-8").partition(MARK)
        page.write_text(f"{before}{mark}\n{made}\n", encoding="utf-8")
    if not sys.argv[2:]:
        print(made)
    return 0


if __name__ == "__main__":
    sys.exit(main())
