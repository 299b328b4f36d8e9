"""An agent's process drives a simulated ROS 2 robot over a real router. Nothing here depends on how fast it is."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fogwatch.commands.control import control
from patrol.net.link import open_router
from patrol.pose import Pose
from ros2.sim.node import Habits
from ros2.sim.odometry import DriftingOdometry
from ros2.wire.formats import format_named
from ros2.wire.link import open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Bool, CancelRequest, CancelResponse, Clock, OccupancyGrid, TwistStamped
from ros2.wire.messages import Path as Way
from ros2.wire.names import LATCHED, EntityKind, NodeName
from ros2.wire.ports import Asked
from tests.ros2_bench import NAME, Bench, bench
from tests.routers import PATIENCE_S, free_endpoint

pytestmark = pytest.mark.processes

OWN_MAP = Pose(3.0, -2.0, 2.0)
OTHER_MAP = ["--transform=3,-2,2", "--start", "1.5,1.5,0.3"]


@pytest.fixture
def driven(endpoint: str, tmp_path: Path) -> Iterator[Bench]:
    """A robot that is driven."""
    with bench(endpoint, "rmw_zenoh", tmp_path) as made:
        made.agent()
        made.drives()
        yield made


@pytest.fixture
def unwatched(endpoint: str, tmp_path: Path) -> Iterator[Bench]:
    """A robot that is driven and has no watchdog to speak of: only the agent can have stopped it."""
    with bench(endpoint, "rmw_zenoh", tmp_path, watchdog_s=10.0 * PATIENCE_S) as made:
        made.agent()
        made.drives()
        yield made


@pytest.mark.parametrize(
    ("form", "habits", "options", "number"),
    [
        pytest.param("rmw_zenoh", Habits(delay_s=0.1), [], signal.SIGINT, marks=pytest.mark.kind("ros2")),
        ("rmw_zenoh-humble", Habits("twist"), ["--drive", "twist", "--localisation", "pose"], signal.SIGQUIT),
        ("bridge", Habits(), ["--localisation", "odometry", "--start", "1.5,1.5,0.3"], signal.SIGTERM),
        ("rmw_zenoh", Habits(has_nav2=True), ["--drive", "nav2"], signal.SIGINT),
        ("rmw_zenoh", Habits(is_lost=True), ["--start", "1.6,1.4,0.2"], signal.SIGINT),
        ("bridge", Habits(is_lost=True, transform=OWN_MAP), [*OTHER_MAP, "--localisation", "pose"], signal.SIGINT),
        ("rmw_zenoh", Habits(has_nav2=True, transform=OWN_MAP), [*OTHER_MAP, "--drive", "nav2"], signal.SIGINT),
    ],
)
def test_a_robot_patrols_and_stands_when_the_agent_is_interrupted(
    form: str, habits: Habits, options: list[str], number: signal.Signals, endpoint: str, tmp_path: Path
) -> None:
    with bench(endpoint, form, tmp_path, habits) as made:
        agent = made.agent(*options)
        made.until(lambda: made.robot.body.distance_m > 2.0)
        agent.send_signal(number)
        assert agent.wait(PATIENCE_S) == 130
        stops = made.robot.watchdog_stops
        made.until(lambda: made.robot.stands)
        assert made.robot.watchdog_stops == stops  # it was told to, and not left alone
        assert made.robot.walls_touched == 0
        assert any(f"stopped for good: told to by {number.name}" in line for line in made.said)


def test_who_looks_on_sees_map_fog_and_path_and_the_agent_in_the_graph(driven: Bench) -> None:
    link = open_ros2(driven.endpoint, format_named("rmw_zenoh", 0, ""), NodeName("rviz", NAME), PATIENCE_S)
    try:
        grids: dict[str, RosMailbox[OccupancyGrid]] = {name: RosMailbox() for name in ("map", "fog")}
        for name, mailbox in grids.items():
            link.subscribe(name, OccupancyGrid, mailbox, LATCHED)
        ways: RosMailbox[Way] = RosMailbox()
        link.subscribe("path", Way, ways, LATCHED)
        plan, fog, way = grids["map"].take(PATIENCE_S), grids["fog"].take(PATIENCE_S), ways.take(PATIENCE_S)
        assert plan is not None
        assert fog is not None
        assert way is not None
        assert plan.message.cells.shape == fog.message.cells.shape == (60, 80)
        assert set(np.unique(plan.message.cells)) == {0, 100}
        assert fog.message.cells.min() == -1
        assert len(way.message.poses) >= 1
        ours = {
            one.topic
            for one in link.graph(PATIENCE_S)
            if one.node.name == "fogwatch" and one.kind is EntityKind.PUBLISHER
        }
        assert ours == {"/diagnostics", *(f"/{NAME}/{name}" for name in ("cmd_vel", "map", "fog", "path"))}
    finally:
        assert link.close(PATIENCE_S)


def test_a_robot_whose_odometry_ends_stands_and_goes_on_when_it_comes_back(unwatched: Bench) -> None:
    begin = len(unwatched.said)
    unwatched.node.plugged = False
    unwatched.stays()
    unwatched.until(lambda: any("stands: no odometry for" in line for line in unwatched.said[begin:]))
    begin = len(unwatched.said)
    unwatched.node.plugged = True
    unwatched.drives()
    unwatched.until(lambda: any(line.endswith("drives again") for line in unwatched.said[begin:]))


@pytest.mark.parametrize("form", ["rmw_zenoh", "bridge"])
def test_the_stop_topic_wins_until_it_is_released(form: str, endpoint: str, tmp_path: Path) -> None:
    """Each message comes from a publisher of its own, as from a command that is called twice."""
    links = [
        open_ros2(endpoint, format_named(form, 0, ""), NodeName(name, NAME), PATIENCE_S) for name in ("hand", "other")
    ]
    try:
        with bench(endpoint, form, tmp_path) as made:
            made.agent()
            made.drives()
            links[0].publisher("stop", Bool, LATCHED).send(Bool(True))
            made.until(lambda: any("stopped by the topic /robot1/stop" in line for line in made.said))
            made.stays()
            links[1].publisher("stop", Bool, LATCHED).send(Bool(False))
            made.drives()
    finally:
        assert all(link.close(PATIENCE_S) for link in links)


def test_an_operators_stop_wins_until_it_is_released(driven: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    def ask(what: str, robot: str | None = NAME) -> int:
        return control(Path(driven.endpoint), what, robot, fleet="patrol", wait=PATIENCE_S)

    assert ask("stop") == 0
    assert "robot1: stopped by an operator" in capsys.readouterr().out
    driven.stays()
    assert ask("release", None) == 0
    assert "robot1: not stopped" in capsys.readouterr().out
    driven.drives()
    assert ask("stop", "robot9") == 3
    assert "no answer from robot9; use another way to stop" in capsys.readouterr().err


def test_an_operator_is_told_that_a_robot_stands_only_when_nav2_has_heard_of_it(
    endpoint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with bench(endpoint, "rmw_zenoh", tmp_path, Habits(has_nav2=True)) as made:
        made.agent("--drive", "nav2")
        made.drives()
        goals = made.node._goals
        assert goals is not None
        cancel = goals._cancel_goals
        lost: list[Asked[CancelRequest, CancelResponse]] = []
        losing = 3

        def lossy(asked: Asked[CancelRequest, CancelResponse]) -> None:
            if len(lost) < losing:
                lost.append(asked)
            else:
                cancel(asked)

        goals._cancel_goals = lossy  # type: ignore[method-assign]
        made.until(lambda: control(Path(endpoint), "stop", None, fleet="patrol", wait=PATIENCE_S) == 0)
        assert made.robot.stands
        assert len(lost) == 3
        losing = 10_000
        assert control(Path(endpoint), "release", None, fleet="patrol", wait=PATIENCE_S) == 0
        made.drives()
        capsys.readouterr()
        assert control(Path(endpoint), "stop", None, fleet="patrol", wait=PATIENCE_S) == 1
        assert "robot1: may still drive: " in capsys.readouterr().err
        goals._cancel_goals = cancel  # type: ignore[method-assign]
        made.until(lambda: control(Path(endpoint), "stop", None, fleet="patrol", wait=PATIENCE_S) == 0)
        assert made.robot.stands


def test_a_stop_outlives_the_agent_that_was_told_of_it(driven: Bench) -> None:
    """By an operator, and by a publisher that has ended since."""
    link = open_ros2(driven.endpoint, format_named("rmw_zenoh", 0, ""), NodeName("hand", NAME), PATIENCE_S)
    link.publisher("stop", Bool, LATCHED).send(Bool(True))
    driven.until(lambda: any("stopped by the topic /robot1/stop" in line for line in driven.said))
    assert link.close(PATIENCE_S)
    assert control(Path(driven.endpoint), "stop", None, fleet="patrol", wait=PATIENCE_S) == 0
    driven.agents[0].kill()
    driven.agents[0].wait()
    begin = len(driven.said)
    driven.agent()
    both = "stands: stopped by an operator (fogwatch control ... release); stopped by the topic /robot1/stop"
    driven.until(lambda: any(both in line for line in driven.said[begin:]))
    driven.stays()
    assert control(Path(driven.endpoint), "release", None, fleet="patrol", wait=PATIENCE_S) == 0
    driven.stays()
    link = open_ros2(driven.endpoint, format_named("rmw_zenoh", 0, ""), NodeName("hand", NAME), PATIENCE_S)
    link.publisher("stop", Bool, LATCHED).send(Bool(False))
    driven.drives()
    assert link.close(PATIENCE_S)


def test_whatever_is_said_on_the_stop_topic_and_cannot_be_read_stops_the_robot(driven: Bench) -> None:
    link = open_ros2(driven.endpoint, format_named("rmw_zenoh", 0, ""), NodeName("hand", NAME), PATIENCE_S)
    try:
        link.publisher("stop", Clock, LATCHED).send(Clock(0))
        driven.until(lambda: any("stopped by the topic /robot1/stop" in line for line in driven.said))
        assert any("refused: /robot1/stop: is a rosgraph_msgs/msg/Clock" in line for line in driven.said)
        driven.stays()
    finally:
        assert link.close(PATIENCE_S)


def test_the_robot_stands_before_ctrl_z_pauses_the_agent_and_drives_on_after_it(unwatched: Bench) -> None:
    agent = unwatched.agents[0]
    agent.send_signal(signal.SIGTSTP)
    os.waitid(os.P_PID, agent.pid, os.WSTOPPED)
    unwatched.until(lambda: unwatched.robot.stands)
    agent.send_signal(signal.SIGCONT)
    unwatched.drives()


def test_a_second_agent_of_a_robot_does_not_start(driven: Bench) -> None:
    assert driven.agent("--name", "robot2").wait(PATIENCE_S) == 2
    driven.until(lambda: any("another agent, /robot1/fogwatch: drives the robot already" in one for one in driven.said))


def test_a_robot_that_somebody_else_commands_stands_until_he_has_gone(driven: Bench) -> None:
    other = open_ros2(driven.endpoint, format_named("rmw_zenoh", 0, ""), NodeName("teleop", NAME), PATIENCE_S)
    other.publisher("cmd_vel", TwistStamped)
    driven.until(lambda: any("stands: also driven by /robot1/teleop on /robot1/cmd_vel" in one for one in driven.said))
    driven.stays()
    assert other.close(PATIENCE_S)
    driven.drives()


def test_an_agent_tells_the_service_manager_that_it_is_ready_and_alive_also_without_a_pose(
    endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.bind(str(tmp_path / "manager"))
    manager.settimeout(PATIENCE_S)
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "manager"))
    monkeypatch.setenv("WATCHDOG_USEC", "1000000")
    with manager, bench(endpoint, "rmw_zenoh", tmp_path) as made:
        made.agent()
        assert [manager.recv(100) for _ in range(4)] == [b"READY=1", *[b"WATCHDOG=1"] * 3]
        made.drives()
        made.node.plugged = False
        made.until(lambda: any("stands: no odometry for" in line for line in made.said))
        manager.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while manager.recv(100):
                pass
        manager.settimeout(PATIENCE_S)
        assert manager.recv(100) == b"WATCHDOG=1"


def test_a_robot_whose_odometry_hangs_is_not_driven_blindly_for_long(driven: Bench) -> None:
    driven.robot.odometry = Hung(driven.robot.odometry)  # type: ignore[assignment]
    begin_m = driven.robot.body.distance_m
    driven.until(lambda: any("stands: its pose stays where it is" in line for line in driven.said))
    driven.stays()
    assert driven.robot.body.distance_m - begin_m < 4.0


class Hung:
    """Odometry that says the same for ever."""

    def __init__(self, odometry: DriftingOdometry) -> None:
        self.counted, self.correction, self.found = odometry.counted, odometry.correction, odometry.found

    def move(self, pose: Pose, counted: Pose | None) -> None:
        """The robot has moved, and nobody counts."""

    def localise(self) -> None:
        """The pose stays where it is."""

    def say(self) -> Pose:
        return self.counted


def test_when_the_agent_is_killed_the_robots_watchdog_stops_it(driven: Bench) -> None:
    driven.agents[0].kill()
    driven.until(lambda: driven.robot.watchdog_stops > 0)
    driven.until(lambda: driven.robot.stands)


def test_when_the_router_is_gone_the_robot_stands_and_when_it_is_back_the_patrol_goes_on(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    router = open_router(endpoint)
    with bench(endpoint, "rmw_zenoh", tmp_path) as made:
        made.agent()
        made.drives()
        assert router.close(PATIENCE_S)
        made.until(lambda: made.robot.watchdog_stops > 0 and made.robot.stands)
        router = open_router(endpoint)
        made.drives()
    assert router.close(PATIENCE_S)


def test_a_robot_stands_where_its_scenario_says(endpoint: str, tmp_path: Path) -> None:
    with bench(endpoint, "rmw_zenoh", tmp_path, Habits(is_lost=True)) as made:
        fleet = tmp_path / "fleet.yaml"
        fleet.write_text(
            "terrain: {map: plan.yaml}\npoint: 0.1\npace: realtime\nradio: {via: direct}\nsensor: {range: 3}\n"
            f"robots: [{{name: {NAME}, model: differential, speed: 0.5, radius: 0.35, start: [1.5, 1.5, 0.3]}}]\n",
            encoding="utf-8",
        )
        made.agent("--scenario", str(fleet), "--start", "scenario", has_map=False)
        made.drives()


def test_a_localised_robot_is_not_told_another_place(endpoint: str, tmp_path: Path) -> None:
    """Its localisation would believe it, and then agree."""
    with bench(endpoint, "rmw_zenoh", tmp_path) as made:
        agent = made.agent("--start", "6,4.5,0")
        assert agent.wait(PATIENCE_S) == 2
        made.until(lambda: any("its localisation has it at (1." in line for line in made.said))
        assert not any("tells the robot's localisation" in line for line in made.said)
        assert made.robot.commands == 0


def test_a_start_off_the_map_is_not_told(endpoint: str, tmp_path: Path) -> None:
    with bench(endpoint, "rmw_zenoh", tmp_path, Habits(is_lost=True)) as made:
        assert made.agent("--start", "500,500,0").wait(PATIENCE_S) == 2
        made.until(lambda: any("--start: (500, 500) is not on" in line for line in made.said))


def test_a_map_may_come_from_the_robot(endpoint: str, tmp_path: Path) -> None:
    with bench(endpoint, "rmw_zenoh", tmp_path, Habits(has_map=True)) as made:
        made.agent(has_map=False)
        made.drives()
        assert any("waits for the map on /robot1/map" in line for line in made.said)
