"""A simulated ROS 2 robot in this process and an agent in another, which meet at a real router."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from PIL import Image

from patrol.ground.sensors import footprint_of
from patrol.maps.load import load_terrain
from patrol.pose import Pose
from patrol.scenario import RobotSpec
from patrol.scenario.sections import TerrainSpec
from ros2.sim.bodies import OwnBodies
from ros2.sim.node import Habits, RobotNode
from ros2.sim.odometry import Errors
from ros2.sim.robot import Build, SimulatedRobot
from ros2.sim.simulation import STEP_S, Simulation
from ros2.wire.formats import format_named
from ros2.wire.link import ZenohRos2Link, open_ros2
from ros2.wire.names import NodeName
from tests.routers import PATIENCE_S
from worldsim.truth import Truth

NAME = "robot1"
RADIUS, SPEED = 0.25, 0.5


def write_plan(folder: Path) -> Path:
    """A map of 8 x 6 m with a pillar."""
    pixels = np.full((60, 80), 254, dtype=np.uint8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    pixels[25:35, 35:50] = 0
    Image.fromarray(pixels).save(folder / "plan.png")
    plan = folder / "plan.yaml"
    plan.write_text(
        "image: plan.png\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )
    return plan


class Bench:
    """The robot, moved by a thread in real time.

    Attributes:
        robot: The robot.
        simulation: Moves it.
        endpoint: The router.
        plan: The map.
        said: What the agent has said so far.
    """

    def __init__(
        self, endpoint: str, form: str, plan: Path, link: ZenohRos2Link, habits: Habits, watchdog_s: float
    ) -> None:
        self.endpoint, self.form, self.plan = endpoint, form, plan
        terrain = load_terrain(TerrainSpec(map=str(plan)), 0.1, plan.parent)
        spec = RobotSpec(1, NAME, "differential", SPEED, RADIUS, 1.0, None)
        errors = Errors(noise_m=0.01, noise_rad=0.002, drift=0.01, drift_rad=0.002)
        self.robot = SimulatedRobot(Build(spec, Pose(1.5, 1.5, 0.3), errors, 5.0, watchdog_s, 7))
        self.node = RobotNode(link, self.robot, habits, terrain)
        truth = Truth(footprint_of(terrain, 3.0, 360.0, True, 1.0), terrain.passable)
        self.simulation = Simulation({NAME: self.node}, OwnBodies(terrain), truth, 0.5, time.time())
        self.said: list[str] = []
        self.agents: list[subprocess.Popen[str]] = []
        self._listeners: list[threading.Thread] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def agent(self, *more: str, has_map: bool = True) -> subprocess.Popen[str]:
        """Start the agent, with the map or without."""
        process = subprocess.Popen(
            [
                *(sys.executable, "-P", "-m", "ros2.robot", "--robot", "ros2", "--connect", self.endpoint),
                *("--namespace", NAME, "--format", self.form),
                *(("--map", str(self.plan)) if has_map else ()),
                *("--speed", str(SPEED), "--radius", str(RADIUS), "--state", str(self.plan.parent / "state"), *more),
            ],
            stderr=subprocess.PIPE,
            text=True,
        )
        self.agents.append(process)
        self._listeners.append(threading.Thread(target=self._listen, args=(process,)))
        self._listeners[-1].start()
        return process

    @contextmanager
    def joined(self, name: str) -> Iterator[ZenohRos2Link]:
        """Another program at the robot's router."""
        link = open_ros2(self.endpoint, format_named(self.form, 0, "form"), NodeName(name, NAME), PATIENCE_S)
        yield link
        assert link.close(PATIENCE_S)

    def says(self, text: str, after: int = 0) -> None:
        """Wait until the agent has said something, after so many lines."""
        self.until(lambda: any(text in line for line in self.said[after:]))

    def until(self, is_so: Callable[[], bool]) -> None:
        """Wait for something."""
        end = time.monotonic() + PATIENCE_S
        while not is_so():
            assert time.monotonic() < end, self.said
            time.sleep(0.005)

    def drives(self) -> None:
        """Wait until the robot has come a little way, and is moving."""
        begin = self.robot.body.distance_m
        self.until(lambda: self.robot.body.distance_m > begin + 0.2 and not self.robot.stands)

    def stays(self) -> None:
        """Wait until the robot stands, and check that commands come and it stays where it is."""
        self.until(lambda: self.robot.stands)
        distance, commands = self.robot.body.distance_m, self.robot.commands
        self.until(lambda: self.robot.commands > commands + 30)
        assert self.robot.body.distance_m == distance

    def end(self) -> None:
        """End all that runs."""
        for process in self.agents:
            process.kill()
            process.wait()
        for listener in self._listeners:
            listener.join()
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        begin_s = time.monotonic()
        while not self._over.wait(max(0.0, begin_s + self.simulation.time_s + STEP_S - time.monotonic())):
            self.simulation.step(time.monotonic())

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stderr is not None
        with process.stderr as lines:
            for line in lines:
                self.said.append(line.rstrip())


@contextmanager
def bench(
    endpoint: str, form: str, folder: Path, habits: Habits | None = None, watchdog_s: float = 0.5
) -> Iterator[Bench]:
    """A robot at a router. Its watchdog stops it when no command has come for so long."""
    with ExitStack() as stack:
        link = open_ros2(endpoint, format_named(form, 0, "form"), NodeName("robot", NAME), PATIENCE_S)
        stack.callback(link.close)
        made = Bench(endpoint, form, write_plan(folder), link, habits or Habits(delay_s=0.05), watchdog_s)
        stack.callback(made.end)
        yield made
