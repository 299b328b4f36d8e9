"""Simulated ROS 2 robots as a process of their own, driven by an agent's process."""

import json
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from tests.ros2_bench import write_plan
from tests.routers import PATIENCE_S, routed

pytestmark = pytest.mark.processes


def test_it_can_be_followed_and_says_what_was_measured(tmp_path: Path) -> None:
    plan, out, poses = write_plan(tmp_path), tmp_path / "sim.json", tmp_path / "poses.csv"
    body = ["--map", str(plan), "--speed", "0.5"]
    followed = ["--log-format", "json", "--health", "0.2", "--metrics", "127.0.0.1:0"]
    with routed() as endpoint:
        common = ["--connect", endpoint, *body]
        robots = [sys.executable, "-m", "ros2.sim", *common, "--robots", "robot1", "--out", str(out), *followed]
        robots += ["--poses", str(poses)]
        agent = [sys.executable, "-m", "ros2.robot", "--robot", "ros2", "--namespace", "robot1", *common]
        agent += ["--state", str(tmp_path), "--wait", str(PATIENCE_S)]
        with (
            subprocess.Popen(robots, stderr=subprocess.PIPE, text=True) as simulated,
            subprocess.Popen(agent, stderr=subprocess.DEVNULL) as driving,
        ):
            try:
                assert simulated.stderr is not None
                page = ""
                for line in simulated.stderr:  # the health lines keep coming, so this ends
                    assert driving.poll() is None
                    said = json.loads(line)
                    assert said["process"] == "robot-sim"
                    page = said["message"].removeprefix("metrics at ") if "metrics at" in said["message"] else page
                    health = said.get("health", {})
                    if health.get("fogwatch_commands_total", {}).get("robot1", 0) > 5 and "fogwatch_tick" in health:
                        assert health["fogwatch_mfow_seconds"] >= 0
                        break
                with urllib.request.urlopen(page, timeout=PATIENCE_S) as answer:
                    assert 'fogwatch_commands_total{process="robot-sim",robot="robot1"}' in answer.read().decode()
            finally:
                for one in (driving, simulated):
                    one.send_signal(signal.SIGINT)
            assert driving.wait(PATIENCE_S) == 130
            simulated.communicate(timeout=PATIENCE_S)
            assert simulated.returncode == 130
    summary = json.loads(out.read_text(encoding="utf-8"))["robots"]["robot1"]
    assert summary["commands"] > 5
    assert summary["walls_touched"] == 0
    head, *rows = poses.read_text(encoding="ascii").splitlines()
    assert head == "time_s,robot,x,y,heading"
    assert rows[0].startswith("0.00,robot1,")
