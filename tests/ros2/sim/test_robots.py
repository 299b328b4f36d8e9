"""Simulated robots: their motion, odometry, watchdog, topics and goals, with links in this process."""

import math
from collections.abc import Callable, Mapping

import numpy as np
import pytest

from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.scenario import RobotSpec
from ros2.sim.bodies import Bodies, OwnBodies
from ros2.sim.nav2 import Navigator
from ros2.sim.node import Habits, RobotNode
from ros2.sim.odometry import DriftingOdometry, Errors
from ros2.sim.robot import Build, SimulatedRobot
from ros2.sim.simulation import Simulation
from ros2.wire import messages as ros
from ros2.wire.frames import composed
from ros2.wire.goals import GoalClient, Going
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Clock, Odometry, PoseStamped, TFMessage, Twist, TwistStamped
from ros2.wire.names import LATCHED
from tests.present import present
from tests.ros2_hub import Hub
from worldsim.truth import Truth

# Not the product's own, so that a wrong one there is noticed.
STEP_S = 0.02

EPOCH_S = 1_700_000_000.0
PLACE = Pose(2.0, 5.0, 0.0)
EXACT, USUAL, AHEAD = Errors(), Habits(), Twist(1.0, 0.0, 0.0)


def terrain() -> Terrain:
    """10 x 10 m with a wall from (5, 0) to (5.5, 8)."""
    passable = np.ones((100, 100), dtype=np.bool_)
    passable[:80, 50:55] = False
    return Terrain("t", passable, 0.1)


def robot(
    name: str = "robot1",
    start: Pose = PLACE,
    model: str = "differential",
    errors: Errors = EXACT,
    acceleration: float = math.inf,
    number: int = 1,
) -> SimulatedRobot:
    spec = RobotSpec(number, name, model, 1.0, 0.3, 1.0, None)  # type: ignore[arg-type]
    return SimulatedRobot(Build(spec, start, errors, acceleration, 0.5, 7))


def simulated(
    *robots: SimulatedRobot,
    habits: Habits = USUAL,
    bodies: Bodies | None = None,
    note: Callable[[float, Mapping[str, Pose]], None] | None = None,
) -> tuple[Hub, Simulation]:
    """A simulation of robots, and where its nodes meet others."""
    hub, named = Hub(), {one.build.spec.name: one for one in robots}
    nodes = {name: RobotNode(hub.link("robot_sim", name), one, habits, terrain()) for name, one in named.items()}
    truth = Truth(footprint_of(terrain(), 3.0, 360.0, True, 1.0), terrain().passable)
    return hub, Simulation(nodes, bodies or OwnBodies(terrain()), truth, 0.5, EPOCH_S, note)


def run(simulation: Simulation, time_s: float) -> None:
    for _ in range(round(time_s / STEP_S)):
        simulation.step(simulation.time_s)


def push(hub: Hub, simulation: Simulation, times: int, *twists: tuple[str, Twist]) -> None:
    """Tell robots to go, ten times a second."""
    for _ in range(times):
        for name, twist in twists:
            tell(hub, twist, name)
        run(simulation, 0.1)


def tell(hub: Hub, twist: Twist, name: str = "robot1") -> None:
    hub.deliver(f"/{name}/cmd_vel", TwistStamped(0, "base_link", twist))


@pytest.mark.parametrize(
    ("model", "twist", "end"),
    [
        ("differential", Twist(0.5, 9.0, 0.0), (2.2, 5.0, 0.0)),
        ("holonomic", Twist(0.5, 0.5, 0.0), (2.2, 5.2, 0.0)),
        ("car", Twist(0.5, 0.0, 0.0), (2.2, 5.0, 0.0)),
        ("car", Twist(0.0, 0.0, 1.0), (2.0, 5.0, 0.0)),
        ("differential", Twist(0.0, 0.0, 1.0), (2.0, 5.0, 0.4)),
        ("holonomic", Twist(0.0, 0.0, 1.0), (2.0, 5.0, 0.4)),
    ],
)
def test_a_robot_moves_as_it_is_told(model: str, twist: Twist, end: tuple[float, float, float]) -> None:
    hub, simulation = simulated(one := robot(model=model))
    tell(hub, twist)
    run(simulation, 0.4)
    assert (one.pose.x, one.pose.y, one.pose.heading) == pytest.approx(end)


def test_its_watchdog_stops_it_when_no_command_comes() -> None:
    hub, simulation = simulated(one := robot())
    tell(hub, Twist(0.5, 0.0, 0.0))
    for time_s, stands, stops in ((0.4, False, 0), (0.2, True, 1), (5.0, True, 1)):
        run(simulation, time_s)
        assert (one.stands, one.watchdog_stops) == (stands, stops)


def test_motors_take_their_time() -> None:
    hub, simulation = simulated(one := robot(acceleration=1.0))
    tell(hub, Twist(1.0, 0.0, 0.0))
    run(simulation, 0.4)
    assert one.velocity.vx == pytest.approx(0.4)


def test_walls_and_other_robots_stop_it_and_each_touch_counts_once() -> None:
    one, other = robot(start=Pose(4.0, 5.0, 0.0)), robot("robot2", Pose(2.0, 5.0, 0.0), number=2)
    hub, simulation = simulated(one, other)
    push(hub, simulation, 40, ("robot1", AHEAD), ("robot2", AHEAD))
    assert one.pose.x == pytest.approx(4.7, abs=0.021)
    assert other.pose.x == pytest.approx(one.pose.x - 0.6, abs=0.021)
    assert (one.walls_touched, one.robots_touched) == (1, 0)
    assert (other.walls_touched, other.robots_touched) == (0, 1)
    push(hub, simulation, 3, ("robot2", Twist(-0.1, 0.0, 0.0)))
    push(hub, simulation, 10, ("robot2", AHEAD))
    assert other.robots_touched == 2
    said = simulation.summary()["robots"]["robot1"]
    assert (said["walls_touched"], said["robots_touched"]) == (1, 0)


def test_odometry_drifts_and_a_localisation_makes_good_for_it() -> None:
    odometry = DriftingOdometry(Pose(2.0, 5.0, 1.0), Errors(drift=0.1, drift_rad=0.05), (7, 1))
    assert odometry.counted == Pose(0.0, 0.0, 0.0)
    truth = Pose(2.0, 5.0, 1.0)
    for _ in range(100):
        truth = composed(truth, Pose(0.1, 0.0, 0.0))
        odometry.move(truth)
    assert odometry.counted.heading == pytest.approx(0.5)
    assert math.hypot(odometry.counted.x, odometry.counted.y) == pytest.approx(11.0, rel=0.02)
    found = composed(odometry.correction, odometry.counted)
    assert (found.x, found.y, found.heading) == pytest.approx((truth.x, truth.y, truth.heading))


def test_the_noise_of_odometry_has_its_size_and_repeats() -> None:
    def said() -> list[Pose]:
        odometry = DriftingOdometry(Pose(0.0, 0.0, 0.0), Errors(noise_m=0.05, noise_rad=0.01), (7, 1))
        return [odometry.say() for _ in range(2000)]

    poses = said()
    assert poses == said()
    values = np.array([(pose.x, pose.y, pose.heading) for pose in poses])
    for one, size in zip(values.T, (0.05, 0.05, 0.01), strict=True):
        assert np.std(one) == pytest.approx(size, rel=0.1)
        assert np.mean(one) == pytest.approx(0.0, abs=0.1 * size)


def test_it_says_where_it_is_with_a_delay_and_its_stamps_are_those_of_the_moment() -> None:
    hub, simulation = simulated(robot(), habits=Habits(delay_s=0.2, odometry_hz=10.0))
    run(simulation, 0.18)
    assert "/robot1/odom" not in hub.sent
    run(simulation, 0.82)
    odometry = hub.sent["/robot1/odom"]
    assert 8 <= len(odometry) <= 9
    assert isinstance(odometry[0], Odometry)
    assert odometry[-1].stamp_ns / 1e9 <= EPOCH_S + 0.8 + 1e-6
    assert all(isinstance(one, TFMessage) for one in hub.sent["/robot1/tf"])
    (transform,) = hub.sent["/robot1/tf"][-1].transforms
    assert (transform.frame, transform.child_frame) == ("map", odometry[-1].frame)
    found = composed(transform.pose, odometry[-1].pose)
    assert (found.x, found.y) == pytest.approx((2.0, 5.0))
    assert isinstance(hub.sent["/robot1/amcl_pose"][-1], ros.PoseWithCovarianceStamped)
    assert len(hub.sent["/robot1/amcl_pose"]) == 1  # it stands
    assert "/clock" not in hub.sent


def test_an_unplugged_robot_says_no_odometry_and_the_time_until_it_stands_is_measured() -> None:
    hub, simulation = simulated(robot())
    tell(hub, Twist(0.5, 0.0, 0.0))
    run(simulation, 0.3)
    simulation.unplug("robot1", simulation.time_s)
    count = len(hub.sent["/robot1/odom"])
    run(simulation, 1.0)
    assert len(hub.sent["/robot1/odom"]) == count
    assert simulation.summary()["robots"]["robot1"]["stood_after_s"] == pytest.approx(0.22, abs=0.03)


def test_a_simulations_time_and_map_are_published_on_request() -> None:
    hub, simulation = simulated(robot(), habits=Habits(tells_time=True, has_map=True))
    run(simulation, 0.5)
    assert isinstance(hub.sent["/clock"][-1], Clock)
    assert hub.sent["/clock"][-1].stamp_ns / 1e9 == pytest.approx(EPOCH_S + 0.5)
    late: RosMailbox[ros.OccupancyGrid] = RosMailbox()
    hub.link("rviz", "robot1").subscribe("map", ros.OccupancyGrid, late, LATCHED)
    np.testing.assert_array_equal(present(late.take()).message.cells == 100, ~terrain().passable)


def test_cars_are_steered_by_their_wheels_and_old_robots_by_plain_velocities() -> None:
    hub, simulation = simulated(one := robot(model="car"), habits=Habits("ackermann", wheelbase=1.0))
    hub.deliver("/robot1/ackermann_cmd", ros.AckermannDriveStamped(0, "", 0.5, math.atan(0.5), 0.0))
    run(simulation, 0.4)
    assert one.pose.heading == pytest.approx(0.1)
    hub, simulation = simulated(one := robot(), habits=Habits("twist"))
    hub.deliver("/robot1/cmd_vel", Twist(0.5, 0.0, 0.0))
    run(simulation, 0.4)
    assert one.pose.x == pytest.approx(2.2)


def test_nothing_is_measured_before_all_robots_have_been_driven() -> None:
    hub, simulation = simulated(robot(), robot("robot2", Pose(8.0, 5.0, 0.0), number=2))
    tell(hub, Twist(0.0, 0.0, 0.1))
    run(simulation, 1.0)
    assert simulation.summary()["mfow_mean_s"] is None
    tell(hub, Twist(0.0, 0.0, 0.1), "robot2")
    run(simulation, 2.0)
    assert simulation.patrolled_s == pytest.approx(2.0, abs=0.03)
    assert simulation.summary()["mfow_max_s"] == pytest.approx(2.0, abs=0.51)


@pytest.mark.parametrize("model", ["differential", "holonomic"])
def test_its_nav2_goes_round_the_wall(model: str) -> None:
    hub, simulation = simulated(one := robot(model=model), habits=Habits(has_nav2=True))
    client = GoalClient(hub.link("fogwatch", "robot1"))
    client.go(PoseStamped(0, "map", Pose(8.0, 5.0, 0.0)), 0.0)
    for _ in range(400):
        run(simulation, 0.2)
        if client.step(simulation.time_s) in {Going.THERE, Going.FAILED}:
            break
    assert client.going is Going.THERE
    assert math.dist((one.pose.x, one.pose.y), (8.0, 5.0)) < 0.3
    assert one.walls_touched == 0


def test_its_nav2_gives_up_where_there_is_no_way() -> None:
    passable = terrain().passable.copy()
    passable[:, 50:55] = False
    navigator = Navigator(Terrain("t", passable, 0.1), robot().build.spec)
    assert navigator.velocity(Pose(2.0, 5.0, 0.0), Pose(8.0, 5.0, 0.0)) is None
    assert navigator.velocity(Pose(2.0, 5.0, 0.0), Pose(5.2, 5.0, 0.0)) is None
    assert navigator.velocity(Pose(2.0, 5.0, 0.0), Pose(3.0, 5.0, 0.0)) is not None


def test_a_lost_robot_says_where_it_is_only_when_it_has_been_told() -> None:
    """A pose that is nearly right is found exactly; the error of another stays."""
    hub, simulation = simulated(robot(), habits=Habits(is_lost=True))
    run(simulation, 0.5)
    assert not hub.sent["/robot1/tf"]
    assert not hub.sent["/robot1/amcl_pose"]
    for frame, told, believed in (
        ("odom", PLACE, None),
        ("map", Pose(2.5, 5.5, 0.3), PLACE),
        ("map", Pose(7.0, 1.0, 2.0), Pose(7.0, 1.0, 2.0)),
    ):
        hub.deliver("/robot1/initialpose", ros.PoseWithCovarianceStamped(1, frame, told))
        run(simulation, 0.2)
        assert bool(hub.sent["/robot1/amcl_pose"]) == (believed is not None)
        if believed is not None:
            said = hub.sent["/robot1/amcl_pose"][-1].pose
            assert (said.x, said.y, said.heading) == pytest.approx((believed.x, believed.y, believed.heading))


def test_a_robot_with_a_map_of_its_own_says_and_hears_everything_on_that() -> None:
    """Its map lies at (10, 5) in the world, turned to the left."""
    habits = Habits(has_nav2=True, has_map=True, transform=Pose(10.0, 5.0, math.pi / 2))
    hub, simulation = simulated(one := robot(), habits=habits)
    run(simulation, 0.2)
    said = hub.sent["/robot1/amcl_pose"][-1].pose
    assert (said.x, said.y, said.heading) == pytest.approx((0.0, 8.0, -math.pi / 2))
    corner = hub.sent["/robot1/map"][-1].origin
    assert (corner.x, corner.y, corner.heading) == pytest.approx((-5.0, 10.0, -math.pi / 2))
    client = GoalClient(hub.link("fogwatch", "robot1"))
    client.go(PoseStamped(1, "map", Pose(2.0, 7.0, 0.0)), 0.0)
    for _ in range(500):
        run(simulation, STEP_S)
        client.step(simulation.time_s)
    assert math.dist((one.pose.x, one.pose.y), (3.0, 7.0)) < 0.3
