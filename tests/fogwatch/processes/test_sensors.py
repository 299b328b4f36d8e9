"""Sensors of one's own in fleets of processes: the same trace as in one process, and one line where one fails."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from monitor.replay.replay import play
from monitor.replay.run import open_run
from patrol.errors import BadInput
from tests.fleets import one_and_many
from tests.fogwatch.conftest import WITHOUT, Shell
from tests.patrol.sensors import records

__all__ = ["records"]

ELLIPSE = Path(__file__).parents[3] / "examples" / "elliptic_sensor.py"


def scenario(kind: str, **sensor: Any) -> dict[str, Any]:
    robots = {"count": 3, "model": "holonomic"}
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 40, "robots": robots}
    return {**given, "sensor": {"kind": kind, **sensor}}


@pytest.mark.processes
def test_an_ellipse_gives_the_same_trace_in_one_process_and_in_many(
    records: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mapping = scenario(f"{ELLIPSE}:Ellipse", options={"across": 3})
    _, many = one_and_many(mapping, tmp_path)
    disc = fogwatch.run(scenario("disc"), out=tmp_path / "disc", picture=False)
    assert many.trace_hash != disc.trace_hash
    again = fogwatch.run(tmp_path / "many" / "scenario.yaml", out=tmp_path / "again", picture=False)
    assert again.trace_hash == many.trace_hash
    run = open_run(tmp_path / "many")
    assert play(run, ()) is None  # the fog as replayed has the MFoW of the journal in every tick

    monkeypatch.setattr("patrol.own_sensor._allowed", set())
    next(records.iterdir()).unlink()
    with pytest.raises(BadInput, match="this user has not run a scenario with it here"):
        play(open_run(tmp_path / "many"), ())


@pytest.mark.processes
def test_a_sensor_that_fails_ends_the_run_with_one_line(shell: Shell, tmp_path: Path) -> None:
    source = ELLIPSE.read_text(encoding="utf-8")
    looks = "        view = self._in_sight.visible(pose)\n"
    assert looks in source
    failing = tmp_path / "failing.py"
    failing.write_text(source.replace(looks, f"        1 / (pose.x > 40.0)\n{looks}"), encoding="utf-8")
    path = tmp_path / "scenario.yaml"
    robots = {"count": 1, "model": "holonomic", "starts": [[60, 40]]}
    mapping = {**scenario(f"{failing}:Ellipse"), "terrain": {"builtin": "open"}, "robots": robots, "duration": 200}
    path.write_text(json.dumps(mapping), encoding="utf-8")
    says = "raised ZeroDivisionError: division by zero (failing.py:"

    one = shell("run", path, "--in-process", *WITHOUT, "--out", tmp_path / "one")
    assert one.code == 2
    assert says in one.err.splitlines()[-1]
    assert "Traceback" not in one.err

    assert shell("run", path, *WITHOUT, "--out", tmp_path / "many").code == 1
    summary = json.loads((tmp_path / "many" / "summary.json").read_text(encoding="utf-8"))
    failed = [check["detail"] for check in summary["verdict"]["checks"] if not check["ok"]]
    assert any(says in detail for detail in failed), failed
    logs = {file.name: file.read_text(encoding="utf-8") for file in (tmp_path / "many" / "logs").glob("*.log")}
    assert says in logs["world.log"]
    assert says in logs["robot-r1.log"]
    assert not any("Traceback" in log for log in logs.values())
