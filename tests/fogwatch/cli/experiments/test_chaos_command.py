from __future__ import annotations

from pathlib import Path

import pytest

from experiments.chaos import Breakage, Narrowed
from experiments.inprocess import InProcessFleet
from fogwatch.cli.app import app
from fogwatch.cli.ending import guarded
from patrol.process.lifeline import Ending
from patrol.scenario import Scenario, load_scenario


def fogwatch(*words: str) -> int:
    return guarded(lambda: app([*words], standalone_mode=False))


@pytest.fixture(autouse=True)
def signals_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command heeds signals for the rest of its process, which here is that of all tests."""
    monkeypatch.setattr("fogwatch.cli.experiments.chaos_command.heed", lambda *_, **__: Ending())


def test_what_holds_leaves_nothing_behind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "chaos"
    assert fogwatch("chaos", "--runs", "3", "--seed", "2018", "--out", str(out)) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "3 scenarios, seeds 2018 to 2020, 2 ways each ..."
    assert said[-1].startswith("3 scenarios, 2 ways each: all held, in ")
    assert not out.exists()


def test_what_breaks_is_written_as_a_scenario_with_few_faults(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: InProcessFleet, number: int) -> None:
        raise RuntimeError(f"robot {number} stays")

    monkeypatch.setattr(InProcessFleet, "leave", fail)
    monkeypatch.setattr("fogwatch.chaos_session.MOST_NARROWED", 1)
    out = tmp_path / "chaos"
    assert fogwatch("chaos", "--runs", "2", "--seed", "2004", "--out", str(out)) == 1
    said = capsys.readouterr().out
    assert "breaks: in process: RuntimeError" in said
    files = sorted(out.glob("seed-*.yaml"))
    assert len(files) > 1
    *others, last = load_scenario(files[0]).faults
    assert last.kind == "leave"
    assert {(fault.kind, getattr(fault, "offset", 0.0)) for fault in others} <= {("clock", 0.0)}
    assert "broke in the same way with 1 of " in said
    assert len(load_scenario(files[1]).faults) > 1
    for file in files:
        assert f"fogwatch run {file} --in-process" in said
        seed = file.stem.removeprefix("seed-")
        assert f"fogwatch chaos --runs 1 --seed {seed}\n" in said
        text = file.read_text(encoding="utf-8")
        kind = "in process: RuntimeError at worldsim.fleet.acts:"
        assert text.startswith(f"# seed {seed} of fogwatch chaos breaks: {kind}")
        assert "\n# Traceback" in text
        key = load_scenario(file).radio.key
        assert key is None or Path(key) == out / "fleet.key"
        assert "# RuntimeError: robot" in text
    assert any(load_scenario(file).radio.key for file in files)
    monkeypatch.undo()
    for file in files:
        assert fogwatch("scenario", "check", str(file)) == 0


def test_a_folder_that_is_not_empty_is_left_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = tmp_path / "seed-2000"
    kept.mkdir()
    (kept / "mine").write_text("dear", encoding="utf-8")
    (tmp_path / "fleet.key").write_bytes(b"a key that robots are using")
    assert fogwatch("chaos", "--runs", "1", "--seed", "2000", "--out", str(tmp_path)) == 2
    assert "is not empty; choose a folder that is" in capsys.readouterr().err
    assert (tmp_path / "fleet.key").read_bytes() == b"a key that robots are using"
    assert (kept / "mine").read_text(encoding="utf-8") == "dear"


def test_an_empty_folder_stays(tmp_path: Path) -> None:
    assert fogwatch("chaos", "--runs", "1", "--seed", "2025", "--out", str(tmp_path)) == 0
    assert list(tmp_path.iterdir()) == []


def test_what_is_too_slow_does_not_break(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiments.chaos.LIMIT_S", 0.0)
    out = tmp_path / "chaos"
    assert fogwatch("chaos", "--runs", "2", "--seed", "2000", "--out", str(out)) == 3
    said = capsys.readouterr().out
    assert "seed 2000 is too slow to tell: in process: broken off after 0 s" in said
    assert "2 scenarios, 2 ways each: 2 too slow to tell, in " in said
    assert "; seeds 2000, 2001" in said
    assert not out.exists()


def test_when_the_tries_run_out_it_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = Breakage("refused", "no", "in process")
    monkeypatch.setattr("fogwatch.chaos_session.examine", lambda *_: broken)
    monkeypatch.setattr(
        "fogwatch.chaos_session.narrow", lambda scenario, _: Narrowed(scenario, scenario.faults[:2], False)
    )
    assert fogwatch("chaos", "--runs", "1", "--seed", "2000", "--out", str(tmp_path / "chaos")) == 1
    assert "the limit of tries was reached, so fewer may do" in capsys.readouterr().out


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
    told = capsys.readouterr()
    assert "interrupted" in told.err
    assert " of 30 scenarios, 2 ways each: " in told.out.splitlines()[-1]
    assert not out.exists()


def test_an_interruption_tells_what_broke_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def examined(scenario: Scenario, _: object) -> Breakage:
        if scenario.name == "chaos-2002":
            raise KeyboardInterrupt
        return Breakage("refused", "no", "in process")

    monkeypatch.setattr("fogwatch.chaos_session.examine", examined)
    monkeypatch.setattr("fogwatch.chaos_session.MOST_NARROWED", 0)
    out = tmp_path / "chaos"
    assert fogwatch("chaos", "--runs", "30", "--seed", "2000", "--out", str(out)) == 130
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("2 of 30 scenarios, 2 ways each: 2 broke, in ")
    assert last.endswith("; seeds 2000, 2001")
    assert sorted(path.suffix for path in out.iterdir() if path.stem.startswith("seed-")) == [".yaml", ".yaml"]


@pytest.mark.processes
def test_two_hold_as_processes_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "chaos"
    code = fogwatch("chaos", "--runs", "2", "--seed", "2025", "--processes", "--out", str(out))
    said = capsys.readouterr().out
    assert code == 0, said
    assert "2 scenarios, 3 ways each: all held, in " in said
    assert not out.exists()
