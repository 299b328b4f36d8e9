"""Points that a robot has missed of its part of the plan: it goes there in time."""

from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from agent.policies.common_plan.missed import OVERDUE, Missed
from agent.policies.pursuit import GivenUp, Target
from patrol.pose import Pose
from tests.agent.plans import plan, prepared_in

INTERVAL = 100
"""Ticks between two robots on the tour."""


class Scene:
    """A robot in a room of 10 x 10 m; a test says what the plan's robot sees, and what the true one has seen."""

    def __init__(self) -> None:
        ready = prepared_in(plan((10.0, 10.0), (0.0, 0.0, 10.0, 10.0)), [Pose(5.0, 5.0, 0.0)], {"radius": 0.3})
        self.terrain, fields = ready.terrain, ready.fields[1]
        self.last_seen = np.zeros(self.terrain.shape, dtype=np.int32)
        self.planned = np.zeros(self.terrain.shape, dtype=np.int32)
        self.shown: dict[int, list[int]] = {}  # points in view of the plan's robot, by tick
        common: Any = SimpleNamespace(since=0, interval_s=0.5 * INTERVAL, step=0.5, last_seen=self.planned)
        self.others: set[int] = set()  # points that another planned robot has seen last
        common.seen_by_others = lambda _number, points: np.isin(points, sorted(self.others))
        common.seen_by = lambda _number, tick: np.array(self.shown.get(tick, []), dtype=np.int64)
        robot = SimpleNamespace(spec=SimpleNamespace(number=1))
        setup: Any = SimpleNamespace(ground=SimpleNamespace(fields=fields, terrain=self.terrain), robot=robot)
        self.missed, self.given_up = Missed(setup), GivenUp(0.3, self.terrain.point, 0.5)
        self.common = common
        self.missed.take_up(common, 0)

    def point(self, x: float, y: float) -> int:
        row, col = self.terrain.point_at(x, y)
        return row * self.terrain.width + col

    def view(self, tick: int) -> Any:
        fog = SimpleNamespace(last_seen=self.last_seen, patrolled=np.ones(self.terrain.shape, dtype=np.bool_))
        return SimpleNamespace(
            tick=tick, fog=fog, pose=Pose(5.0, 5.0, 0.0), point_of=lambda spot: self.terrain.point_at(*spot)
        )

    def skip(self, tick: int, *points: int) -> None:
        """Leave a tick of the plan out in which its robot sees some points."""
        self.shown[tick] = list(points)
        self.missed.skip(tick, tick + 1, self.view(tick))

    def find(self, tick: int) -> Target | None:
        return self.missed.find(self.view(tick), self.given_up)

    def goes_to(self, tick: int) -> int | None:
        target = self.find(tick)
        return None if target is None else target.point[0] * self.terrain.width + target.point[1]


@pytest.fixture
def scene() -> Scene:
    return Scene()


def test_a_missed_point_is_gone_to_once_it_is_overdue(scene: Scene) -> None:
    far, near = scene.point(1.0, 1.0), scene.point(6.0, 5.0)
    scene.skip(10, far, near)
    overdue = 10 + round(OVERDUE * INTERVAL) + 1
    assert scene.goes_to(overdue - 1) is None
    assert scene.goes_to(overdue) == near
    scene.last_seen.flat[near] = overdue
    assert scene.goes_to(overdue + 1) == far
    scene.last_seen.flat[far] = overdue + 1
    assert scene.goes_to(overdue + 2) is None


def test_the_point_to_go_to_stays_the_same_until_it_is_seen_or_given_up(scene: Scene) -> None:
    first, nearer = scene.point(1.0, 1.0), scene.point(5.5, 5.0)
    scene.skip(10, first)
    scene.skip(60, nearer)
    overdue = 60 + round(OVERDUE * INTERVAL) + 1
    assert scene.goes_to(overdue - 30) == first
    assert scene.goes_to(overdue) == first
    target = scene.find(overdue)
    assert target is not None
    scene.given_up.add(overdue, target.stand)
    assert scene.goes_to(overdue + 1) == nearer


def test_what_somebody_has_seen_since_is_not_missed(scene: Scene) -> None:
    point = scene.point(1.0, 1.0)
    scene.last_seen.flat[point] = 10
    scene.skip(10, point)
    assert scene.goes_to(1000) is None


def test_what_the_plan_shows_soon_is_waited_for(scene: Scene) -> None:
    point = scene.point(1.0, 1.0)
    scene.skip(10, point)
    scene.planned.flat[point] = 320
    assert scene.goes_to(300) is None
    scene.skip(320, point)
    assert scene.goes_to(321) == point


def test_what_another_one_of_the_plan_has_seen_since_is_not_missed(scene: Scene) -> None:
    """Its positions may have been lost."""
    point, own = scene.point(1.0, 1.0), scene.point(6.0, 5.0)
    scene.skip(10, point, own)
    scene.others = {point}
    scene.planned.flat[[point, own]] = 50
    assert scene.goes_to(10 + round(OVERDUE * INTERVAL) + 1) == own
    scene.last_seen.flat[own] = 300
    assert scene.goes_to(1000) is None


def test_what_was_missed_of_another_plan_is_still_missed(scene: Scene) -> None:
    """Such as that of the fleet before a death. What the new plan has shown before it was taken up does not count."""
    point, shown = scene.point(1.0, 1.0), scene.point(6.0, 5.0)
    scene.skip(10, point, shown)
    scene.others = {point, shown}
    scene.planned.flat[[point, shown]] = 50, 70
    scene.missed.take_up(copy(scene.common), 60)
    overdue = 10 + round(OVERDUE * INTERVAL) + 1
    assert scene.goes_to(overdue) == point
    scene.last_seen.flat[point] = overdue
    assert scene.goes_to(overdue + 1) is None


def test_what_is_missed_again_is_gone_to_at_once(scene: Scene) -> None:
    """As where a wreck stands in the way of the plan."""
    point, other = scene.point(1.0, 1.0), scene.point(6.0, 5.0)
    scene.skip(10, point)
    scene.skip(11, point)
    assert scene.goes_to(12) is None, "the same visit"
    scene.planned.flat[point] = 400
    scene.skip(140, point, other)
    assert scene.goes_to(141) == point
