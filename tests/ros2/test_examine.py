from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from patrol.pose import Pose
from ros2.doctor import Examined, Level, Survey, examine
from ros2.robot.localisation import LocalisationSettings, Source
from ros2.robot.options import DriveSettings
from ros2.wire import messages as ros
from ros2.wire.codec import CODINGS, encode
from ros2.wire.formats import Bridge, Format, RmwZenoh
from ros2.wire.mailbox import Overheard
from ros2.wire.names import USUAL, Entity, EntityKind, NodeName

NOW_NS = 1_700_000_000_000_000_000
ODOMETRY = ros.Odometry(NOW_NS, "odom", "base_link", Pose(0.0, 0.0, 0.0), ros.Twist(0.0, 0.0, 0.0))
PLACE = ros.TFMessage((ros.Transform(NOW_NS, "map", "odom", Pose(0.0, 0.0, 0.0)),))
PLACED = ros.PoseWithCovarianceStamped(NOW_NS, "map", Pose(0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
MAP = ros.OccupancyGrid(NOW_NS, "map", 0.05, Pose(0.0, 0.0, 0.0), np.zeros((2, 2), np.int8))
COMMAND = ros.TwistStamped(NOW_NS, "base_link", ros.Twist(0.0, 0.0, 0.0))


class Robot:
    """A robot as a survey sees it, piece by piece."""

    def __init__(self, form: Format, namespace: str = "robot1") -> None:
        self.form = form
        self.seen = Survey(form.domain, namespace, DriveSettings())

    def sends(self, topic: str, message: object, rate: float = 20.0, age_s: float = 0.001, senders: int = 1) -> Robot:
        payload = encode(message)
        heard = Overheard(0.0, 1.0, 1 + round(rate), len(payload))
        heard.newest = payload
        heard.recent.append((NOW_NS, payload))
        if self.form.attaches:
            heard.age_ns = round(age_s * 1e9)
            heard.senders = {bytes([number]) * 16 for number in range(senders)}
        self.seen.heard[self.form.key(topic, CODINGS[type(message)].type_name)] = heard
        return self

    def has(self, kind: EntityKind, topic: str, type_name: str, type_hash: str = "") -> Robot:
        type_hash = type_hash or self.form.hash_of(type_name)
        if isinstance(self.form, Bridge):
            name, inside = (part.replace("/", "§") for part in (topic.strip("/"), type_name))
            self.seen.tokens.append(f"@/abc/@ros2_lv/{kind}/{name}/{inside}/::")
        else:
            entity = Entity(self.form.domain, "abc", 0, 1, kind, NodeName("base"), topic, type_name, type_hash, USUAL)
            self.seen.tokens.append(entity.token)
        return self

    def whole(self) -> Robot:
        """A robot that lacks nothing."""
        self.sends("/robot1/odom", ODOMETRY).sends("/tf", PLACE).sends("/map", MAP, rate=0.0)
        return self.has(EntityKind.SUBSCRIPTION, "/robot1/cmd_vel", "geometry_msgs/msg/TwistStamped")

    def examined(self) -> Examined:
        return examine(self.seen)


def located_by(source: Source, map_frame: str = "map") -> DriveSettings:
    return DriveSettings(localisation=LocalisationSettings(source, map_frame))


def says(found: Examined, level: Level) -> str:
    return "\n".join(f"{one.says}; {one.remedy}" for one in found.findings if one.level is level)


@pytest.mark.parametrize(
    ("form", "option"),
    [(RmwZenoh(), "rmw_zenoh"), (RmwZenoh(4, hashed=False), "rmw_zenoh-humble"), (Bridge(), "bridge")],
)
def test_a_robot_that_lacks_nothing(form: Format, option: str) -> None:
    found = Robot(form).whole().examined()
    assert found.fit
    assert not says(found, Level.WARNING)
    assert f"the robot speaks {option};" in says(found, Level.OK)
    assert "the robot obeys geometry_msgs/msg/TwistStamped" in says(found, Level.OK)
    assert {topic.name for topic in found.topics} == {"/robot1/odom", "/tf", "/map", "/robot1/cmd_vel"}
    (odometry,) = [topic for topic in found.topics if topic.name == "/robot1/odom"]
    assert (odometry.rate, odometry.size, odometry.frames) == (20.0, 724, ("odom -> base_link",))


def test_an_empty_router() -> None:
    found = Robot(RmwZenoh()).examined()
    assert not found.fit
    assert "nothing of ROS 2 is on this router in domain 0; start rmw_zenohd" in says(found, Level.MISSING)


def test_another_domain_and_another_namespace_are_named() -> None:
    other = Robot(RmwZenoh(7)).whole()
    other.seen.domain = 0
    other.seen.heard.clear()
    assert "there is a robot in domain 7: give --domain 7" in says(other.examined(), Level.MISSING)
    elsewhere = Robot(RmwZenoh()).whole()
    elsewhere.seen.namespace = "robot2"
    elsewhere.seen.heard = {key: heard for key, heard in elsewhere.seen.heard.items() if "odom" not in key}
    assert "no robot is in the namespace /robot2; give --namespace robot1" in says(elsewhere.examined(), Level.MISSING)


def test_topics_of_other_names_are_named() -> None:
    robot = Robot(RmwZenoh())
    robot.has(EntityKind.PUBLISHER, "/robot1/base/odometry", "nav_msgs/msg/Odometry")
    robot.has(EntityKind.SUBSCRIPTION, "/robot1/base/cmd_vel_out", "geometry_msgs/msg/Twist").sends("/tf", PLACE)
    robot.has(EntityKind.SUBSCRIPTION, "/robot1/cmd_vel", "std_msgs/msg/String")
    found = robot.examined()
    assert "no odometry comes on /robot1/odom; give --topic odom=/robot1/base/odometry" in says(found, Level.MISSING)
    assert "/robot1/cmd_vel: the robot wants std_msgs/msg/String, which we do not send" in says(found, Level.MISSING)
    robot.seen.tokens.pop()
    expected = "nobody obeys commands on /robot1/cmd_vel; give --topic cmd_vel=/robot1/base/cmd_vel_out"
    robot.sends("/robot1/odom", ODOMETRY)
    assert expected in says(robot.examined(), Level.MISSING)


def test_nav2_is_enough_to_be_sent_somewhere() -> None:
    robot = Robot(RmwZenoh()).sends("/robot1/odom", ODOMETRY).sends("/tf", PLACE).sends("/map", MAP)
    robot.has(EntityKind.PUBLISHER, "/robot1/odom", "nav_msgs/msg/Odometry")
    assert not robot.examined().fit
    server = "nav2_msgs/action/NavigateToPose_SendGoal"
    found = robot.has(EntityKind.SERVER, "/robot1/navigate_to_pose/_action/send_goal", server).examined()
    assert found.fit
    assert "Nav2 takes goals" in says(found, Level.OK)


def test_a_hash_of_other_fields_is_said() -> None:
    robot = Robot(RmwZenoh()).whole()
    (key,) = [key for key in robot.seen.heard if "odom" in key]
    robot.seen.heard[f"{key[:-4]}beef"] = robot.seen.heard.pop(key)
    found = robot.examined()
    assert "/robot1/odom: messages cannot be used: its hash is RIHS01_" in says(found, Level.WARNING)
    assert "no odometry comes on /robot1/odom" in says(found, Level.MISSING)


def test_slow_doubled_and_rival_topics_are_warned_of() -> None:
    robot = Robot(RmwZenoh()).whole().sends("/robot1/odom", ODOMETRY, rate=2.0, senders=2)
    found = robot.sends("/robot1/cmd_vel", COMMAND, rate=9.0).examined()
    assert not found.fit
    warned = says(found, Level.WARNING)
    assert "/robot1/odom: 2.0 messages a second; fewer than 5" in warned
    assert "/robot1/odom: 2 publish it" in says(found, Level.MISSING)
    assert "/robot1/cmd_vel: somebody else sends commands, 10 while we listened" in warned


def test_a_robot_without_a_map_can_patrol_and_one_without_a_place_cannot() -> None:
    robot = Robot(RmwZenoh()).sends("/robot1/odom", ODOMETRY)
    robot.has(EntityKind.SUBSCRIPTION, "/robot1/cmd_vel", "geometry_msgs/msg/Twist")
    found = robot.examined()
    assert "there is no latched map; give the agent a map's file with --map" in says(found, Level.WARNING)
    assert "nothing says where the robot is on the map: no map -> odom on tf, and no pose" in says(found, Level.MISSING)
    robot.seen.wanted = located_by(Source.ODOMETRY)
    assert robot.examined().fit
    robot.sends("/robot1/amcl_pose", PLACED)
    assert robot.examined().fit
    robot.seen.wanted = DriveSettings()
    assert "but not by --localisation tf; give --localisation pose" in says(robot.examined(), Level.MISSING)
    robot.seen.wanted = located_by(Source.POSE)
    assert robot.examined().fit
    robot.seen.wanted = located_by(Source.POSE, "site")
    assert "and poses in the frame map alone; have it give them in site" in says(robot.examined(), Level.MISSING)
    elsewhere = ros.TFMessage((ros.Transform(NOW_NS, "map", "robot2/odom", Pose(0.0, 0.0, 0.0)),))
    robot.sends("/tf", elsewhere).seen.wanted = DriveSettings()
    assert not robot.examined().fit


@pytest.mark.parametrize("payload", [b"", b"\0", b"\x00\x01\x00\x00\x1b[2J"])
@pytest.mark.parametrize("form", [RmwZenoh(), Bridge()], ids=str)
def test_nonsense_in_messages_is_said_and_printable(form: Format, payload: bytes) -> None:
    robot = Robot(form).whole()
    (heard,) = [heard for key, heard in robot.seen.heard.items() if "odom" in key]
    heard.newest = payload
    found = robot.examined()
    assert "/robot1/odom: messages cannot be used: " in says(found, Level.WARNING)
    assert "no odometry comes on /robot1/odom" in says(found, Level.MISSING)
    assert not found.fit
    robot.seen.tokens.append("@ros2_lv/0/\x1b[2J/0/1/MS/%/%/n/%robot1%cmd_vel/\x1b[2J/x/::,10:,:,:,,")
    for one in robot.examined().findings:
        assert f"{one.says}{one.remedy}".isprintable()


def test_a_message_that_is_too_long_to_keep_is_left_out() -> None:
    robot = Robot(Bridge()).whole()
    (heard,) = [heard for key, heard in robot.seen.heard.items() if key.endswith("map")]
    heard.newest = None
    heard.recent.clear()
    assert robot.examined().fit


def arrive(heard: Overheard, age_s: float) -> None:
    """Have what is recent arrive so much later than its stamps say."""
    at_ns = NOW_NS + round(age_s * 1e9)
    heard.recent = deque((at_ns, payload) for _, payload in heard.recent)


def test_odometry_that_was_held_up_once_is_not_old() -> None:
    robot = Robot(RmwZenoh()).whole()
    (heard,) = [heard for key, heard in robot.seen.heard.items() if "/odom/" in key]
    heard.recent.append((NOW_NS + 2_000_000_000, heard.recent[0][1]))
    assert robot.examined().fit


@pytest.mark.parametrize("form", [RmwZenoh(), Bridge()], ids=str)
@pytest.mark.parametrize(
    ("age_s", "words"),
    [
        (2.5, "the stamps of odometry are 2.50 s behind our clock"),
        (-0.2, "the stamps of odometry are 0.20 s ahead of our clock"),
        (1.7e9, "the stamps of odometry are of another day; where the robot runs on simulated time"),
    ],
)
def test_stamps_that_an_agent_would_not_take_are_missing(form: Format, age_s: float, words: str) -> None:
    robot = Robot(form).whole()
    for heard in robot.seen.heard.values():
        arrive(heard, age_s)
    assert words in says(robot.examined(), Level.MISSING)
    robot.seen.wanted = DriveSettings(sim_time=True)
    assert "no time comes on /clock; start the simulation" in says(robot.examined(), Level.MISSING)
    robot.sends("/clock", ros.Clock(NOW_NS))
    assert robot.examined().fit


@pytest.mark.parametrize(
    ("age_s", "found"),
    [
        (0.1, [(Level.OK, "agrees with ours (100 ms)")]),
        (0.11, [(Level.WARNING, "is 0.11 s behind ours")]),
        (-0.1, [(Level.OK, "agrees with ours (-100 ms)")]),
        (-0.11, [(Level.WARNING, "is 0.11 s ahead of ours")]),
        (86400.0, [(Level.WARNING, "is 86400.00 s behind ours")]),
        (86401.0, []),  # the robot's time is that of a simulation
        (-86401.0, []),
    ],
)
def test_clocks_may_differ_by_a_tenth_of_a_second_and_simulated_ones_by_more_than_a_day(
    age_s: float, found: list[tuple[Level, str]]
) -> None:
    robot = Robot(RmwZenoh())
    for topic, message in (("/robot1/odom", ODOMETRY), ("/tf", PLACE), ("/map", MAP)):
        robot.sends(topic, message, age_s=age_s)
    said = [(one.level, one.says.partition("the robot's clock ")[2]) for one in robot.examined().findings]
    assert [(level, words.partition(",")[0]) for level, words in said if words] == found


@pytest.mark.parametrize(("rate", "is_few"), [(4.0, True), (5.0, False)])
def test_odometry_is_few_below_five_messages_a_second(rate: float, is_few: bool) -> None:
    robot = Robot(RmwZenoh()).whole().sends("/robot1/odom", ODOMETRY, rate=rate)
    assert ("fewer than 5 are few" in says(robot.examined(), Level.WARNING)) is is_few


def test_a_bridge_has_no_clock_but_in_its_stamps() -> None:
    robot = Robot(Bridge()).whole()
    arrive(robot.seen.heard["robot1/odom"], 3.0)
    found = robot.examined()
    assert found.clock_s == 3.0
    assert "3.00 s behind ours" in says(found, Level.WARNING)
