"""A hunt for faults of fogwatch: `make chaos RUNS=30 SEED=1`.

Each seed is a random scenario (`tests.chaos.swarm`), run in several ways (`tests.chaos.examine`). What breaks is
written as scenario files, what was met to ``seeds.jsonl``, a line for each seed. The hunt fails when a seed breaks, and
when many seeds have never met something (`tests.chaos.table`). With ``--out`` it goes on where that folder ends.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from patrol.errors import BadInput
from patrol.scenario import Scenario, dump_scenario
from tests.chaos.examine import Breakage, Examiner, TooSlow, without_needless_faults
from tests.chaos.swarm import random_fleet
from tests.chaos.table import SEEDS, missing, read_lines
from tests.random_building import draws_into

ROOT = Path(__file__).resolve().parents[2]
NOTHING: Mapping[str, str] = MappingProxyType({})
PROCESSES_EVERY = 50
"""A seed of so many is run as real processes too."""


def main() -> int:
    """Run the hunt."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=30, help="number of seeds (default: 30)")
    parser.add_argument("--seed", type=int, default=1, help="the first seed (default: 1)")
    parser.add_argument("--out", type=Path, help="folder to go on in (default: build/chaos, from the beginning)")
    parser.add_argument("--processes", type=int, default=PROCESSES_EVERY, metavar="K", help="every K-th as processes")
    parser.add_argument(
        "--set", action="append", default=[], metavar="FIELD=VALUE", help="of every scenario; repeatable"
    )
    asked = parser.parse_args()
    given = dict(field.split("=", 1) for field in asked.set)
    out = asked.out or ROOT / "build" / "chaos"
    out.mkdir(parents=True, exist_ok=True)
    file = out / SEEDS
    if asked.out is None:
        file.unlink(missing_ok=True)
    done = {line["seed"] for line in read_lines(file)}
    for seed in range(asked.seed, asked.seed + asked.runs):
        if seed not in done:
            processes = asked.processes > 0 and seed % asked.processes == 0
            line = hunt(seed, out, processes=processes, given=given)
            with file.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(line) + "\n")
    seeds = read_lines(file)
    broken, never = sum(line["broke"] is not None for line in seeds), missing(seeds)
    for name in never:
        print(f"never met: {name}")
    print(f"{len(seeds)} seeds: {broken} broke, {len(never)} names never met; python -m tests.chaos.table {out} .")
    return 1 if broken or never else 0


def hunt(
    seed: int, out: Path, *, processes: bool, given: Mapping[str, str] = MappingProxyType({})
) -> dict[str, object]:
    """Run one seed and return its line; `given` has what is not drawn, as for `random_fleet`."""
    begun_s = time.process_time()
    again = f"make chaos RUNS=1 SEED={seed}{' PROCESSES=1' if processes else ''}"
    if given:
        again += f' SET="{" ".join(f"--set {field}={value}" for field, value in given.items())}"'
    folder = out / f"seed-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    line: dict[str, object] = {"seed": seed, "processes": processes}
    try:
        prepared = random_fleet(seed, folder, given, draws_into(folder))
    except BadInput as refused:
        print(f"seed {seed} is refused: {refused}\n  {again}", flush=True)
        return {**line, "cpu_s": 0.0, "broke": f"not drawn: {refused}", "met": []}
    examiner = Examiner(prepared, processes=processes, keep=folder / "run")
    try:
        breakage = examiner.examine()
    except TooSlow as slow:
        breakage = Breakage("too slow", str(slow))
    spent_s = time.process_time() - begun_s
    if breakage is None:
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()
    else:
        scenario = prepared.scenario
        _write(folder / "scenario.yaml", scenario, breakage, again)
        last = breakage.detail.strip().rpartition("\n")[2]
        print(f"seed {seed} breaks: {breakage.kind}\n  {last}\n  {again}", flush=True)

        def breaks(fewer: Scenario) -> bool:
            repeated = examiner.examine(fewer)
            return repeated is not None and repeated.kind == breakage.kind

        if breakage.kind != "too slow":
            _write(folder / "fewer.yaml", without_needless_faults(scenario, breaks), breakage, again)
    print(f"seed {seed}: {spent_s:.1f} s", file=sys.stderr, flush=True)
    return {**line, "cpu_s": round(spent_s, 2), "broke": breakage and breakage.kind, "met": sorted(examiner.met)}


def _write(file: Path, scenario: Scenario, breakage: Breakage, again: str) -> None:
    text = f"{again} breaks: {breakage.kind}\n{breakage.detail}"
    comment = "\n".join(f"# {line}".rstrip() for line in text.splitlines())
    file.write_text(f"{comment}\n\n{dump_scenario(scenario)}", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
