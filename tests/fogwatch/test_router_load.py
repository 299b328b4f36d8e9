"""The measurement of what a router carries: all hear all, round by round."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.processes


def load(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "fogwatch.router_load", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_router_delivers_every_frame_to_everybody_else() -> None:
    done = load("--members", "3", "--seconds", "0.3")
    assert done.returncode == 0, done.stderr
    says = json.loads(done.stdout)
    assert says["members"] == 3
    assert says["rounds"] > 0
    assert says["deliveries"] == says["rounds"] * 6
    assert says["loopback_bytes"] > says["deliveries"] * says["frame_bytes"]
    assert says["router_s"] >= 0.0


def test_a_fleet_of_one_is_refused() -> None:
    done = load("--members", "1")
    assert done.returncode == 2
    assert "at least 2 members" in done.stderr
