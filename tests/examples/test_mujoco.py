"""The example with bodies in MuJoCo: walls, contacts, odometry and a watchdog, with links in this process."""

import importlib.util
import json
import math
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image

from patrol.errors import BadInput
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.maps.load import read_terrain
from patrol.pose import Pose
from patrol.scenario import RobotSpec
from ros2.sim.bodies import bodies_named
from ros2.sim.node import Habits, RobotNode
from ros2.sim.odometry import Errors
from ros2.sim.robot import Build, SimulatedRobot
from ros2.sim.simulation import STEP_S, Simulation
from ros2.wire.messages import Twist, TwistStamped
from tests.ros2_hub import Hub
from worldsim.truth import Truth

EXAMPLES = Path(__file__).parents[2] / "examples"
BODIES = EXAMPLES / "mujoco" / "bodies.py"
OFFICE = EXAMPLES / "maps" / "office.yaml"
RADIUS = 0.25

needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec("mujoco") is None,
    reason="mujoco is not installed: pip install -r examples/mujoco/requirements.lock",
)


@pytest.fixture(name="terrain", scope="module")
def read_office() -> Terrain:
    return read_terrain(OFFICE, 0.1)


@pytest.fixture(name="example", scope="module")
def load_example() -> ModuleType:
    return load_module("mujoco_bodies", BODIES)


def load_module(name: str, file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


class Driven:
    """One robot in MuJoCo, driven by messages."""

    def __init__(self, terrain: Terrain, start: Pose) -> None:
        self.hub, self.noted = Hub(), list[Pose]()
        spec = RobotSpec(1, "robot1", "differential", 1.0, RADIUS, 1.0, None)
        self.robot = SimulatedRobot(Build(spec, start, Errors(), math.inf, 0.5, 7))
        node = RobotNode(self.hub.link("robot_sim", "robot1"), self.robot, Habits(), terrain)
        self.footprint = footprint_of(terrain, 3.0, 360.0, True, 1.0)
        self.truth = Truth(self.footprint, terrain.passable)
        self.bodies: Any = bodies_named(f"{BODIES}:MujocoBodies", terrain, [self.robot.build])
        self.simulation = Simulation({"robot1": node}, self.bodies, self.truth, 0.5, 0.0, self.note)

    def note(self, _time_s: float, poses: Any) -> None:
        self.noted.append(poses["robot1"])

    def drive(self, time_s: float, twist: Twist) -> None:
        for _ in range(round(time_s / 0.1)):
            self.hub.deliver("/robot1/cmd_vel", TwistStamped(0, "base_link", twist))
            self.wait(0.1)

    def wait(self, time_s: float) -> None:
        for _ in range(round(time_s / STEP_S)):
            self.simulation.step(self.simulation.time_s)


@needs_mujoco
def test_walls_stand_exactly_where_the_image_is_black(terrain: Terrain, example: ModuleType) -> None:
    """A ray from above hits a wall over each black pixel, and the floor over each white one."""
    mujoco = example.mujoco
    model = example.make_model(terrain, [])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    black = np.flipud(np.asarray(Image.open(OFFICE.with_suffix(".png")))) == 0
    assert 0.1 < black.mean() < 0.2
    geom, down = np.zeros(1, dtype=np.int32), np.array([0.0, 0.0, -1.0])
    for row, column in np.argwhere(np.ones_like(black))[::17].tolist():
        above = np.array([0.05 * (column + 0.5), 0.05 * (row + 0.5), 2.0])
        mujoco.mj_ray(model, data, above, down, None, 1, -1, geom)
        hits_wall = model.geom_type[geom[0]] == mujoco.mjtGeom.mjGEOM_BOX
        assert hits_wall == black[row, column], (row, column)


@needs_mujoco
def test_cells_are_covered_once_by_few_rectangles(example: ModuleType) -> None:
    occupied = np.random.default_rng(1).random((30, 40)) < 0.6
    covered = np.zeros(occupied.shape, dtype=int)
    rectangles = example.merge_cells(occupied)
    for row, end_row, column, end_column in rectangles:
        covered[row:end_row, column:end_column] += 1
    np.testing.assert_array_equal(covered, occupied)
    assert len(rectangles) < 0.6 * occupied.sum()
    assert example.merge_cells(np.ones((5, 9), dtype=bool)) == [(0, 5, 0, 9)]


@needs_mujoco
def test_a_wall_stops_a_robot_whose_wheels_spin_on(terrain: Terrain) -> None:
    driven = Driven(terrain, Pose(22.0, 7.0, 0.0))  # the corridor ends at x = 23.8
    driven.drive(6.0, Twist(1.0, 0.0, 0.0))
    robot = driven.robot
    assert robot.pose.x == pytest.approx(23.8 - RADIUS, abs=0.01)
    assert (robot.walls_touched, robot.robots_touched) == (1, 0)
    assert robot.odometry.counted.x > 3.0
    assert max(robot.strayed_m) > 0.3


@needs_mujoco
def test_odometry_drifts_and_the_true_pose_is_scored(terrain: Terrain) -> None:
    driven = Driven(terrain, Pose(2.0, 7.0, 0.0))
    for twist in (Twist(0.8, 0.0, 0.0), Twist(0.0, 0.0, 1.5)) * 4:
        driven.drive(2.1, twist)
    robot, fog = driven.robot, driven.truth.fog
    assert driven.simulation.summary()["robots"]["robot1"]["odometry_off_m"] > 0.05
    assert (robot.pose.x, robot.pose.y) == tuple(driven.bodies.data.body("robot1").xpos[:2])
    truth = Truth(driven.footprint, terrain.passable)
    for tick, pose in enumerate(driven.noted):
        truth.observe(tick, [(1, pose)])
    np.testing.assert_array_equal(fog.last_seen, truth.fog.last_seen)


@needs_mujoco
def test_a_robot_whose_commands_stop_stands(terrain: Terrain) -> None:
    driven = Driven(terrain, Pose(2.0, 7.0, 0.0))
    driven.drive(2.0, Twist(0.8, 0.0, 0.0))
    assert driven.robot.velocity.vx == pytest.approx(0.8, abs=0.05)
    driven.wait(1.0)  # half a second of it until the watchdog stops it
    assert driven.robot.watchdog_stops == 1
    before = driven.robot.pose
    driven.wait(3.0)
    after = driven.robot.pose
    assert math.dist((before.x, before.y), (after.x, after.y)) < 0.002


def test_without_mujoco_the_remedy_is_said(terrain: Terrain, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    for name in [name for name in sys.modules if name.startswith("fogwatch_bodies_")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(BadInput, match=r"pip install -r examples/mujoco/requirements\.lock"):
        bodies_named(f"{BODIES}:MujocoBodies", terrain, [])


@pytest.mark.processes
def test_a_patrol_ends_with_the_first_agent_that_does_and_its_log_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fleet = load_module("mujoco_fleet", BODIES.with_name("fleet.py"))
    (tmp_path / "state").touch()  # so that agents cannot make their folders there
    name, code = fleet.patrol(tmp_path, 600.0, own_bodies=True, exact=True)
    assert name in fleet.ROBOTS
    assert code != 0
    assert "state" in (tmp_path / f"{name}.log").read_text(encoding="utf-8")
    monkeypatch.setattr(fleet, "patrol", lambda *_, **__: ("robot2", 2))
    out = tmp_path / "out"
    monkeypatch.setattr(sys, "argv", ["fleet.py", "--out", str(out), "--bodies", "ours"])
    assert fleet.main() == 1
    assert f"{out / 'robot2.log'} says why" in capsys.readouterr().err


@pytest.mark.processes
def test_one_command_starts_a_patrol(tmp_path: Path) -> None:
    command = [sys.executable, "-P", str(BODIES.with_name("fleet.py")), "--out", str(tmp_path / "out")]
    subprocess.run([*command, "--bodies", "ours", "--duration", "4"], check=True, capture_output=True)
    said = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert said["patrolled_s"] >= 4.0
    assert [name for name, robot in said["robots"].items() if robot["commands"] > 0] == ["robot1", "robot2", "robot3"]
    again = subprocess.run(command, check=False, capture_output=True, text=True)
    assert again.returncode == 2
    assert "is not empty; choose another folder" in again.stderr
