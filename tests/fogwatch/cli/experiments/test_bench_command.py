"""``fogwatch bench`` as a command: what it writes, what it keeps when it is interrupted, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from experiments.bench.tools.measure import Effort, Finding, Task
from experiments.bench.tools.measure import take as take_all
from fogwatch.cli.app import app
from fogwatch.cli.ending import guarded
from fogwatch.cli.experiments import bench_command
from patrol.process.exit_codes import INTERRUPTED


def bench(*words: str) -> int:
    return guarded(lambda: app(["bench", *words], standalone_mode=False))


def test_what_was_measured_is_shown_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    as_json, page = tmp_path / "speed.json", tmp_path / "speed.md"
    assert bench("kernels", "--only", "record", "--quick", "--json", str(as_json), "--markdown", str(page)) == 0
    shown = capsys.readouterr().out
    assert "kernels: a record of five robots, decoded" in shown
    says = json.loads(as_json.read_text(encoding="utf-8"))
    (result,) = says["results"]
    assert result["group"] == "kernels"
    assert len(result["measures"][0]["values"]) == 3
    assert says["machine"]["python"]
    assert "| a record of five robots, decoded | ours | us | " in page.read_text(encoding="utf-8")


def test_what_was_measured_before_an_interruption_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(
        tasks: Sequence[Task],
        effort: Effort,
        begin: Callable[[Task], None],
        done: Callable[[Finding], None],
        _: Callable[[], float | None],
    ) -> None:
        take_all(tasks[:1], effort, begin, done)
        raise KeyboardInterrupt

    monkeypatch.setattr(bench_command, "take", interrupted)
    as_json = tmp_path / "speed.json"
    assert bench("kernels", "--only", "look", "--quick", "--json", str(as_json)) == INTERRUPTED
    assert len(json.loads(as_json.read_text(encoding="utf-8"))["results"]) == 1


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("kernel",), "kernel: no such group of measures; did you mean kernels"),
        (("memory", "--only", "moon"), "--only moon: is in no name; the names are: "),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], says: str
) -> None:
    assert bench(*words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_a_page_that_cannot_be_filled_is_found_before_anything_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "words.md"
    page.write_text("# Only words\n", encoding="utf-8")
    assert bench("kernels", "--only", "record", "--quick", "--markdown", str(page)) == 2
    captured = capsys.readouterr()
    assert "has no lines <!-- bench kernels -->" in captured.err
    assert "a record" not in captured.out
    assert page.read_text(encoding="utf-8") == "# Only words\n"
