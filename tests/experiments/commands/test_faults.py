"""``fogwatch reproduce faults`` as a command: what it writes, that it goes on, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from experiments.faults.cost import VARIANTS
from fogwatch.cli.app import app
from fogwatch.cli.ending import guarded

SMALL = ("--terrain", "open", "--point", "2", "--robots", "2", "--duration", "20", "--seeds", "2", "--workers", "1")


def reproduce(*words: str) -> int:
    return guarded(lambda: app(["reproduce", "faults", *words], standalone_mode=False))


@pytest.mark.processes
def test_the_page_tells_everything_and_a_second_start_makes_no_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "faults"
    words = (*SMALL, "--only", "loss: 50 % lost,silence: total silence", "--out", str(out))
    assert reproduce(*words) == 0
    assert "12 runs made in " in capsys.readouterr().out
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
    assert reproduce(*words) == 0
    assert "0 runs made in " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--only", "silense"), "--only silense: no such group or condition; did you mean silence"),
        (("--set", "point=1"), "--set point: the experiment sets this field"),
        (("--set", "patrol.policy=committed"), "--set patrol.policy: the experiment sets this field"),
        (
            ("--set", "patrol.options.separation=none"),
            "--set patrol.options.separation: the experiment sets this field",
        ),
        (("--seeds", "0"), "seeds = 0"),
        (("--terrain", "yard"), "yards"),
        (("--robots", "0"), "robots"),
        (("--duration", "-5"), "duration"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], says: str
) -> None:
    assert reproduce(*words, "--out", str(tmp_path / "faults")) == 2
    err = capsys.readouterr().err
    assert says in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "faults").exists()
