"""``fogwatch reproduce check``: documented numbers are measured again, and those that have changed are named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from experiments.commands import reproduce
from fogwatch.cli.app import app
from fogwatch.cli.ending import guarded

PAGE = "| no limit | 50.4 ± 0.9 |\n| slow |\n60 s in\n the mean |\n"
NO_LIMIT = r"no limit \| ([\d.]+) ± ([\d.]+)"


def check(*words: str) -> int:
    return guarded(lambda: app(["reproduce", "check", *words], standalone_mode=False))


@pytest.fixture(name="clone")
def make_clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "docs" / "results").mkdir(parents=True)
    (tmp_path / "docs" / "results" / "radio.md").write_text(PAGE)
    (tmp_path / "measured.json").write_text(json.dumps({"mfow": [30.6, 51.2], "share": 0.55}))
    monkeypatch.setattr(reproduce, "CLONE", tmp_path)
    return tmp_path


def samples(clone: Path, *given: dict[str, object]) -> None:
    common = {"commands": ["json.tool {clone}/measured.json"]}
    content = {"pages": {"radio": [{**common, **sample} for sample in given]}, "unsampled": {"speed": "times"}}
    (clone / "docs" / "results" / "samples.json").write_text(json.dumps(content))


def test_a_number_beyond_its_interval_is_named(clone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples(clone, {"says": NO_LIMIT, "value": "stdout:mfow.0"}, {"says": NO_LIMIT, "value": "stdout:mfow.1"})
    assert check() == 1
    changed, same, count = capsys.readouterr().out.splitlines()
    assert changed.startswith("changed docs/results/radio.md: 50.4 (within 0.95), now 30.6: json.tool ")
    assert same.startswith("same    docs/results/radio.md: 50.4 (within 0.95), now 51.2: ")
    assert count == "1 of 2 numbers have changed"


def test_without_an_interval_a_tenth_is_allowed_unless_the_sample_says_so(
    clone: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slow = {"says": r"(\d+) s in the mean", "value": "stdout:share", "scale": 100}
    samples(clone, slow)
    assert check("radio") == 0
    assert "60 (within 6.5), now 55" in capsys.readouterr().out
    samples(clone, {**slow, "within": 1})
    assert check("radio") == 1


@pytest.mark.parametrize(
    ("sample", "words", "says"),
    [
        ({"says": "no such ([0-9]+)", "value": "stdout:share"}, [], "docs/results/radio.md: has no text like no such"),
        ({"says": NO_LIMIT, "value": "stdout:nothing"}, [], "radio: stdout:nothing: no number there"),
        ({"says": NO_LIMIT, "value": "x:y", "commands": ["json.tool nowhere"]}, [], "json.tool nowhere: exit code"),
        ({"says": NO_LIMIT, "value": "stdout:share"}, ["speed"], "speed: has no sample: times"),
        ({"says": NO_LIMIT, "value": "stdout:share"}, ["radios"], "radios: no such page; did you mean radio?"),
    ],
)
def test_what_cannot_be_checked_is_one_line(
    clone: Path, sample: dict[str, object], words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    samples(clone, sample)
    assert check(*words) == 2
    assert says in capsys.readouterr().err
