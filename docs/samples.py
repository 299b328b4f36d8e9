r"""Measure a sample of the numbers in docs/results again: ``python docs/samples.py [PAGE]`` names those that differ.

A number differs if it is further away than its interval on the page, or than a tenth where the page gives none. The
exit code is 1 if some number differs.

`docs/results/samples.json` has, for each page, its samples::

    {"says": "no limit \\| \\d+ \\| ([\\d.]+) ± ([\\d.]+)",     finds on the page the number, and half its interval
     "commands": ["fogwatch run yards --in-process --set seed={seed} --out {out}"],
     "seeds": [1, 2, 3],                                        the commands are executed with each; their mean counts
     "value": "summary.json:mfow_mean_s"}                       where their number is

and for pages without samples the reason (`unsampled`). A number without an interval may differ by `UNSTATED`, or by
`within`.
"""

from __future__ import annotations

import csv
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parents[1]
SAMPLES = "samples.json"
UNSTATED = 0.1
"""Share of a number by which it may differ where its page gives no interval."""

STDOUT = "stdout"
"""Stands for a file in `Sample.value`: the output of the last command."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A number of a page that commands measure again."""

    page: str  # name in docs/results, without its ending
    says: str  # pattern that finds the number and, as a second group, half its interval
    commands: Sequence[str]  # command lines; {out}, {seed} and {clone} are filled in
    value: str  # a file in {out} or `STDOUT`, a colon, and dotted keys or a column of a CSV file's first row
    seeds: Sequence[int] = (0,)  # the mean over them counts
    within: float | None = None  # allowed difference where the page gives no interval; None for a tenth
    scale: float = 1.0  # factor to the page's unit: 100 for a share that is given in percent

    def stated(self, folder: Path) -> tuple[float, float]:
        """Return the number that the page has, and the most by which a new measurement may differ."""
        text = " ".join((folder / f"{self.page}.md").read_text(encoding="utf-8").split())
        match = re.search(self.says, text)
        if match is None:
            raise SystemExit(f"docs/results/{self.page}.md: has no text like {self.says}; correct it in {SAMPLES}")
        value, half = match[1], match[2] if match.re.groups > 1 else None
        rounding = 0.5 * 10.0 ** -len(value.partition(".")[2])
        if half is not None:
            return float(value), float(half) + rounding
        return float(value), rounding + (UNSTATED * abs(float(value)) if self.within is None else self.within)

    def measure(self, clone: Path) -> float:
        """Execute the commands with each seed, and return the mean of their numbers in the page's unit."""
        values = []
        with TemporaryDirectory() as scratch:
            for seed in self.seeds:
                out = Path(scratch) / str(seed)
                printed = ""
                for line in self.commands:
                    command = line.format(out=out, seed=seed, clone=clone)
                    words = [sys.executable, "-m", *shlex.split(command)]
                    process = subprocess.run(words, cwd=scratch, capture_output=True, text=True, check=False)
                    # 1 is an answer too: of `fogwatch plan`, that no number of robots keeps the age.
                    if process.returncode not in (0, 1):
                        raise SystemExit(f"{command}: exit code {process.returncode}: {process.stderr.strip()[-300:]}")
                    printed = process.stdout
                values.append(self._read_value(out, printed))
        return self.scale * sum(values) / len(values)

    def _read_value(self, out: Path, printed: str) -> float:
        file, _, key = self.value.partition(":")
        try:
            text = printed if file == STDOUT else (out / file).read_text(encoding="utf-8")
            if file.endswith(".csv"):
                return float(next(csv.DictReader(text.splitlines()))[key])
            content: Any = json.loads(text)
            for part in key.split("."):
                content = content[int(part) if isinstance(content, list) else part]
            return float(content)
        except (OSError, ValueError, LookupError, StopIteration, TypeError) as error:
            raise SystemExit(f"{self.page}: {self.value}: no number there ({error}); correct {SAMPLES}") from None


def read_samples(root: Path = ROOT) -> tuple[list[Sample], dict[str, str]]:
    """Return the samples, and the reason for each page that has none."""
    content = json.loads((root / "docs" / "results" / SAMPLES).read_text(encoding="utf-8"))
    samples = [Sample(page, **entry) for page, listed in content["pages"].items() for entry in listed]
    return samples, content["unsampled"]


def main(page: str | None = None, root: Path = ROOT) -> int:
    """Check the samples of a page, or of all."""
    samples = [sample for sample in read_samples(root)[0] if page in (None, sample.page)]
    if not samples:
        raise SystemExit(f"{page}: no page of docs/results that has samples")
    changed = 0
    for sample in samples:
        recorded, allowed = sample.stated(root / "docs" / "results")
        value = sample.measure(root)
        same = abs(value - recorded) <= allowed
        changed += not same
        command = sample.commands[-1].format(out="OUT", seed=sample.seeds[-1], clone=".")
        print(
            f"{'same   ' if same else 'changed'} docs/results/{sample.page}.md: {recorded:g} (within {allowed:.3g}), "
            f"now {value:.4g}: {command}",
            flush=True,
        )
    print(f"{changed} of {len(samples)} numbers have changed")
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
