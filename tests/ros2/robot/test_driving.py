"""An agent's process drives a simulated ROS 2 robot over a real router. Nothing here depends on how fast it is."""

import contextlib
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fogwatch.commands.control import control
from patrol.pose import Pose
from ros2.sim.node import Habits
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Bool, CancelRequest, CancelResponse, Clock, OccupancyGrid, TwistStamped
from ros2.wire.messages import Path as Way
from ros2.wire.names import LATCHED, EntityKind
from ros2.wire.ports import Asked
from runtime.net.link import open_router
from tests.present import present
from tests.ros2_bench import NAME, Bench, bench
from tests.routers import PATIENCE_S, free_endpoint

pytestmark = pytest.mark.processes

OWN_MAP = Pose(3.0, -2.0, 2.0)
OTHER_MAP = ["--transform=3,-2,2", "--start", "1.5,1.5,0.3"]


@contextmanager
def driving(endpoint: str, folder: Path, watchdog_s: float = 0.5) -> Iterator[Bench]:
    with bench(endpoint, "rmw_zenoh", folder, watchdog_s=watchdog_s) as made:
        made.agent()
        made.drives()
        yield made


@pytest.fixture
def driven(endpoint: str, tmp_path: Path) -> Iterator[Bench]:
    """A robot that is driven."""
    with driving(endpoint, tmp_path) as made:
        yield made


@pytest.fixture
def unwatched(endpoint: str, tmp_path: Path) -> Iterator[Bench]:
    """A robot that is driven and has no watchdog to speak of: only the agent can have stopped it."""
    with driving(endpoint, tmp_path, watchdog_s=10.0 * PATIENCE_S) as made:
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
    with driven.joined("rviz") as link:
        grids: dict[str, RosMailbox[OccupancyGrid]] = {name: RosMailbox() for name in ("map", "fog")}
        for name, mailbox in grids.items():
            link.subscribe(name, OccupancyGrid, mailbox, LATCHED)
        ways: RosMailbox[Way] = RosMailbox()
        link.subscribe("path", Way, ways, LATCHED)
        plan, fog = (present(grids[name].take(PATIENCE_S)).message.cells for name in ("map", "fog"))
        assert plan.shape == fog.shape == (60, 80)
        assert set(np.unique(plan)) == {0, 100}
        assert fog.min() == -1
        assert len(present(ways.take(PATIENCE_S)).message.poses) >= 1
        seen = [one for one in link.graph(PATIENCE_S) if one.node.name == "fogwatch"]
        ours = {one.topic for one in seen if one.kind is EntityKind.PUBLISHER}
        assert ours == {"/diagnostics", *(f"/{NAME}/{name}" for name in ("cmd_vel", "map", "fog", "path"))}


def test_a_robot_whose_odometry_ends_stands_and_goes_on_when_it_comes_back(unwatched: Bench) -> None:
    begin = len(unwatched.said)
    unwatched.node.plugged = False
    unwatched.stays()
    unwatched.says("stands: no odometry for", begin)
    begin = len(unwatched.said)
    unwatched.node.plugged = True
    unwatched.drives()
    unwatched.says("drives again", begin)


def test_the_stop_topic_wins_until_it_is_released_over_a_bridge(endpoint: str, tmp_path: Path) -> None:
    """Each message comes from a publisher of its own, as from a command that is called twice."""
    with bench(endpoint, "bridge", tmp_path) as made, made.joined("hand") as hand, made.joined("other") as other:
        made.agent()
        made.drives()
        hand.publisher("stop", Bool, LATCHED).send(Bool(True))
        made.says("stopped by the topic /robot1/stop")
        made.stays()
        other.publisher("stop", Bool, LATCHED).send(Bool(False))
        made.drives()


def test_a_message_on_the_stop_topic_that_cannot_be_read_stops_the_robot(driven: Bench) -> None:
    with driven.joined("hand") as hand:
        hand.publisher("stop", Clock, LATCHED).send(Clock(0))
        driven.says("stopped by the topic /robot1/stop")
        driven.says("refused: /robot1/stop: is a rosgraph_msgs/msg/Clock")
        driven.stays()


def ask(made: Bench, order: str, robot: str | None = None) -> int:
    """Have an operator say something; return the command's exit code."""
    return control(Path(made.endpoint), order, robot, fleet="patrol", wait=PATIENCE_S)


def test_an_operators_stop_wins_until_it_is_released(driven: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert ask(driven, "stop", NAME) == 0
    assert "robot1: stopped by an operator" in capsys.readouterr().out
    driven.stays()
    assert ask(driven, "release") == 0
    assert "robot1: not stopped" in capsys.readouterr().out
    driven.drives()
    assert ask(driven, "stop", "robot9") == 3
    assert "no answer from robot9; use another way to stop" in capsys.readouterr().err


def test_an_operator_is_told_that_a_robot_stands_only_when_nav2_has_heard_of_it(
    endpoint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with bench(endpoint, "rmw_zenoh", tmp_path, Habits(has_nav2=True)) as made:
        made.agent("--drive", "nav2")
        made.drives()
        goals = present(made.node._goals)
        cancel = goals._cancel_goals
        lost: list[Asked[CancelRequest, CancelResponse]] = []
        losing = 3

        def lossy(asked: Asked[CancelRequest, CancelResponse]) -> None:
            (lost.append if len(lost) < losing else cancel)(asked)

        goals._cancel_goals = lossy  # type: ignore[method-assign]
        made.until(lambda: ask(made, "stop") == 0)
        assert made.robot.stands
        assert len(lost) == 3
        losing = 10_000
        assert ask(made, "release") == 0
        made.drives()
        capsys.readouterr()
        assert ask(made, "stop") == 1
        assert "robot1: may still drive: " in capsys.readouterr().err
        goals._cancel_goals = cancel  # type: ignore[method-assign]
        made.until(lambda: ask(made, "stop") == 0)
        assert made.robot.stands


def test_a_stop_outlives_the_agent_that_was_told_of_it(driven: Bench) -> None:
    """The stops are those of an operator, and of a publisher that has ended since."""
    with driven.joined("hand") as hand:
        hand.publisher("stop", Bool, LATCHED).send(Bool(True))
        driven.says("stopped by the topic /robot1/stop")
    assert ask(driven, "stop") == 0
    driven.agents[0].kill()
    driven.agents[0].wait()
    begin = len(driven.said)
    driven.agent()
    both = "stands: stopped by an operator (fogwatch control ... release); stopped by the topic /robot1/stop"
    driven.says(both, begin)
    driven.stays()
    assert ask(driven, "release") == 0
    driven.stays()
    with driven.joined("hand") as hand:
        hand.publisher("stop", Bool, LATCHED).send(Bool(False))
        driven.drives()


def test_the_robot_stands_before_ctrl_z_pauses_the_agent_and_drives_on_after_it(unwatched: Bench) -> None:
    agent = unwatched.agents[0]
    agent.send_signal(signal.SIGTSTP)
    os.waitid(os.P_PID, agent.pid, os.WSTOPPED)
    unwatched.until(lambda: unwatched.robot.stands)
    agent.send_signal(signal.SIGCONT)
    unwatched.drives()


def test_a_second_agent_of_a_robot_does_not_start(driven: Bench) -> None:
    assert driven.agent("--name", "robot2").wait(PATIENCE_S) == 2
    driven.says("another agent, /robot1/fogwatch: drives the robot already")


def test_a_robot_that_somebody_else_commands_stands_until_he_has_gone(driven: Bench) -> None:
    with driven.joined("teleop") as other:
        other.publisher("cmd_vel", TwistStamped)
        driven.says("stands: also driven by /robot1/teleop on /robot1/cmd_vel")
        driven.stays()
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
        made.says("stands: no odometry for")
        manager.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while manager.recv(100):
                pass
        manager.settimeout(PATIENCE_S)
        assert manager.recv(100) == b"WATCHDOG=1"


def test_a_robot_whose_odometry_hangs_is_not_driven_blindly_for_long(driven: Bench) -> None:
    real = driven.robot.odometry
    hung = {"counted": real.counted, "correction": real.correction, "found": real.found, "say": lambda: real.counted}
    nothing = {"move": lambda *_: None, "localise": lambda: None}
    driven.robot.odometry = SimpleNamespace(**hung, **nothing)  # type: ignore[assignment]
    begin_m = driven.robot.body.distance_m
    driven.says("stands: its pose stays where it is")
    driven.stays()
    assert driven.robot.body.distance_m - begin_m < 4.0


def test_when_the_router_is_gone_the_robot_stands_and_when_it_is_back_the_patrol_goes_on(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    router = open_router(endpoint)
    with driving(endpoint, tmp_path) as made:
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


def test_a_start_off_the_map_is_not_told(endpoint: str, tmp_path: Path) -> None:
    with bench(endpoint, "rmw_zenoh", tmp_path, Habits(is_lost=True)) as made:
        assert made.agent("--start", "500,500,0").wait(PATIENCE_S) == 2
        made.says("--start: (500, 500) is not on")


def test_a_map_may_come_from_the_robot(endpoint: str, tmp_path: Path) -> None:
    with bench(endpoint, "rmw_zenoh", tmp_path, Habits(has_map=True)) as made:
        made.agent(has_map=False)
        made.drives()
        assert any("waits for the map on /robot1/map" in line for line in made.said)
