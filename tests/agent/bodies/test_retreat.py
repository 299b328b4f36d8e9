"""Cars that meet where they cannot pass: one goes back the way that it came, and both get where they want to be."""

from __future__ import annotations

import math

import pytest

from agent.bodies.car import PATIENCE, STUBBORN, Retreat
from agent.bodies.steering import CarSteering
from agent.ports import Place
from patrol.ground.terrain import Terrain
from patrol.pose import Drive, Pose
from patrol.radio.peers import Peer
from patrol.scenario import RobotSpec
from tests.agent.minds import STEP
from tests.agent.plans import Robots, plan, prepared_in

RADIUS = 0.4
CAR = {"model": "car", "radius": RADIUS, "turning_radius": 0.8, "speed": 1.0}


def two_rooms(corridor: float) -> Terrain:
    """Two rooms of 7 x 7 m, and a corridor between them in which two cars cannot pass."""
    low = 3.5 - 0.5
    return plan(
        (14.0 + corridor, 7.0),
        (0.0, 0.0, 7.0, 7.0),
        (7.0, low, 7.0 + corridor, low + 1.0),
        (7.0 + corridor, 0.0, 14.0 + corridor, 7.0),
    )


@pytest.mark.parametrize("corridor", [2.0, 6.0])
def test_two_cars_that_meet_in_a_corridor_both_come_through(corridor: float) -> None:
    width = 14.0 + corridor
    starts = [Pose(5.5, 3.5, 0.0), Pose(width - 5.5, 3.5, math.pi)]
    prepared = prepared_in(two_rooms(corridor), starts, CAR)
    robots = Robots(prepared, Place(width - 2.0, 2.0), Place(2.0, 5.0))
    came = [False, False]
    for _ in range(600):
        robots.tick()
        came[0] |= robots.apart((width - 2.0, 2.0), 0) < 1.0
        came[1] |= robots.apart((2.0, 5.0), 1) < 1.0
    assert came == [True, True], [body.pose for body in robots.bodies]
    assert sum(body.collisions for body in robots.bodies) > 0, "they never met"


HERE = Pose(15.0, 15.0, 0.0)


class Alone:
    """A car of number 2 on open ground, driven by hand."""

    def __init__(self) -> None:
        terrain = plan((30.0, 30.0), (0.0, 0.0, 30.0, 30.0))
        spec = RobotSpec(2, "r2", "car", 1.0, RADIUS, 0.8, None)
        self.retreat = Retreat(
            CarSteering(spec, terrain, STEP), 2, {1: RADIUS, 2: RADIUS, 3: RADIUS}, STEP, lambda _: 0.5
        )
        self.tick, self.goes_back = 0, False

    def told(self, *drives: Drive) -> None:
        for drive in drives:
            self.retreat.remember(drive)
            assert not self.seen(bumped=False)

    def seen(self, *, bumped: bool, others: dict[int, Pose] | None = None) -> bool:
        self.tick += 1
        peers = {number: Peer(self.tick, there, self.tick) for number, there in (others or {}).items()}
        begins = self.retreat.update(self.tick, HERE, bumped, peers, goes_back=self.goes_back)
        if self.goes_back and bumped:
            self.end()
        self.goes_back |= begins
        return begins

    def end(self) -> None:
        self.goes_back = False
        self.retreat.end(self.tick)

    def next(self) -> Drive | None:
        drive = self.retreat.next(self.tick, HERE)
        if drive is None:
            self.end()
        return drive

    def bumps(self, other: int, times: int) -> int:
        """Bumps against a robot right ahead until the car goes back; 0 where it does not."""
        for number in range(1, times + 1):
            self.retreat.remember(Drive(1.0, 0.0))
            if self.seen(bumped=True, others={other: Pose(16.0, 15.0, 0.0)}):
                return number
        return 0


WAY = (Drive(1.0, 0.0), Drive(1.0, 1.25), Drive(-0.5, -1.25), Drive(0.0, 0.0), Drive(1.0, 0.5))


def test_it_drives_its_own_way_backwards() -> None:
    car = Alone()
    car.told(*WAY)
    assert car.bumps(1, 10) == PATIENCE
    back = []
    for _ in range(4):
        drive = car.next()
        assert drive is not None
        back.append(drive)
        car.retreat.remember(drive)
        car.seen(bumped=False)
    assert back == [Drive(-drive.speed, drive.curvature) for drive in reversed(WAY) if drive.speed != 0.0]
    assert car.next() is None  # the way is used up


def test_the_higher_number_goes_back_first() -> None:
    first, second = Alone(), Alone()
    for car in (first, second):
        car.told(*WAY)
    assert first.bumps(1, 10) == PATIENCE
    assert second.bumps(3, 10) == STUBBORN


def test_who_meets_again_goes_back_farther() -> None:
    car = Alone()
    car.told(*[Drive(1.0, 0.0)] * 60)
    lengths = []
    for _ in range(4):
        assert car.bumps(1, 10)
        steps = 0
        while (drive := car.next()) is not None:
            car.retreat.remember(drive)
            car.seen(bumped=False)
            steps += 1
        lengths.append(steps)
    assert lengths == [4, 8, 16, 32]


def test_a_bump_in_the_back_ends_it_and_a_bump_against_a_wall_begins_none() -> None:
    car = Alone()
    car.told(*WAY)
    assert car.bumps(1, 10)
    assert car.goes_back
    assert not car.seen(bumped=True, others={1: Pose(16.0, 15.0, 0.0)})
    assert not car.goes_back
    assert all(not car.seen(bumped=True) for _ in range(20))
    far = {1: Pose(25.0, 15.0, 0.0)}
    assert all(not car.seen(bumped=True, others=far) for _ in range(20))
