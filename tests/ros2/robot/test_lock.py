"""Stopping a robot over its own locked router, whose limits drop what comes too fast."""

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from patrol.ground.terrain import Terrain
from patrol.pose import Limits, Pose, Twist
from ros2.robot.fence import Fence, Others
from ros2.robot.governor import Governor, Response
from ros2.robot.hardware import Hardware
from ros2.robot.localisation import Fix
from ros2.robot.options import DriveSettings
from ros2.robot.steering import VelocitySteering
from ros2.wire import messages
from ros2.wire.definitions import type_hash
from ros2.wire.formats import RmwZenoh
from ros2.wire.goals import GoalClient, GoalServer, Going
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import PoseStamped, TwistStamped
from ros2.wire.names import Entity, EntityKind, NodeName
from tests.ros2_site import Site
from tests.routers import PATIENCE_S, make_local_fleet, needs_openssl

pytestmark = needs_openssl

ENDINGS = 20
THERE = PoseStamped(1, "map", Pose(3.0, 4.0, 0.0))
CANCEL = "action_msgs/srv/CancelGoal"


@pytest.fixture
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    made = Site(make_local_fleet(tmp_path_factory.mktemp("fleet") / "f", ["r1"]), RmwZenoh())
    yield made
    made.close()


def until(is_so: Callable[[], bool], then: Callable[[], object] = lambda: None) -> None:
    end = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < end
        then()
        time.sleep(0.002)


def test_zero_velocity_arrives_however_soon_after_the_last_command(site: Site) -> None:
    """Nothing is sent after the zeros, so the last command to arrive is zero as soon as one of them does."""
    heard: RosMailbox[TwistStamped] = RosMailbox()
    site.robot().subscribe("cmd_vel", TwistStamped, heard)
    hardware = Hardware(site.member("r1"), DriveSettings(), 1.0, lambda _: None)
    ground = Terrain("t", np.ones((100, 100), dtype=np.bool_), 0.1)
    governor = Governor("differential", Limits(1.0, 0.3, 1.0), 1e6, 1e6, Fence(ground, 0.3, 0.1, 1e6))
    steering = VelocitySteering(hardware, governor, Others({}, {}, 0.5), Response(0.3, 0.0))
    fix = Fix(Pose(5.0, 5.0, 0.0), messages.Twist(0.0, 0.0, 0.0))

    def told() -> float:
        return 0.0 if heard.newest is None else heard.newest.message.twist.vx

    for _ in range(ENDINGS):
        steering.go_on()
        steering.want(Twist(0.5, 0.0), None, 0.0)
        until(lambda: told() == 0.5, lambda: steering.step(fix, 0.0, 0.05, ""))
        steering.halt()
        until(lambda: told() == 0.0)


def test_a_cancel_reaches_nav2_whoever_claims_to_be_its_server(site: Site) -> None:
    """Anybody on the robot may announce anything; a viewer may announce a node, and nothing that it has."""
    robot, agent, liar, viewer = site.robot(), site.member("r1"), site.robot("liar"), site.member("viewer")
    server, client = GoalServer(robot), GoalClient(agent)
    hashes = [f"RIHS01_{number:064x}" for number in range(3)]
    for who, link in (("liar", liar), ("viewer", viewer)):
        for number, claimed in enumerate(hashes):
            node, topic = NodeName(who, "robot1"), "/robot1/navigate_to_pose/_action/cancel_goal"
            token = Entity(0, "ab", 0, 90 + number, EntityKind.SERVER, node, topic, CANCEL, claimed).token
            link._declared.append(link._session.liveliness().declare_token(token))

    def work() -> None:
        server.step(time.time_ns())
        if client.step(time.monotonic()) is Going.FAILED:
            client.go(THERE, time.monotonic())

    def seen() -> set[tuple[str, str]]:
        servers = [one for one in robot.graph(PATIENCE_S) if one.kind is EntityKind.SERVER]
        return {(one.node.name, one.type_hash) for one in servers if one.type_name == CANCEL}

    client.go(THERE, time.monotonic())
    until(lambda: client.going is Going.UNDER_WAY, work)
    until(lambda: len(seen()) >= 1 + len(hashes))
    assert seen() == {("base", type_hash(CANCEL)), *(("liar", claimed) for claimed in hashes)}
    client.stop(time.monotonic())
    until(lambda: client.going is Going.STOPPED, work)
    assert server.target is None
