from __future__ import annotations

from pathlib import Path

import pytest

from experiments.inprocess import InProcessFleet
from fogwatch.cli import app, guarded
from patrol.scenario import load_scenario


def fogwatch(*words: str) -> int:
    return guarded(lambda: app([*words], standalone_mode=False))


@pytest.fixture(autouse=True)
def signals_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command heeds signals for the rest of its process, which here is that of all tests."""
    monkeypatch.setattr("fogwatch.cli_chaos.heed", lambda *_, **__: None)


def test_what_holds_leaves_nothing_behind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "chaos"
    assert fogwatch("chaos", "--runs", "3", "--seed", "2000", "--out", str(out)) == 0
    assert capsys.readouterr().out.startswith("3 scenarios, 2 ways each: all held, in ")
    assert not out.exists()


def test_what_breaks_is_written_as_a_scenario_with_few_faults(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: InProcessFleet, number: int) -> None:
        raise RuntimeError(f"robot {number} stays")

    monkeypatch.setattr(InProcessFleet, "leave", fail)
    monkeypatch.setattr("fogwatch.hunt.MOST_NARROWED", 1)
    out = tmp_path / "chaos"
    assert fogwatch("chaos", "--runs", "5", "--seed", "2000", "--out", str(out)) == 1
    said = capsys.readouterr().out
    assert "breaks: in process: RuntimeError" in said
    files = sorted(out.glob("seed-*.yaml"))
    assert len(files) > 1
    assert [fault.kind for fault in load_scenario(files[0]).faults] == ["leave"]
    assert len(load_scenario(files[1]).faults) > 1
    for file in files:
        assert f"fogwatch run {file} --in-process" in said
        seed = file.stem.removeprefix("seed-")
        assert f"fogwatch chaos --runs 1 --seed {seed}\n" in said
        text = file.read_text(encoding="utf-8")
        assert text.startswith(f"# seed {seed} of fogwatch chaos breaks: in process: RuntimeError\n# Traceback")
        assert "# RuntimeError: robot" in text
    monkeypatch.undo()
    assert fogwatch("scenario", "check", str(files[0])) == 0


def test_a_seed_is_never_too_large(capsys: pytest.CaptureFixture[str]) -> None:
    assert fogwatch("chaos", "--runs", "2", "--seed", str(2**63 - 1)) == 2
    assert "the last seed would be above 2^63 - 1" in capsys.readouterr().err


def test_a_folder_that_cannot_be_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert fogwatch("chaos", "--runs", "1", "--out", str(tmp_path / "file" / "x")) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_an_interruption_is_130_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: InProcessFleet, number: int) -> None:
        raise KeyboardInterrupt(number)

    monkeypatch.setattr(InProcessFleet, "leave", interrupt)
    out = tmp_path / "chaos"
    assert fogwatch("chaos", "--runs", "30", "--seed", "2000", "--out", str(out)) == 130
    assert "interrupted" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.processes
def test_two_hold_as_processes_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "chaos"
    code = fogwatch("chaos", "--runs", "2", "--seed", "2100", "--processes", "--out", str(out))
    said = capsys.readouterr().out
    assert code == 0, said
    assert "2 scenarios, 3 ways each: all held, in " in said
    assert not out.exists()
