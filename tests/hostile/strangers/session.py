"""A session of attacks on fleets: spells one after the other, a few lines about each, and what broke."""

import json
import math
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console

from fogwatch.terminal.live_table import duration_text
from patrol.errors import BadInput
from patrol.values import MAX_SEED
from tests.hostile.strangers.judge import BEGUN, Seen, problems
from tests.hostile.strangers.run import run_spell
from tests.hostile.strangers.spell import Spell, draw_spell

REPORT = "seen.json"
"""The file, beside the run's folder, with what was seen of a spell that broke."""


class HostileSession:
    """Runs spells, prints what comes of them, and keeps those that break; a context manager around its folders."""

    def __init__(self, folder: Path, console: Console, over: Callable[[], bool]) -> None:
        """Check the folder."""
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise BadInput(f"--out {folder}: is no empty folder; choose one that is, or that does not exist yet")
        self._folder = folder
        self._console = console
        self._over = over
        self._broken: list[int] = []
        self._attacks: Counter[str] = Counter()
        self._done = 0
        self._begun = time.monotonic()
        self._part = tempfile.TemporaryDirectory(prefix="fogwatch-hostile-", ignore_cleanup_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._part.cleanup()

    def run(self, seed: int, minutes: float | None, runs: int | None) -> int:
        """Run spells until the time is over, or as many as asked for, and at least one."""
        until = math.inf if minutes is None else self._begun + 60.0 * minutes
        try:
            while not self._done or (time.monotonic() < until and (runs is None or self._done < runs)):
                if seed + self._done > MAX_SEED:
                    raise BadInput(f"--seed {seed}: the last seed would be above 2^63 - 1; give a smaller one")
                self._spell(draw_spell(seed + self._done))
                self._done += 1
        finally:
            self._sum_up()
        return int(bool(self._broken))

    def _spell(self, spell: Spell) -> None:
        begun = time.monotonic()
        folder = Path(self._part.name) / f"seed-{spell.seed}"
        seen, attacks = run_spell(spell, folder, self._over)
        self._attacks += attacks
        found = problems(spell, seen)
        manner = "in lockstep" if spell.lockstep else f"at {spell.scenario.pace:g} times real time"
        took = duration_text(time.monotonic() - begun)
        how = f"{seen.ticks} ticks {manner}, in {took}, the longest tick {seen.longest_s:.1f} s"
        self._say(f"seed {spell.seed}: {spell.who}; {how}: {'broke' if found else 'held'}")
        self._say(f"  tried: {_listed(attacks) or 'nothing'}")
        self._say(f"  counts: {_listed({what: n for what, n in seen.counts.items() if what != BEGUN}) or 'none'}")
        if not found and seen.failed:
            self._say(f"  the verdict names {spell.victim}: {', '.join(seen.failed)}")
        for problem in found:
            self._say(f"  {problem}")
        if found:
            self._broken.append(spell.seed)
            kept = self._keep(folder, seen)
            self._say(f"  kept in {kept}; again: python -m tests.hostile.strangers --runs 1 --seed {spell.seed}")
        with suppress(OSError):
            shutil.rmtree(folder)

    def _keep(self, folder: Path, seen: Seen) -> Path:
        kept = self._folder / folder.name
        self._folder.mkdir(parents=True, exist_ok=True)
        shutil.move(folder, kept)
        says = asdict(replace(seen, counts=dict(seen.counts)))  # asdict cannot copy a Counter
        (kept / REPORT).write_text(f"{json.dumps(says, indent=2)}\n", encoding="utf-8")
        return kept

    def _sum_up(self) -> None:
        spells = "1 spell" if self._done == 1 else f"{self._done} spells"
        attacks = "1 attack" if self._attacks.total() == 1 else f"{self._attacks.total()} attacks"
        took = duration_text(time.monotonic() - self._begun)
        if self._broken:
            how = f"{len(self._broken)} broke (seeds {', '.join(map(str, self._broken))})"
        else:
            how = "all held" if self._done else "none has run"
        self._say(f"{spells}, {attacks}: {how}, in {took}")

    def _say(self, line: str) -> None:
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
