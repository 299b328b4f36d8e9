"""``fogwatch reproduce faults`` as a command: what it writes, that it goes on, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from experiments.faults.cost import VARIANTS
from tests.experiments.commands.conftest import Command, output, refuses

FAULTS = ("reproduce", "faults")
SMALL = ("--terrain", "open", "--point", "2", "--robots", "2", "--duration", "20", "--seeds", "2", "--workers", "1")


@pytest.mark.processes
def test_the_page_tells_everything_and_a_second_start_makes_no_run(tmp_path: Path, run: Command) -> None:
    out = tmp_path / "faults"
    words = (*FAULTS, *SMALL, "--only", "loss: 50 % lost,silence: total silence", "--out", str(out))
    said = output(run(*words))
    assert "12 runs made in " in said
    page = (out / "faults.md").read_text(encoding="utf-8")
    for variant in VARIANTS:
        assert f"| total silence | {variant} | " in page
    assert "Every run's verdict is valid" in page
    says = json.loads((out / "faults.json").read_text(encoding="utf-8"))
    found = {(one["condition"], one["variant"]): one for one in says["findings"]}
    silent, lossy = (found[name, "final algorithm"] for name in ("total silence", "50 % lost"))
    assert silent["delivered"]["mean"] == 0.0
    assert 0.0 < lossy["delivered"]["mean"] < 1.0
    assert found["no faults", "final algorithm"]["cost"]["mean"] == 1.0
    assert len(says["comparisons"]) == 3
    for name in ("loss.png", "loss.svg", "costs.png", "costs.svg"):
        assert f"![{name}]({name})" in page or name.endswith(".svg")
        assert (out / name).stat().st_size > 1000
    assert "0 runs made in " in run(*words).out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--set", "point=1"), "--set point: the experiment sets this field"),
        (("--set", "patrol.policy=committed"), "--set patrol.policy: the experiment sets this field"),
        (("--set", "patrol.options.separation=none"), "--set patrol.options.separation: the experiment sets this"),
        (("--seeds", "0"), "seeds = 0"),
        (("--terrain", "yard"), "yards"),
        (("--robots", "0"), "robots"),
        (("--duration", "-5"), "duration"),
    ],
)
def test_nonsense_is_refused_in_one_line(tmp_path: Path, run: Command, words: tuple[str, ...], says: str) -> None:
    refuses(run(*FAULTS, *words, "--out", "faults"), says)
    assert not (tmp_path / "faults").exists()
