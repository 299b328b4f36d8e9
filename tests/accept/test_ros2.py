"""Promises of driving ROS 2 robots, measured: a pulled plug, and half an hour of three robots of three kinds."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from math import inf
from pathlib import Path
from statistics import mean
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from fogwatch.inprocess import run_in_process
from patrol.scenario import dump_scenario, load_scenario
from tests.ros2_bench import write_plan
from tests.routers import PATIENCE_S, routed

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]

YARDS = Path(__file__).parents[2] / "examples" / "ros2-yards.yaml"
SEEDS = (7, 8, 9, 10)
NATIVE_SEEDS = range(1, 10)
FORMATS = {"r1": "rmw_zenoh", "r2": "bridge", "r3": "rmw_zenoh-humble"}
HALF_AN_HOUR_S = 1800.0
# As near to the motors of the simulated world, whose bodies have full speed at once, as 20 commands a second can come.
ACCELERATION = "40"


def module(*words: str) -> list[str]:
    return [sys.executable, "-P", "-m", *words]


@contextmanager
def agents(endpoint: str, common: list[str], formats: dict[str, str]) -> Iterator[None]:
    start = module("agent", "--robot", "ros2", "--connect", endpoint, *common, "--epoch", str(time.time()))
    with TemporaryDirectory() as state:
        start += ["--state", state]
        running = [subprocess.Popen([*start, "--namespace", name, "--format", form]) for name, form in formats.items()]
        try:
            yield
        finally:
            for one in running:
                one.send_signal(signal.SIGINT)
            codes = [one.wait(PATIENCE_S) for one in running]
    assert codes == [130] * len(running)


def measured(endpoint: str, out: Path, *words: str) -> dict[str, Any]:
    """Measures of simulated robots that end by themselves."""
    simulator = module("ros2.sim", "--connect", endpoint, "--out", str(out), *words)
    subprocess.run(simulator, check=True)
    found: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return found


def test_a_robot_whose_plug_is_pulled_stands_within_half_a_second(tmp_path: Path) -> None:
    plan = write_plan(tmp_path)
    body = ["--map", str(plan), "--speed", "0.5"]
    stood = []
    for form in FORMATS.values():
        with routed() as endpoint, agents(endpoint, body, {"robot1": form}):
            words = [*body, "--robots", f"robot1:{form}", "--unplug", "robot1@10", "--duration", "12"]
            summary = measured(endpoint, tmp_path / "sim.json", *words)["robots"]["robot1"]
        assert summary["distance_m"] > 1.0
        assert summary["watchdog_stops"] == 0
        stood.append(summary["stood_after_s"])
    assert all(0.0 < one <= 0.5 for one in stood), stood


def patrolled(seed: int, folder: Path) -> dict[str, Any]:
    """Measures of three robots that patrol the yards for half an hour, in real time."""
    folder.mkdir()
    scenario_file = folder / "scenario.yaml"
    scenario_file.write_text(dump_scenario(load_scenario(YARDS, {"seed": seed})), encoding="utf-8")
    scenario = ["--scenario", str(scenario_file), "--margin", "0.15"]
    errors = ["--delay", "0.1", "--noise", "0.05", "--noise-heading", "0.01"]
    robots = ",".join(f"{name}:{form}" for name, form in FORMATS.items())
    with routed() as endpoint, agents(endpoint, [*scenario, "--acceleration", ACCELERATION], FORMATS):
        words = [*scenario, *errors, "--robots", robots, "--duration", str(HALF_AN_HOUR_S)]
        return measured(endpoint, folder / "sim.json", *words)


def test_three_robots_patrol_the_yards_as_well_as_without_ros(tmp_path: Path) -> None:
    """MFoW differs between seeds without ROS too, and two patrols of one seed soon part, so means are compared."""
    native = [
        run_in_process(load_scenario(YARDS, {"seed": seed, "pace": "lockstep", "radio.via": "ether"})).summary
        for seed in NATIVE_SEEDS
    ]
    with ThreadPoolExecutor(len(SEEDS)) as pool:
        summaries = list(pool.map(lambda seed: patrolled(seed, tmp_path / str(seed)), SEEDS))
    assert all(one["walls_touched"] == 0 for summary in summaries for one in summary["robots"].values()), summaries
    through_ros = mean(summary["mfow_mean_s"] for summary in summaries)
    assert through_ros <= 1.1 * mean(one.mfow_mean_s or inf for one in native), summaries
