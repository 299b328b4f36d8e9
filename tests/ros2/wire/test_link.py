import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
import pytest

from patrol.errors import Malformed
from patrol.pose import Pose
from ros2.wire.definitions import CANCEL_GOAL
from ros2.wire.formats import Bridge, Format, RmwZenoh
from ros2.wire.link import RouterSays, ZenohRos2Link, open_ros2, router_says
from ros2.wire.mailbox import Received, RosMailbox
from ros2.wire.messages import Bool, CancelRequest, CancelResponse, OccupancyGrid, Odometry, Twist, TwistStamped
from ros2.wire.names import LATCHED, USUAL, EntityKind, NodeName, Qos
from ros2.wire.ports import Asked, Sender, Service
from runtime.net.link import LinkDown, open_link, open_router
from tests.present import present
from tests.routers import PATIENCE_S, free_endpoint

M = TypeVar("M")
Join = Callable[..., ZenohRos2Link]

FORMATS = [RmwZenoh(), RmwZenoh(7, hashed=False), Bridge()]
CANCEL = Service(CANCEL_GOAL, CancelRequest, CancelResponse)
AHEAD = TwistStamped(1_700_000_000_000_000_000, "base_link", Twist(1.0, 0.0, 0.5))


@pytest.fixture
def join(endpoint: str) -> Iterator[Join]:
    made: list[ZenohRos2Link] = []

    def joined(form: Format, name: str = "fogwatch", namespace: str = "robot1") -> ZenohRos2Link:
        made.append(open_ros2(endpoint, form, NodeName(name, namespace), PATIENCE_S))
        return made[-1]

    yield joined
    for link in made:
        assert link.close(PATIENCE_S)


def hear(link: ZenohRos2Link, topic: str, kind: type[M], qos: Qos = USUAL) -> RosMailbox[M]:
    """Subscribe to a topic."""
    mailbox: RosMailbox[M] = RosMailbox()
    link.subscribe(topic, kind, mailbox, qos)
    return mailbox


def reach(sender: Sender[M], message: M, mailbox: RosMailbox[Any]) -> Received[Any]:
    """Send until it arrives, since a subscription takes a moment to be known."""
    end = time.monotonic() + PATIENCE_S
    while (received := mailbox.take(0.05)) is None:
        assert time.monotonic() < end
        sender.send(message)
    return received


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_what_is_sent_arrives_whole(form: Format, join: Join) -> None:
    mailbox = hear(join(form, "robot"), "cmd_vel", TwistStamped)
    sender = join(form).publisher("cmd_vel", TwistStamped)
    began_ns = time.time_ns()
    received = reach(sender, AHEAD, mailbox)
    assert received.message == AHEAD
    assert began_ns - 1_000_000 <= present(received.sent_ns) <= time.time_ns() + 1_000_000
    if form.attaches:
        assert present(received.sequence) >= 1
        assert len(received.sender) == 16
    else:
        assert (received.sequence, received.sender) == (None, b"")


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_who_comes_late_gets_what_was_latched_and_who_was_there_gets_what_comes_late(form: Format, join: Join) -> None:
    robot, us = join(form, "robot"), join(form)
    early = hear(us, "/map", OccupancyGrid, LATCHED)
    cells = np.arange(12, dtype=np.int8).reshape(3, 4)
    robot.publisher("/map", OccupancyGrid, LATCHED).send(OccupancyGrid(1, "map", 0.05, Pose(1.0, 2.0, 0.0), cells))
    for mailbox in (early, hear(us, "/map", OccupancyGrid, LATCHED)):
        received = present(mailbox.take(PATIENCE_S))
        assert received.message.resolution == 0.05
        np.testing.assert_array_equal(received.message.cells, cells)


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_a_service_answers_whoever_asks(form: Format, join: Join) -> None:
    robot, us = join(form, "robot"), join(form)
    asked: RosMailbox[Asked[CancelRequest, CancelResponse]] = RosMailbox(8)
    robot.serve("go/_action/cancel_goal", CANCEL, asked)
    identity = bytes(range(16))
    end = time.monotonic() + PATIENCE_S
    while True:
        answers = us.call("go/_action/cancel_goal", CANCEL, CancelRequest(identity), PATIENCE_S)
        if (question := asked.take(0.2)) is not None:
            break
        assert time.monotonic() < end
    assert question.message.request == CancelRequest(identity)
    question.message.answer(CancelResponse(0, (identity,)))
    answer = present(answers.take(PATIENCE_S))
    assert answer.message == CancelResponse(0, (identity,))
    assert (answer.sequence, answer.sender) == (question.sequence, question.sender)


def test_the_graph_shows_nodes_and_what_they_have(join: Join) -> None:
    robot, us = join(RmwZenoh(), "robot"), join(RmwZenoh())
    robot.publisher("odom", Odometry)
    us.subscribe("odom", Odometry, RosMailbox())
    us.publisher("stop", Bool, LATCHED)
    other = join(RmwZenoh(5), "stranger")
    wanted = {
        (EntityKind.NODE, "robot", ""),
        (EntityKind.NODE, "fogwatch", ""),
        (EntityKind.PUBLISHER, "robot", "/robot1/odom"),
        (EntityKind.SUBSCRIPTION, "fogwatch", "/robot1/odom"),
        (EntityKind.PUBLISHER, "fogwatch", "/robot1/stop"),
    }
    end = time.monotonic() + PATIENCE_S
    while {(one.kind, one.node.name, one.topic) for one in us.graph(PATIENCE_S)} != wanted:
        assert time.monotonic() < end
    assert {one.domain for one in us.graph(PATIENCE_S)} == {0}
    assert {one.node.name for one in other.graph(PATIENCE_S)} == {"stranger"}
    (stop,) = [one for one in us.graph(PATIENCE_S) if one.topic.endswith("stop")]
    assert stop.type_name == "std_msgs/msg/Bool"


def test_formats_and_domains_do_not_understand_each_other(join: Join) -> None:
    mailboxes = [hear(join(form, "robot"), "cmd_vel", TwistStamped) for form in (RmwZenoh(1), Bridge())]
    right = hear(join(RmwZenoh(), "right"), "cmd_vel", TwistStamped)
    reach(join(RmwZenoh()).publisher("cmd_vel", TwistStamped), AHEAD, right)
    assert [mailbox.received for mailbox in mailboxes] == [0, 0]


@pytest.mark.parametrize("hashed", [True, False])
def test_a_robot_with_hashes_and_one_without_hear_each_other_s_topics(hashed: bool, join: Join) -> None:
    """Subscriptions take both, so that a robot's release matters for what we send alone."""
    mailbox = hear(join(RmwZenoh(hashed=hashed)), "cmd_vel", TwistStamped)
    assert reach(join(RmwZenoh(hashed=not hashed)).publisher("cmd_vel", TwistStamped), AHEAD, mailbox).message == AHEAD


def test_another_type_is_refused_and_said(join: Join) -> None:
    mailbox, robot = hear(join(RmwZenoh()), "cmd_vel", TwistStamped), join(RmwZenoh(), "robot")
    wrong, right = robot.publisher("cmd_vel", Twist), robot.publisher("cmd_vel", TwistStamped)
    reach(right, AHEAD, mailbox)
    wrong.send(Twist(1.0, 0.0, 0.0))
    end = time.monotonic() + PATIENCE_S
    while not mailbox.refused["type"]:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert mailbox.refused == {"type": 1}
    reach(right, AHEAD, mailbox)
    expected = "/robot1/cmd_vel: is a geometry_msgs/msg/Twist, and should be a geometry_msgs/msg/TwistStamped"
    assert mailbox.said["type"] == expected


def test_what_is_no_number_is_never_sent(join: Join) -> None:
    mailbox = hear(join(RmwZenoh(), "robot"), "cmd_vel", Twist)
    sender = join(RmwZenoh()).publisher("cmd_vel", Twist)
    reach(sender, Twist(1.0, 0.0, 0.0), mailbox)
    for bad in (float("nan"), float("inf"), -1e300):
        with pytest.raises(Malformed):
            sender.send(Twist(bad, 0.0, 0.0))
    reach(sender, Twist(2.0, 0.0, 0.0), mailbox)
    assert not mailbox.refused


def test_a_link_finds_back_to_a_router_that_returns_with_all_that_it_has() -> None:
    where = free_endpoint()
    router = open_router(where)
    us = open_ros2(where, RmwZenoh(), NodeName("fogwatch", "robot1"), PATIENCE_S)
    robot = open_ros2(where, RmwZenoh(), NodeName("robot", "robot1"), PATIENCE_S)
    commands = hear(robot, "cmd_vel", TwistStamped)
    sender = us.publisher("cmd_vel", TwistStamped)
    ground = OccupancyGrid(1, "map", 0.05, Pose(0.0, 0.0, 0.0), np.zeros((2, 2), np.int8))
    us.publisher("fog", OccupancyGrid, LATCHED).send(ground)
    reach(sender, AHEAD, commands)
    assert router.close(PATIENCE_S)
    end = time.monotonic() + PATIENCE_S
    while us.router(PATIENCE_S) or robot.router(PATIENCE_S):
        assert time.monotonic() < end
        sender.send(AHEAD)  # goes nowhere, and holds up nobody
    while commands.take() is not None:
        pass
    router = open_router(where)
    reach(sender, AHEAD, commands)
    assert hear(robot, "fog", OccupancyGrid, LATCHED).take(PATIENCE_S) is not None
    ours = {("fogwatch", ""), ("fogwatch", "/robot1/cmd_vel")}
    while not ours <= {(one.node.name, one.topic) for one in robot.graph(PATIENCE_S)}:
        assert time.monotonic() < end
    for closing in (us, robot):
        assert closing.close(PATIENCE_S)
    assert router.close(PATIENCE_S)


def test_a_router_that_never_comes_is_given_up() -> None:
    with pytest.raises(LinkDown, match="no router answers at"):
        open_ros2(free_endpoint(), RmwZenoh(), NodeName("fogwatch"), 0.3)


def test_huge_and_malformed_messages_are_refused_and_the_next_is_heard(join: Join, endpoint: str) -> None:
    mailbox = hear(join(RmwZenoh()), "cmd_vel", TwistStamped)
    sender = join(RmwZenoh(), "robot").publisher("cmd_vel", TwistStamped)
    reach(sender, AHEAD, mailbox)
    raw = open_link(endpoint, PATIENCE_S)
    post = raw.post(RmwZenoh().key("/robot1/cmd_vel", "geometry_msgs/msg/TwistStamped"))
    other = raw.post("0/robot1/cmd_vel/geometry_msgs::msg::dds_::TwistStamped_/RIHS01_beef")
    for payload in (bytes(3_000_000), b"", b"\x00\x01\x00\x00", b"\xff" * 76):
        post(payload)
    other(bytes(76))
    end = time.monotonic() + PATIENCE_S
    while sum(mailbox.refused.values()) < 5:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert dict(mailbox.refused) == {"oversized": 1, "malformed": 3, "hash": 1}
    assert set(mailbox.said) == set(mailbox.refused)
    assert "has other fields there: its hash is RIHS01_beef, and ours RIHS01_5f0f" in mailbox.said["hash"]
    assert all(line.isprintable() for line in mailbox.said.values())
    assert reach(sender, AHEAD, mailbox).message == AHEAD
    assert raw.close(PATIENCE_S)


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (b'{"version": "v1.5.0-abc built", "sessions": [{"peer": "a"}, {"peer": "b"}]}', RouterSays("v1.5.0", 1)),
        (b'{"version": "\\u001b[2J", "sessions": []}', RouterSays("\\x1b[2J", 0)),
        *((b'{"version": %b, "sessions": []}' % version, None) for version in (b"1", b'["v1"]')),
        *((b'{"version": "v1", "sessions": %b}' % listed, None) for listed in (b'{"peer": 1}', b"[{}]", b"3")),
        *((answer, None) for answer in (b'{"version": "v1"}', b'"v1"', b"[" * 100_000, b"\xff", b"")),
    ],
)
def test_whatever_answers_in_a_router_s_place_is_read_safely(answer: bytes, says: RouterSays | None) -> None:
    assert router_says(answer, "a") == says
