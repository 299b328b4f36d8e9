"""A mesh with a world, started by hand, when a robot's process is killed."""

import json
from collections.abc import Iterator
from pathlib import Path
from socket import SOCK_DGRAM
from typing import Any

import pytest

from fogwatch.fleets.folder import make_fleet
from patrol.journal import read_journal
from tests.fleets import COARSE, Processes, python
from tests.routers import free_port, needs_openssl

pytestmark = [pytest.mark.processes, needs_openssl]

PATIENCE_S = 300.0
TEAM = {"count": 3, "model": "holonomic", "speed": 2.0}


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Processes]:
    made = Processes(tmp_path, PATIENCE_S)
    yield made
    made.end()


def test_a_robot_that_was_killed_is_dropped_and_status_says_whom_the_world_waits_for(
    fleet: Processes, tmp_path: Path
) -> None:
    places = {"r1": "127.0.0.1", "r2": "127.0.0.1"}
    folder = make_fleet(tmp_path / "mesh", "mesh", ["r1", "r2", "r3"], [], free_port(SOCK_DGRAM), 1, places).path
    scenario, out = tmp_path / "scenario.yaml", tmp_path / "run"
    scenario.write_text(json.dumps({**COARSE, "duration": 100_000.0, "robots": TEAM}), encoding="utf-8")

    def look(code: int) -> Any:
        done = python("-m", "fogwatch", "status", "--credentials", folder / "viewer", "--json")
        assert done.returncode == code, done.stderr
        return json.loads(done.stdout)

    world = ["--credentials", str(folder / "world"), "--scenario", str(scenario), "--out", str(out)]
    fleet.start("world", "worldsim", *world)
    fleet.until(lambda: "waiting for r1, r2, r3" in fleet.said("world"))
    for name in ("r1", "r2"):
        fleet.start(name, "fogwatch", "agent", "--credentials", str(folder / name), "--scenario", str(scenario))
    fleet.until(lambda: "waiting for r3 (" in fleet.said("world"))
    status = look(1)
    assert (status["has_world"], status["world"], status["warnings"]) == (True, None, ["world waits for r3"])
    fleet.start("r3", "fogwatch", "agent", "--credentials", str(folder / "r3"), "--scenario", str(scenario))
    fleet.until((out / "journal").exists)
    look(0)
    fleet.start("status", "fogwatch", "status", "--credentials", str(folder / "viewer"), "--json", "--watch")

    def looks() -> list[Any]:
        return [json.loads(line) for line in fleet.said("status").splitlines() if line.endswith("}")]

    fleet.until(lambda: bool(looks()))
    fleet.processes["r1"].kill()
    fleet.until(lambda: any("gone" in robot["wrong"] for robot in looks()[-1]["robots"]))
    halted = [status for status in looks() if status["warnings"] == ["world waits for r1"]]
    assert halted, fleet.said("status")
    assert all(status["world"]["tick"] > 0 for status in halted)
    assert [robot["wrong"] for robot in looks()[-1]["robots"]] == ["its process has gone", "", ""]
    fleet.until(lambda: looks()[-1]["world"]["tick"] > halted[-1]["world"]["tick"] + 100)
    (lost,) = [event for event in read_journal(out / "journal").events if event.robot == 1]
    assert lost.detail.startswith("its process was gone in phase "), "a deadline of 60 s would have said so"
