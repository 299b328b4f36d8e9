"""Chaos at length: random scenarios under random faults of all kinds, and fleets under attack."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]


def chaos(out: Path, *words: str) -> None:
    holds("fogwatch", "chaos", *words, "--out", str(out))


def holds(*words: str) -> None:
    command = [sys.executable, "-P", "-m", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    assert "all held" in done.stdout


def test_five_hundred_scenarios_hold_in_one_process(tmp_path: Path) -> None:
    chaos(tmp_path / "chaos", "--runs", "500", "--seed", "1")


def test_twenty_scenarios_hold_as_processes(tmp_path: Path) -> None:
    chaos(tmp_path / "chaos", "--runs", "20", "--seed", "5001", "--processes")


def test_fleets_hold_out_against_strangers_for_half_an_hour(tmp_path: Path) -> None:
    holds("tests.hostile.strangers", "--minutes", "30", "--seed", "1", "--out", str(tmp_path / "strangers"))
