"""Bodies that another class moves, and how far from exact obedience they and our own ones are."""

import math
from collections.abc import Mapping
from pathlib import Path

import pytest

from patrol.errors import BadInput
from patrol.pose import Pose, wrap
from ros2.sim.bodies import bodies_named
from ros2.sim.odometry import DriftingOdometry, Errors
from ros2.wire.frames import composed
from ros2.wire.messages import Twist
from tests.ros2.sim.test_robots import AHEAD, push, robot, run, simulated, tell, terrain

GHOSTS = """
from patrol.ground.swept_path import advance
from patrol.pose import Pose
from ros2.wire.frames import composed, inverted
from ros2.sim.bodies import Moved

class Ghosts:
    def __init__(self, terrain, builds):
        self.names = [build.spec.name for build in builds]

    def move(self, robots, step_s):
        after = [advance(robot.pose, robot.body.command, 0.5 * step_s) for robot in robots]
        ways = [composed(inverted(robot.pose), pose) for robot, pose in zip(robots, after, strict=True)]
        return [
            Moved(pose, Pose(2 * way.x, 2 * way.y, 2 * way.heading), at_wall=5 < pose.x < 5.5)
            for pose, way in zip(after, ways, strict=True)
        ]

class Nothing:
    pass

class Refuses(Ghosts):
    def __init__(self, terrain, builds):
        raise ValueError("no wheels")
"""


@pytest.fixture(name="file")
def write_ghosts(tmp_path: Path) -> Path:
    path = tmp_path / "ghosts.py"
    path.write_text(GHOSTS, encoding="utf-8")
    return path


def test_bodies_of_ones_own_move_and_count_as_they_say(file: Path) -> None:
    """At half the speed and through the wall, while their wheels count the whole way."""
    one = robot(errors=Errors(drift=0.5, drift_rad=0.5))
    ghosts = bodies_named(f"{file}:Ghosts", terrain(), [one.build])
    noted: list[tuple[float, float]] = []

    def note(time_s: float, poses: Mapping[str, Pose]) -> None:
        noted.append((time_s, poses["robot1"].x))

    hub, simulation = simulated(one, bodies=ghosts, note=note)
    push(hub, simulation, 80, ("robot1", AHEAD))
    assert (one.pose.x, one.pose.y) == pytest.approx((6.0, 5.0))
    assert one.odometry.counted.x == pytest.approx(8.0)
    assert one.velocity.vx == pytest.approx(1.0)
    said = simulation.summary()["robots"]["robot1"]
    assert said["walls_touched"] == 1
    assert said["distance_m"] == pytest.approx(4.0)
    assert said["odometry_off_m"] == pytest.approx(4.0)
    assert (said["strayed_mean_m"], said["strayed_max_m"]) == (pytest.approx(0.25), pytest.approx(0.25))
    assert noted[:3] == [(0.0, 2.0), (0.5, pytest.approx(2.25)), (1.0, pytest.approx(2.5))]


def test_our_own_bodies_stray_only_where_something_stops_them() -> None:
    hub, simulation = simulated(one := robot())
    for count in range(20):
        tell(hub, Twist(1.0 - 0.1 * (count % 4), 0.0, 0.3 * (count % 3)))
        run(simulation, 0.1)
    assert len(one.strayed_m) == 3
    assert max(one.strayed_m) < 1e-9
    push(hub, simulation, 60, ("robot1", AHEAD))
    assert one.walls_touched == 1
    assert max(one.strayed_m) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Ghost", "has no Ghost; did you mean Ghosts"),
        ("Nothing", r"is not a class with a method move\(robots, step_s\)"),
        ("Refuses", "raises ValueError: no wheels"),
    ],
)
def test_a_class_that_moves_nothing_is_refused(file: Path, name: str, said: str) -> None:
    with pytest.raises(BadInput, match=f"--bodies = {file}:{name}: {said}"):
        bodies_named(f"{file}:{name}", terrain(), [])


def test_a_localisation_is_as_wrong_as_it_is_said_to_be_and_stays_so_until_it_looks_again() -> None:
    odometry = DriftingOdometry(Pose(2.0, 5.0, 1.0), Errors(found_m=0.05, found_rad=0.02), (7, 1))
    assert odometry.found == Pose(2.0, 5.0, 1.0)
    truth, errors = Pose(2.0, 5.0, 1.0), list[tuple[float, float]]()
    for _ in range(1000):
        odometry.localise()
        before = odometry.found
        truth = composed(truth, Pose(0.1, 0.0, 0.01))
        odometry.move(truth)
        found = composed(odometry.correction, odometry.counted)
        assert (found.x, found.y) == pytest.approx((odometry.found.x, odometry.found.y))
        assert math.dist((found.x, found.y), (before.x, before.y)) == pytest.approx(0.1, abs=0.002)
        errors.append((math.dist((found.x, found.y), (truth.x, truth.y)), wrap(found.heading - truth.heading)))
    assert math.sqrt(sum(far**2 for far, _ in errors) / 2000) == pytest.approx(0.05, rel=0.1)
    assert math.sqrt(sum(turn**2 for _, turn in errors) / 1000) == pytest.approx(0.02, rel=0.1)
