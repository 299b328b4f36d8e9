"""The driver as a mind's body, with a simulated robot at the other end of a link in this process."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from patrol.ground.terrain import Terrain
from patrol.pose import Command, Drive, Pose, Twist, Velocity
from patrol.scenario import RobotSpec
from ros2.robot import driver, localisation, steering
from ros2.robot import stops as standing
from ros2.robot.driver import Objection, Ros2Robot
from ros2.robot.fence import Fence, Others
from ros2.robot.governor import Governor, Response
from ros2.robot.hardware import Hardware
from ros2.robot.localisation import Fix, LocalisationSettings
from ros2.robot.options import DriveSettings
from ros2.robot.steering import GoalSteering, MotionCheck, Steering, VelocitySteering
from ros2.robot.stops import DriverFailed
from ros2.wire import messages
from ros2.wire.goals import GoalServer, Status
from ros2.wire.messages import AckermannDriveStamped, Bool, Clock, Odometry, TFMessage, Transform, TwistStamped
from ros2.wire.names import LATCHED
from runtime.messages.stop_orders import Order, Outcome
from runtime.reporting.logs import Log
from tests.present import present
from tests.ros2.robot.passing import Passing, Waiter
from tests.ros2_hub import Hub

# Not the product's own, so that a wrong one there is noticed.
ENOUGH_M = 0.3

STILL = messages.Twist(0.0, 0.0, 0.0)
AHEAD, PLACE = Twist(0.5, 0.0), Pose(2.0, 5.0, 0.0)
STEP_S = 0.5
PATIENCE_S = 300.0


@pytest.fixture(autouse=True)
def poses_stay_fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a test take longer than a pose may be carried on: `fresh_s` alone says when it is too old."""
    monkeypatch.setattr(localisation, "LONGEST_S", PATIENCE_S)


class Ticks:
    """A fleet clock that counts what it is given."""

    def __init__(self, *ticks: int | None) -> None:
        self.left = deque(ticks)

    def tick(self) -> int | None:
        return self.left.popleft() if self.left else None

    def decide(self) -> bool:
        return True


class Heard(Log):
    """A log whose lines a test reads."""

    def __init__(self, process: str) -> None:
        super().__init__(process)
        self.said: list[str] = []
        self.failures: list[BaseException] = []

    def failure(self, error: BaseException) -> None:
        self.failures.append(error)

    def info(self, msg: object, *args: object, **facts: Any) -> None:
        del args, facts
        self.said.append(str(msg))


class Bench:
    """A robot that stands at (2, 5) of 10 x 10 m, and its driver."""

    def __init__(self, model: str = "differential", nav2: bool = False, orders: Any = None, **settings: Any) -> None:
        self.hub = Hub()
        self.robot = self.hub.link("robot", "robot1")
        self.odom = self.robot.publisher("odom", Odometry)
        self.tf = self.robot.publisher("tf", TFMessage)
        self.stop = self.robot.publisher("stop", Bool, LATCHED)
        self.log = Heard("robot1")
        self.said = self.log.said
        settings.setdefault("localisation", LocalisationSettings(fresh_s=PATIENCE_S, delay_s=0.0))
        self.link = self.hub.link("fogwatch", "robot1")
        self.hardware = Hardware(self.link, DriveSettings(**settings), 1.0, self.said.append)
        spec = RobotSpec(1, "robot1", model, 1.0, 0.3, 1.0, None)  # type: ignore[arg-type]
        terrain = Terrain("t", np.ones((100, 100), dtype=np.bool_), 0.1)
        self.steering: Steering
        self.objections: list[Objection] = []
        if nav2:
            self.steering = GoalSteering(self.hardware)
        else:
            governor = Governor(model, spec.limits, 1e6, 60.0, Fence(terrain, 0.3, 0.1, 1e6))
            self.response = Response(spec.radius, 0.0)
            self.steering = VelocitySteering(self.hardware, governor, Others({}, {}, STEP_S), self.response)
            self.objections.append(self.response)
        self.ticks = Ticks(*range(1000))
        parts = self.hardware, self.steering, self.ticks, STEP_S, None, orders, self.log, self.objections
        self.driver = Ros2Robot(*parts)

    def at(self, pose: Pose = PLACE, twist: messages.Twist = STILL) -> None:
        """The robot says where it is."""
        self.tf.send(TFMessage((Transform(0, "map", "odom", Pose(0.0, 0.0, 0.0)),)))
        self.odom.send(Odometry(0, "odom", "base_link", pose, twist))

    def drive(self, command: Command | None = None, pose: Pose = PLACE) -> None:
        """The robot says where it is, and the driver tells it what was decided."""
        self.at(pose)
        if command is not None:
            self.driver.act(command)
        self.driver.cycle()

    def fix(self) -> Fix:
        """The robot's pose as the driver knows it."""
        return present(self.hardware.fix())

    @property
    def told(self) -> messages.Twist:
        """The last command."""
        twist: messages.Twist = self.hub.sent["/robot1/cmd_vel"][-1].twist
        return twist

    def until(self, is_so: Callable[[], bool]) -> None:
        """Wait for something that another thread does."""
        end = time.monotonic() + PATIENCE_S
        while not is_so():
            assert time.monotonic() < end
            time.sleep(0.001)


def test_it_is_told_a_velocity_in_its_own_frame() -> None:
    bench = Bench("holonomic")
    bench.at(Pose(2.0, 5.0, 1.5707963267948966))
    sensed = present(bench.driver.sense())
    assert (sensed.k, sensed.pose.x, sensed.pose.y) == (0, 2.0, 5.0)
    bench.driver.act(Velocity(0.0, 0.5))
    bench.driver.cycle()
    assert (bench.told.vx, bench.told.vy) == pytest.approx((0.5, 0.0))
    assert bench.hub.sent["/robot1/cmd_vel"][-1].frame == "base_link"


def test_it_knows_where_it_will_be_when_a_decision_begins_to_act() -> None:
    bench = Bench()
    bench.drive(AHEAD)
    bench.at()
    assert present(bench.driver.sense()).pose.x == pytest.approx(2.05)


@pytest.mark.parametrize(("drive", "kind"), [("twist", messages.Twist), ("twist-stamped", TwistStamped)])
def test_velocities_go_out_with_a_stamp_or_without(drive: str, kind: type) -> None:
    bench = Bench(drive=drive, topics={"cmd_vel": "base/go"})
    bench.drive()
    assert isinstance(bench.hub.sent["/robot1/base/go"][-1], kind)
    assert "cmd_vel" not in bench.hub.sent


def test_a_car_is_told_speed_and_steering_angle() -> None:
    bench = Bench("car", drive="ackermann", wheelbase=1.0)
    bench.drive(Drive(0.5, 1.0))
    sent = bench.hub.sent["/robot1/ackermann_cmd"][-1]
    assert isinstance(sent, AckermannDriveStamped)
    assert (sent.speed, sent.steering_angle) == pytest.approx((0.5, 0.7853981633974483))
    bench.driver.stop("over")
    assert bench.hub.sent["/robot1/ackermann_cmd"][-1].speed == 0.0


def test_ticks_without_a_pose_are_skipped_and_the_robot_stands() -> None:
    bench = Bench()
    bench.ticks.left = deque([0, 1, None])
    assert bench.driver.sense() is None
    bench.driver.cycle()
    assert bench.told == STILL
    bench.at()
    bench.ticks.left = deque([7])
    assert present(bench.driver.sense()).k == 7


def test_the_stop_topic_wins_until_it_is_released() -> None:
    bench = Bench()
    bench.drive(AHEAD)
    assert bench.told.vx == 0.5
    bench.stop.send(Bool(True))
    bench.driver.cycle()
    assert bench.told == STILL
    bench.drive(AHEAD)
    assert bench.told == STILL
    bench.stop.send(Bool(False))
    bench.driver.cycle()
    assert bench.told.vx == 0.5
    assert bench.said == ["stopped by the topic /robot1/stop", "released by the topic /robot1/stop"]


class Orders:
    """Stands for `StopOrders`."""

    def __init__(self) -> None:
        self.give: Callable[[Order], Outcome] = lambda _order: Outcome(False, "")

    def obey(self, carry_out: Callable[[Order], Outcome]) -> None:
        self.give = carry_out


def test_operators_are_told_that_a_robot_stands_only_when_its_odometry_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(standing, "LIMIT_S", 0.05)
    monkeypatch.setattr(standing, "LOOK_S", 0.05)
    orders = Orders()
    bench = Bench(orders=orders)
    drives, told = messages.Twist(0.5, 0.0, 0.0), "stopped by an operator (fogwatch control ... release)"
    ended = threading.Event()
    twist = drives

    def speak() -> None:
        while not ended.wait(0.01):
            bench.at(twist=twist)

    speaking = threading.Thread(target=speak)
    bench.driver.start()
    speaking.start()
    try:
        bench.until(lambda: orders.give(Order.STOP).text == f"may still drive: its odometry says 0.50 m/s; {told}")
        twist = STILL
        bench.until(lambda: orders.give(Order.STOP) == Outcome(True, told))
        twist = drives  # it is pushed, or somebody else drives it
        bench.until(lambda: not orders.give(Order.STOP).done)
        twist = STILL
        bench.until(lambda: orders.give(Order.STOP).done)
        ended.set()
        bench.until(lambda: orders.give(Order.STOP).text == f"may still drive: its odometry does not come; {told}")
        assert orders.give(Order.RELEASE) == Outcome(True, "not stopped")
        assert bench.said.count("stopped by an operator") == 1
    finally:
        ended.set()
        speaking.join()
        bench.driver.stop("over")


def test_goals_are_places_on_the_robots_own_map() -> None:
    """Its map lies at (10, 5) on ours, turned to the left."""
    settings = LocalisationSettings(fresh_s=PATIENCE_S, delay_s=0.0, transform=Pose(10.0, 5.0, math.pi / 2))
    bench = Bench(nav2=True, drive="nav2", localisation=settings)
    server = GoalServer(bench.robot)
    bench.at(Pose(1.0, 0.0, 0.0))
    fix = bench.fix()
    assert (fix.pose.x, fix.pose.y) == pytest.approx((10.0, 6.0))
    bench.steering.want(Velocity(0.0, 0.0), (10.0, 8.0), 0.0)
    bench.steering.step(fix, 0.0, 0.05, "")
    place = present(server.step(1)).pose
    assert (place.x, place.y, place.heading) == pytest.approx((3.0, 0.0, 0.0))


def test_a_robot_that_nav2_has_not_let_go_of_may_still_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steering, "CONFIRM_S", 0.1)
    bench = Bench(nav2=True, drive="nav2")
    GoalServer(bench.robot)  # never steps, and so never answers
    bench.driver.stop("over")
    unsure = "may still drive: Nav2 has not confirmed that it has cancelled its goals"
    assert bench.said == ["stopped for good: over", unsure]


def test_a_robot_that_has_rested_drives_on_from_zero() -> None:
    bench = Bench()
    bench.drive(AHEAD)
    bench.driver.rest()
    bench.driver.cycle()
    assert bench.told == STILL
    bench.driver.go_on()
    bench.drive()
    assert bench.told.vx == 0.5
    bench.driver.stop("over")
    bench.driver.go_on()
    bench.driver.cycle()
    assert bench.told == STILL


def test_a_stop_that_was_published_before_the_driver_came_holds() -> None:
    hub = Hub()
    hub.link("remote", "robot1").publisher("stop", Bool, LATCHED).send(Bool(True))
    hardware = Hardware(hub.link("fogwatch", "robot1"), DriveSettings(), 1.0, lambda _: None)
    hardware.fix()
    assert hardware.stops


def test_odometry_that_ends_stops_the_robot_and_its_return_lets_it_go_on() -> None:
    """The driver's own thread, and wall time: the robot is silent for longer than the driver accepts."""
    bench = Bench(localisation=LocalisationSettings(fresh_s=0.2, delay_s=0.0))

    def drives_while_it_speaks() -> bool:
        bench.at()
        return bool(bench.hub.sent["/robot1/cmd_vel"]) and bench.told.vx == 0.5

    bench.driver.act(AHEAD)
    bench.driver.start()
    try:
        bench.until(drives_while_it_speaks)
        bench.until(lambda: bench.told == STILL)
        assert bench.hardware.why.startswith("no odometry for ")
        bench.until(drives_while_it_speaks)
    finally:
        bench.driver.stop("over")
    count = len(bench.hub.sent["/robot1/cmd_vel"])
    assert [one.twist for one in bench.hub.sent["/robot1/cmd_vel"][-5:]] == [STILL] * 5
    bench.drive()
    assert len(bench.hub.sent["/robot1/cmd_vel"]) == count
    assert bench.said[-1] == "stopped for good: over"


def test_a_driver_that_fails_stops_the_robot_and_tells_the_mind_and_the_log() -> None:
    bench = Bench()
    bench.at()

    def broken() -> None:
        raise RuntimeError("a wire is loose")

    bench.hardware.fix = broken  # type: ignore[method-assign]
    bench.driver.start()
    bench.until(lambda: len(bench.hub.sent["/robot1/cmd_vel"]) == 5)
    assert bench.told == STILL
    bench.until(lambda: bool(bench.driver.stopped))
    with pytest.raises(DriverFailed, match="a wire is loose"):
        bench.driver.sense()
    assert [str(error) for error in bench.log.failures] == ["a wire is loose"]


def test_transforms_outside_of_the_namespace_count_while_there_are_none_inside() -> None:
    bench = Bench()
    root = bench.robot.publisher("/tf", TFMessage)
    outside = TFMessage((Transform(0, "map", "odom", Pose(3.0, 0.0, 0.0)),))
    root.send(outside)
    bench.odom.send(Odometry(0, "odom", "base_link", PLACE, STILL))
    assert bench.fix().pose.x == 5.0
    bench.at()
    root.send(outside)
    assert bench.fix().pose.x == 2.0


def test_the_time_of_a_simulation_is_the_robots_time() -> None:
    bench = Bench(sim_time=True, localisation=LocalisationSettings(fresh_s=PATIENCE_S))
    bench.driver.cycle()
    assert "no time on /clock" in bench.hardware.why
    clock = bench.robot.publisher("/clock", Clock)
    begun_s = time.monotonic()
    clock.send(Clock(5_000_000_000))
    bench.tf.send(TFMessage((Transform(0, "map", "odom", Pose(0.0, 0.0, 0.0)),)))
    bench.odom.send(Odometry(4_950_000_000, "odom", "base_link", PLACE, messages.Twist(1.0, 0.0, 0.0)))
    assert 5.0 <= present(bench.hardware.time.now()) <= 5.0 + time.monotonic() - begun_s
    assert bench.fix().pose.x >= 2.05


def test_who_does_not_get_on_has_bumped() -> None:
    progress = MotionCheck()
    for travelled, stuck in ((0.0, True), (0.05, True), (0.2, False), (0.4, False), (-0.3, True)):
        assert not progress.ended(Pose(0.0, 0.0, 0.0)) or travelled
        progress = MotionCheck()
        progress.ended(Pose(0.0, 0.0, 0.0))
        progress.told(Twist(ENOUGH_M - 0.01, 0.0), 1.0)
        assert not progress.ended(Pose(0.0, 0.0, 0.0))
        progress.told(Twist(0.1, 0.0), 1.0)
        assert progress.ended(Pose(travelled, 0.0, 0.0)) == stuck


def test_nav2_gets_a_goal_and_a_new_one_only_when_it_has_moved() -> None:
    bench = Bench(nav2=True, drive="nav2")
    server = GoalServer(bench.robot)

    def cycle(goal: tuple[float, float] | None) -> messages.PoseStamped | None:
        bench.at()
        bench.steering.want(Twist(0.0, 0.0), goal, 0.0)
        bench.driver.cycle()
        return server.step(0)

    target = present(cycle((5.0, 5.0)))
    assert (target.frame, target.pose.x, target.pose.y) == ("map", 5.0, 5.0)
    assert cycle((5.2, 5.0)) == target
    assert present(cycle((6.0, 5.0))).pose.x == 6.0
    bench.stop.send(Bool(True))
    assert cycle((6.0, 5.0)) is None
    bench.stop.send(Bool(False))
    assert cycle((6.0, 5.0)) is not None
    assert cycle(None) is None
    cycle((6.0, 5.0))
    bench.driver.stop("over")
    assert server.step(0) is None
    assert "/robot1/cmd_vel" not in bench.hub.sent


def test_a_goal_that_nav2_gives_up_is_a_bump() -> None:
    bench = Bench(nav2=True, drive="nav2")
    server = GoalServer(bench.robot)
    bench.steering.want(Twist(0.0, 0.0), (5.0, 5.0), 0.0)
    bench.drive()
    server.step(0)
    bench.driver.cycle()
    server.finish(Status.ABORTED)
    for _ in range(3):
        bench.drive()
        server.step(0)
    assert present(bench.driver.sense()).bumped


@pytest.mark.parametrize(
    ("factor", "lasted_s", "begun_s"),
    [
        (1.0, [0.0, 0.04, 0.0, 0.0], [0.0, 0.1, 0.2, 0.3]),
        (1.0, [0.25, 0.0, 0.0, 0.0], [0.0, 0.25, 0.35, 0.45]),  # what it was late it does not make up for
        (4.0, [0.0, 0.01, 0.0, 0.0], [0.0, 0.025, 0.05, 0.075]),  # a simulation that is faster than our time
    ],
)
def test_commands_come_at_the_hardwares_rate(
    factor: float, lasted_s: list[float], begun_s: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(rate_hz=10.0)
    bench.hardware.factor = factor
    passing = Passing()
    over = Waiter(passing)
    monkeypatch.setattr(driver, "time", passing)
    monkeypatch.setattr(bench.driver, "_over", over)
    begun: list[float] = []

    def cycle() -> None:
        begun.append(passing.now_s - 100.0)
        passing.now_s += lasted_s[len(begun) - 1]
        if len(begun) == len(lasted_s):
            over.set()

    monkeypatch.setattr(bench.driver, "cycle", cycle)
    bench.driver.start()
    bench.until(lambda: bool(bench.hub.sent["/robot1/cmd_vel"]))
    assert begun == pytest.approx(begun_s)


@pytest.mark.parametrize(
    ("place", "stopped", "after_s"),
    [
        (Pose(-3.0, 5.0, 0.0), False, 10.0),  # its fence holds it
        (PLACE, True, 1.0),
        (None, False, 1.0),  # nobody knows where it is
    ],
)
def test_why_a_robot_stands_is_said_after_a_second_and_after_ten_where_it_may_go_round(
    place: Pose | None, stopped: bool, after_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, passing = Bench(), Passing()
    monkeypatch.setattr(driver, "time", passing)
    if stopped:
        bench.stop.send(Bool(True))
    begun_s = passing.now_s
    for passed_s, lines in ((0.0, 0), (after_s - 0.01, 0), (after_s, 1), (after_s + 30.0, 1)):
        passing.now_s = begun_s + passed_s
        if place is not None:
            bench.at(place)
        bench.driver.act(AHEAD)
        bench.driver.cycle()
        assert len([line for line in bench.said if line.startswith("stands: ")]) == lines, passed_s


@pytest.mark.parametrize(("factor", "passed_s", "counts_s"), [(1.0, 0.1, 0.1), (4.0, 0.05, 0.2), (1.0, 3.0, 0.25)])
def test_a_late_cycle_counts_as_a_quarter_of_a_second(
    factor: float, passed_s: float, counts_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, passing, counted = Bench(), Passing(), list[float]()
    bench.hardware.factor = factor
    monkeypatch.setattr(driver, "time", passing)

    def step(_fix: object, _now_s: float, since_s: float, _stopped: str) -> str:
        counted.append(since_s)
        return ""

    monkeypatch.setattr(bench.steering, "step", step)
    bench.driver.cycle()
    passing.now_s += passed_s
    bench.driver.cycle()
    assert counted[-1] == pytest.approx(counts_s)


def test_a_thread_that_hangs_does_not_keep_the_robot_from_being_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, waits = Bench(), list[tuple[str, float]]()

    class Taken:
        """A lock that another thread never releases."""

        def acquire(self, timeout: float) -> bool:
            waits.append(("lock", timeout))
            return False

    class Hangs:
        def is_alive(self) -> bool:
            return True

        def join(self, timeout: float) -> None:
            waits.append(("thread", timeout))

    monkeypatch.setattr(bench.driver, "_lock", Taken())
    monkeypatch.setattr(bench.driver, "_thread", Hangs())
    bench.driver.stop("over")
    assert waits == [("thread", 1.0), ("lock", 0.2)]
    assert bench.told == STILL
