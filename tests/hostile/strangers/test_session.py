"""A session of attacks: what it prints, what it keeps, and what it refuses."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

from patrol.errors import BadInput
from tests.hostile.strangers.judge import Seen
from tests.hostile.strangers.session import HostileSession
from tests.hostile.strangers.spell import Spell
from worldsim.run_record import COMPLETED


def attack(out: Path, minutes: float | None = None, runs: int | None = None, seed: int = 7) -> int:
    with HostileSession(out, Console(), lambda: False) as session:
        return session.run(seed, minutes, runs)


def seen_of(spell: Spell, outcome: str) -> tuple[Seen, Counter[str]]:
    failed = {} if outcome == "valid" else {"fog": "tick 3: 7 points differ"}
    seen = Seen(
        COMPLETED, outcome, failed, "a", "a" if spell.lockstep else "", counts=Counter(attacks=1, messages=7), ticks=500
    )
    return seen, Counter(floods=2)


def test_bad_input_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="--out /dev/null: is no empty folder"):
        attack(Path("/dev/null"))
    with pytest.raises(BadInput, match="the last seed would be above"):
        attack(tmp_path / "out", runs=1, seed=2**63)


def test_fleets_that_hold_leave_nothing_behind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def held(spell: Spell, folder: Path, over: Callable[[], bool]) -> tuple[Seen, Counter[str]]:
        assert not over()
        (folder / "run").mkdir(parents=True)
        return seen_of(spell, "valid")

    monkeypatch.setattr("tests.hostile.strangers.session.run_spell", held)
    assert attack(tmp_path / "out", runs=3) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines if line.startswith("seed")] == ["seed 7", "seed 8", "seed 9"]
    assert "  tried: 2 floods" in lines
    assert "  counts: 7 messages" in lines
    assert lines[-1].startswith("3 spells, 6 attacks: all held, in ")
    assert not (tmp_path / "out").exists()


def test_without_time_one_fleet_is_attacked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.hostile.strangers.session.run_spell", lambda spell, *_: seen_of(spell, "valid"))
    assert attack(tmp_path / "out", minutes=0.0) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("1 spell, 2 attacks: all held, in ")


def test_a_fleet_that_breaks_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broke(spell: Spell, folder: Path, _over: object) -> tuple[Seen, Counter[str]]:
        (folder / "run").mkdir(parents=True)
        return seen_of(spell, "invalid" if spell.seed == 8 else "valid")

    monkeypatch.setattr("tests.hostile.strangers.session.run_spell", broke)
    out = tmp_path / "out"
    assert attack(out, runs=3) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "  verdict: fog: tick 3: 7 points differ" in lines
    assert f"  kept in {out / 'seed-8'}; again: python -m tests.hostile.strangers --runs 1 --seed 8" in lines
    assert lines[-1].startswith("3 spells, 6 attacks: 1 broke (seeds 8), in ")
    assert [path.name for path in out.iterdir()] == ["seed-8"]
    assert (out / "seed-8" / "run").is_dir()
    assert json.loads((out / "seed-8" / "seen.json").read_text(encoding="utf-8"))["outcome"] == "invalid"
