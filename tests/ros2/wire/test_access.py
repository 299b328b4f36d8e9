"""Under the lock: who can drive a ROS 2 robot over the network, and who can pass for it, at a real router."""

import threading
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import zenoh

from fogwatch.fleets.folder import ROBOT_ROUTER, FleetFolder, make_robot_router
from patrol.errors import BadInput
from patrol.pose import Pose
from ros2.doctor import examine, survey
from ros2.robot.localisation import LocalisationSettings, Source
from ros2.robot.options import DriveSettings
from ros2.wire.access import agent_rights, robot_router, viewer_rights
from ros2.wire.formats import Bridge, Format, RmwZenoh
from ros2.wire.goals import GoalClient, GoalServer, Going
from ros2.wire.link import ZenohRos2Link, open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import OccupancyGrid, Odometry, PoseStamped, TwistStamped
from ros2.wire.names import LATCHED, USUAL, EntityKind, NodeName, Qos
from runtime.net.link import LinkDown
from tests.present import present
from tests.ros2_site import M, Site, command, odometry, reach
from tests.routers import PATIENCE_S, make_local_fleet, needs_openssl

# Not the product's own, so that a wrong one there is noticed.
COMMAND_HZ = 100.0

pytestmark = needs_openssl

REFUSED_S = 2.0
"""Time for which a stranger without a certificate tries to get in."""
HERE = Pose(0.0, 0.0, 0.0)
GRID = OccupancyGrid(1, "map", 0.05, HERE, np.zeros((20, 30), np.int8))


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> FleetFolder:
    return make_local_fleet(tmp_path_factory.mktemp("fleet") / "f", ["r1", "r2"])


@pytest.fixture(params=[RmwZenoh(), RmwZenoh(4, hashed=False), Bridge()], ids=str)
def site(request: pytest.FixtureRequest, fleet: FleetFolder) -> Iterator[Site]:
    site = Site(fleet, request.param)
    yield site
    site.close()


def hear(link: ZenohRos2Link, topic: str, kind: type[M], qos: Qos = USUAL) -> RosMailbox[M]:
    """Subscribe to a topic."""
    mailbox: RosMailbox[M] = RosMailbox(1000)
    link.subscribe(topic, kind, mailbox, qos)
    return mailbox


def test_the_agent_drives_its_robot_and_shows_what_it_knows(site: Site) -> None:
    robot, agent = site.robot(), site.member("r1")
    commands, places = hear(robot, "cmd_vel", TwistStamped), hear(agent, "odom", Odometry)
    assert reach(agent.publisher("cmd_vel", TwistStamped), lambda: command(0.5), commands).twist.vx == 0.5
    assert reach(robot.publisher("odom", Odometry), lambda: odometry(3.0), places).pose.x == 3.0

    robot.publisher("/map", OccupancyGrid, LATCHED).send(GRID)
    agent.publisher("fog", OccupancyGrid, LATCHED).send(GRID)
    for link, topic in ((agent, "/map"), (site.robot("rviz"), "fog")):
        mailbox = hear(link, topic, OccupancyGrid, LATCHED)
        assert mailbox.take(PATIENCE_S) is not None, "who comes late gets what is latched"

    server, client = GoalServer(robot), GoalClient(agent)
    target = PoseStamped(1, "map", HERE)
    end = time.monotonic() + PATIENCE_S
    client.go(target, time.monotonic())
    while client.step(time.monotonic()) is not Going.UNDER_WAY:
        assert time.monotonic() < end
        server.step(time.time_ns())
        if client.going is Going.FAILED:
            client.go(target, time.monotonic())

    if site.form.attaches:
        for link, name, topic in ((robot, "fogwatch_r1", "/robot1/cmd_vel"), (agent, "base", "/robot1/odom")):
            seen = {(one.kind, one.node.name, one.topic) for one in link.graph(PATIENCE_S)}
            assert (EntityKind.PUBLISHER, name, topic) in seen


def test_a_stranger_gets_no_session(site: Site) -> None:
    with pytest.raises(LinkDown):
        open_ros2(site.outside, site.form, NodeName("stranger"), REFUSED_S)


@pytest.mark.parametrize("who", ["r2", "viewer", "operator", "r1"])
def test_nobody_else_drives_the_robot_and_nobody_passes_for_it(who: str, site: Site) -> None:
    """Not even other members; and what the agent may do does not include being the robot."""
    robot, agent, other = site.robot(), site.member("r1"), site.member(who)
    commands, places = hear(robot, "cmd_vel", TwistStamped), hear(agent, "odom", Odometry)
    forged = other.publisher("odom", Odometry)
    forged_commands = [] if who == "r1" else [other.publisher("cmd_vel", TwistStamped)]
    honest, honest_command = robot.publisher("odom", Odometry), agent.publisher("cmd_vel", TwistStamped)
    heard_places = heard_commands = 0
    end = time.monotonic() + PATIENCE_S
    while heard_places < 20 or heard_commands < 20:
        assert time.monotonic() < end
        forged.send(odometry(666.0))
        for forger in forged_commands:
            forger.send(command(6.0))
        honest.send(odometry(1.0))
        honest_command.send(command(1.0))
        if (place := places.take(0.02)) is not None:
            assert place.message.pose.x == 1.0
            heard_places += 1
        if (driven := commands.take(0.02)) is not None:
            assert driven.message.twist.vx == 1.0
            heard_commands += 1


def test_a_viewer_looks_and_others_do_not(site: Site) -> None:
    robot, viewer, other = site.robot(), site.member("viewer"), site.member("r2")
    seen, unseen = hear(viewer, "odom", Odometry), hear(other, "odom", Odometry)
    honest = robot.publisher("odom", Odometry)
    for _ in range(10):
        reach(honest, lambda: odometry(1.0), seen)
    assert unseen.received == 0
    assert {one.node.name for one in other.graph(PATIENCE_S)} <= {"fogwatch_r2"}


def test_the_doctor_sees_through_the_lock_with_the_agent_s_credentials(fleet: FleetFolder) -> None:
    with closing(Site(fleet, RmwZenoh())) as site:
        robot = site.robot()
        robot.subscribe("cmd_vel", TwistStamped, RosMailbox())
        robot.publisher("/map", OccupancyGrid, LATCHED).send(GRID)
        honest = robot.publisher("odom", Odometry)
        ended = threading.Event()

        def drive() -> None:
            while not ended.wait(0.02):
                honest.send(replace(odometry(1.0), stamp_ns=time.time_ns()))

        driving = threading.Thread(target=drive)
        driving.start()
        try:
            wanted = DriveSettings(localisation=LocalisationSettings(Source.ODOMETRY))
            topics = {"/robot1/odom", "/robot1/cmd_vel", "/map"}
            r1 = site.member("r1")
            end = time.monotonic() + PATIENCE_S
            while (
                not (found := examine(survey(r1, 0, "robot1", wanted, 0.5))).fit
                or {topic.name for topic in found.topics} != topics
            ):
                assert time.monotonic() < end, found
            blind = examine(survey(site.member("r2"), 0, "robot1", wanted, 0.5))
        finally:
            ended.set()
            driving.join()
        assert not blind.fit
        assert blind.topics == ()


def test_most_of_a_flood_does_not_pass_and_odometry_does(fleet: FleetFolder) -> None:
    with closing(Site(fleet, RmwZenoh())) as site:
        robot, nav2, agent = site.robot(), site.robot("nav2"), site.member("r1")
        places, commands = hear(nav2, "odom", Odometry), hear(robot, "cmd_vel", TwistStamped)
        honest, flood = robot.publisher("odom", Odometry), agent.publisher("cmd_vel", TwistStamped)
        began = time.monotonic()
        reach(flood, lambda: command(1.0), commands)
        for number in range(40):
            for _ in range(50):
                flood.send(command(1.0))
            while reach(honest, partial(odometry, float(number)), places).pose.x < number:
                pass
        assert commands.received <= COMMAND_HZ * (time.monotonic() - began) + 2


@pytest.mark.accept
def test_a_flood_and_one_who_does_not_read_cost_the_robot_nothing(fleet: FleetFolder) -> None:
    """On a quiet machine.

    The agent sends commands as fast as it can, and a viewer has stopped reading; the robot's own odometry arrives. How
    late is counted in messages, which are sent one at a time: when one is sent, the last but a few have arrived.
    """
    with closing(Site(fleet, RmwZenoh())) as site:
        robot, nav2, agent, viewer = site.robot(), site.robot("nav2"), site.member("r1"), site.member("viewer")
        places, commands = hear(nav2, "odom", Odometry), hear(robot, "cmd_vel", TwistStamped)
        honest, flood = robot.publisher("odom", Odometry), agent.publisher("cmd_vel", TwistStamped)
        reach(honest, lambda: odometry(-1.0), places)
        reach(flood, lambda: command(1.0), commands)
        stuck = viewer._session.declare_subscriber("0/robot1/odom/*/*", zenoh.handlers.FifoChannel(1))
        while places.take() is not None:
            pass
        behind, sent, arrived = [], 300, 0
        for number in range(sent):
            for _ in range(50):
                flood.send(command(1.0))
            honest.send(odometry(float(number)))
            while (place := places.take(0.01)) is not None and place.message.pose.x < number:
                arrived += 1
            arrived += place is not None
            behind.append(number - present(places.newest).message.pose.x)
        while places.take(0.5) is not None:
            arrived += 1
        # A machine that stands still for a while loses some; who gave way to the flood would lose nearly all.
        assert arrived >= sent / 2
        assert sorted(behind)[sent // 2] <= 5.0, behind
        assert commands.received < 50 * sent / 5, "most of the flood does not pass"
        stuck.undeclare()  # type: ignore[no-untyped-call]


def test_rights_are_as_narrow_as_they_can_be() -> None:
    agent, viewer = agent_rights(RmwZenoh(3), "xavier"), viewer_rights(RmwZenoh(3), "xavier")
    assert {"3/xavier/cmd_vel/*/*", "3/xavier/initialpose/*/*"} <= set(agent.publish)
    assert not any("odom" in key or "tf" in key for key in agent.publish)
    assert "3/xavier/fog/*/*/@adv/**" in agent.answer
    assert "3/xavier/navigate_to_pose/_action/*/*/*" in agent.ask
    assert agent.hear == ("3/xavier/**", "3/tf/*/*", "3/tf_static/*/*", "3/map/*/*", "3/clock/*/*")
    assert all(key.startswith("@ros2_lv/3/") or "/@adv/" in key for key in (*agent.announce, *agent.watch))
    assert (viewer.publish, viewer.answer) == ((), ())
    assert all("/@adv/" in key for key in viewer.ask)
    assert agent_rights(Bridge(), "").hear[0] == "**"
    bridged = agent_rights(Bridge(), "robot1")
    assert bridged.announce == tuple(f"{key}/@adv/**" for key in bridged.publish)


@pytest.mark.parametrize("form", [RmwZenoh(), RmwZenoh(4, hashed=False), Bridge()], ids=str)
def test_one_rule_alone_makes_a_command_rare(form: Format) -> None:
    """Zenoh's issue 2200: of several rules of downsampling for a key, any one may hold."""
    commands = ("cmd_vel", "ackermann_cmd", "cmd_vel/stamped", "base/cmd_vel")
    (item,) = robot_router(form, "robot1", {}, [], {}, commands)["downsampling"]
    keys = [zenoh.KeyExpr(rule["key_expr"]) for rule in item["rules"]]
    assert len(keys) == len(commands)
    assert not any(one.intersects(other) for one, other in combinations(keys, 2))


def test_a_robot_that_is_no_member_has_no_router(fleet: FleetFolder) -> None:
    with pytest.raises(BadInput, match="r9: is no robot of f; add it with: fogwatch fleet add"):
        make_robot_router(fleet, "r9", RmwZenoh(), "", [], 7448, None, 1)


def test_only_its_owner_can_read_a_router_s_folder(fleet: FleetFolder) -> None:
    folder = make_robot_router(fleet, "r2", RmwZenoh(), "", ["192.0.2.1"], 7448, Path("/etc/fogwatch/r2-router"), 1)
    text = (folder / ROBOT_ROUTER).read_text(encoding="utf-8")
    for words in ("/etc/fogwatch/r2-router/key.pem", "tcp/127.0.0.1:7447", "tls/0.0.0.0:7448"):
        assert f'"{words}"' in text
    for path in (folder, folder / ROBOT_ROUTER, folder / "key.pem"):
        assert not path.stat().st_mode & 0o077
