import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from patrol.pose import Pose
from ros2.wire.formats import Bridge, Format, RmwZenoh
from ros2.wire.goals import GoalClient, GoalServer, Going, Status
from ros2.wire.link import ZenohRos2Link, open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import CancelResponse, GoalStatusArray, PoseStamped
from ros2.wire.names import LATCHED, NodeName
from tests.present import present
from tests.ros2_hub import Hub
from tests.routers import PATIENCE_S, routed

# Not the product's own, so that a wrong one there is noticed.
ACCEPT_S = 5.0
CANCEL_S = 0.25

THERE = PoseStamped(1, "map", Pose(3.0, 4.0, 0.0))
ELSEWHERE = PoseStamped(1, "map", Pose(-3.0, 4.0, 0.0))
SENDS, CANCELS = (f"/robot1/navigate_to_pose/_action/{service}" for service in ("send_goal", "cancel_goal"))


class Pair:
    """A robot and its clients, whose clock goes on when it is told to: nothing is given up for being slow."""

    def __init__(self, robot: ZenohRos2Link, us: ZenohRos2Link) -> None:
        self.robot, self.us = robot, us
        self.now_s = 100.0
        self.server, self.client = GoalServer(robot), GoalClient(us)
        self.other = GoalClient(us)

    def until(self, what: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not what():
            assert time.monotonic() < end, (self.client.going, self.server.target)
            self.server.step(time.time_ns())
            self.client.step(self.now_s)
            self.other.step(self.now_s)

    def send(self, target: PoseStamped) -> None:
        """Send the robot somewhere until it has heard of it: its services take a moment to be known."""
        end = time.monotonic() + PATIENCE_S
        while self.server.target != target:
            assert time.monotonic() < end
            self.client.go(target, self.now_s)
            began = time.monotonic()
            while self.server.target != target and time.monotonic() - began < 0.5:
                self.server.step(time.time_ns())
        self.until(lambda: self.client.going is Going.UNDER_WAY)


@pytest.fixture(params=[RmwZenoh(), RmwZenoh(3, hashed=False), Bridge()], ids=str)
def pair(request: pytest.FixtureRequest) -> Iterator[Pair]:
    form: Format = request.param
    with routed() as where:
        links = [open_ros2(where, form, NodeName(name, "robot1"), PATIENCE_S) for name in ("robot", "fogwatch")]
        yield Pair(*links)
        for link in links:
            assert link.close(PATIENCE_S)


def test_a_robot_goes_where_it_is_sent(pair: Pair) -> None:
    statuses: RosMailbox[GoalStatusArray] = RosMailbox()
    pair.send(THERE)
    pair.us.subscribe("navigate_to_pose/_action/status", GoalStatusArray, statuses, LATCHED)
    pair.server.feedback(ELSEWHERE, 1.0, 2.0)
    pair.server.finish(Status.SUCCEEDED)
    pair.until(lambda: pair.client.going is Going.THERE)
    assert pair.server.target is None
    pair.until(lambda: statuses.newest is not None and statuses.newest.message.goals[-1][1] == Status.SUCCEEDED)


def test_a_new_goal_takes_the_place_of_the_last_one(pair: Pair) -> None:
    pair.send(THERE)
    pair.other.go(ELSEWHERE, pair.now_s)
    pair.until(lambda: pair.client.going is Going.FAILED and pair.other.going is Going.UNDER_WAY)
    assert pair.server.target == ELSEWHERE


def test_stop_cancels_every_goal(pair: Pair) -> None:
    pair.send(THERE)
    pair.other.stop(pair.now_s)
    assert pair.other.going is Going.STOPPING
    pair.until(lambda: pair.server.target is None)
    pair.until(lambda: pair.client.going is Going.FAILED)
    pair.until(lambda: pair.other.going is Going.STOPPED)


def in_hub() -> tuple[Hub, GoalServer, GoalClient]:
    """A robot and its client without a router between them."""
    hub = Hub()
    return hub, GoalServer(hub.link("robot", "robot1")), GoalClient(hub.link("fogwatch", "robot1"))


def test_a_cancel_that_is_lost_is_sent_again() -> None:
    hub, server, client = in_hub()
    client.go(THERE, 100.0)
    assert server.step(0) == THERE
    cancels = hub.services.pop(CANCELS)
    client.stop(100.0)
    hub.services[CANCELS] = cancels
    assert client.step(100.0) is Going.STOPPING
    assert client.step(100.0 + CANCEL_S) is Going.STOPPING
    assert server.step(0) is None
    assert client.step(100.0 + CANCEL_S) is Going.STOPPED


def test_a_goal_that_is_accepted_after_a_cancel_is_cancelled_too() -> None:
    hub, server, client = in_hub()
    goals, late = hub.services[SENDS], RosMailbox[Any]()
    hub.services[SENDS] = late
    client.go(THERE, 100.0)
    client.stop(100.0)
    assert server.step(0) is None  # the request has overtaken the goal, and finds nothing to cancel
    assert client.step(100.1) is Going.STOPPING
    goals.put(present(late.take()))
    assert server.step(0) == THERE
    assert client.step(100.2 + CANCEL_S) is Going.STOPPING
    assert server.step(0) is None
    assert client.step(100.3 + CANCEL_S) is Going.STOPPED


def test_a_cancel_that_is_refused_is_sent_again() -> None:
    hub, _, client = in_hub()
    asked = hub.services[CANCELS] = RosMailbox[Any]()
    client.stop(100.0)
    for number in range(3):
        present(asked.take()).message.answer(CancelResponse(1))
        assert client.step(100.0 + (number + 1) * CANCEL_S) is Going.STOPPING


def test_a_goal_that_nobody_accepts_has_failed() -> None:
    client = GoalClient(Hub().link("fogwatch", "robot1"))
    client.go(THERE, 100.0)
    assert client.step(100.0 + ACCEPT_S) is Going.ASKED
    assert client.step(100.1 + ACCEPT_S) is Going.FAILED
