"""Obstacles that one robot believes in: robots that it no longer hears, and what it has bumped into."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.belief.believed import Area, Belief, Beliefs
from agent.belief.obstacles import Obstacles
from agent.belief.posts import Posts
from agent.routes.ground import Disc, Spot
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Rules
from patrol.radio.message import Position, encode

# Not the product's own, so that a wrong one there is noticed.
MOST_SPELLS = 8

STEP = 0.5
STRIDE = 1.0
POINT = 0.5
TERRAIN = Terrain("field", np.ones((100, 100), dtype=np.bool_), POINT)
PATIENCE, MEMORY, FIRST = 10, 40, 8
FAR = Pose(45.0, 45.0, 0.0)


def belief_of(*numbers: int) -> Belief:
    """The belief of robot 1."""
    everywhere = np.ones((100, 100), dtype=np.bool_)
    area = Area(everywhere, everywhere, Posts(np.full((100, 100), -1, dtype=np.int32)), 0)
    inboxes = Inboxes(numbers, Rules(numbers, (0.0, 0.0, 50.0, 50.0), STRIDE / STEP, step=STEP))
    return Beliefs(inboxes, footprint_of(TERRAIN, 5.0), shares=True).join(1, area)


class Robot:
    """Robot 1, with a radius of 0.7 m as all others."""

    def __init__(self, *others: int, patience: int = PATIENCE) -> None:
        numbers = (1, *others)
        self.belief = belief_of(*numbers)
        radii, strides = dict.fromkeys(numbers, 0.7), dict.fromkeys(numbers, STRIDE)
        self.obstacles = Obstacles(1, radii, strides, TERRAIN, patience, MEMORY, FIRST)

    def hear(self, tick: int, *heard: tuple[int, Spot], sent: int | None = None) -> None:
        """Hear robots, number and place of each, as they were in the tick of sending: this one unless given."""
        sequence = tick if sent is None else sent
        frames = [encode(Position.of(n, sequence, sequence * STEP, Pose(*at, 0.0))) for n, at in heard]
        self.belief.hear(tick, FAR, frames)

    def note(self, tick: int, pose: Pose = FAR, end: Pose | None = None) -> list[tuple[float, ...]]:
        """The discs in which the robot's centre is not, by places to the millimetre."""
        peers = self.belief.peers_at(tick, None)
        discs = self.obstacles.note(tick, pose, end, self.belief, peers)
        return [tuple(round(value, 3) for value in disc) for disc in discs]

    def met(self, tick: int) -> dict[tuple[int, int], Disc]:
        """The discs of silent robots that it has met."""
        return self.obstacles.met(tick, self.belief.peers)

    def place_of(self, tick: int, number: int) -> Spot:
        """The place at which it takes another robot to be."""
        pose = self.obstacles.corrected(self.belief.peers_at(tick, None))[number].pose
        return round(pose.x, 3), round(pose.y, 3)


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), patience=st.integers(0, 6))
def test_silent_are_those_not_heard_for_longer_than_is_waited(seed: int, patience: int) -> None:
    dice = np.random.default_rng(seed)
    robot = Robot(5, 7, 9, patience=patience)
    talks, last, frames = dict.fromkeys((5, 7, 9), True), dict[int, tuple[int, float]](), dict.fromkeys((5, 7, 9), 0)
    for tick in range(40):
        talks = {number: talk != (dice.random() < 0.2) for number, talk in talks.items()}
        heard = [(number, number + 0.25 * tick) for number, talk in talks.items() if talk]
        robot.hear(tick, *[(number, (x, 9.0)) for number, x in heard])
        for number, x in heard:
            # A step after the last position; a robot heard once shows no movement.
            last[number] = tick, x + (0.25 if frames[number] else 0.0)
            frames[number] += 1
        expected = {(x, 9.0, 1.4) for at, x in last.values() if patience < tick - at <= MEMORY}
        assert set(robot.note(tick)) == expected


def silent_at_ten() -> Robot:
    """Robot 1 after robot 2, on its way along x, was last heard at (9, 10) in tick 5."""
    robot = Robot(2)
    robot.hear(4, (2, (8.0, 10.0)))
    robot.hear(5, (2, (9.0, 10.0)))
    return robot


def test_a_silent_robot_is_in_the_way_until_forgotten_and_for_longer_after_each_later_bump() -> None:
    robot, there = silent_at_ten(), [(10.0, 10.0, 1.4)]
    assert [robot.note(tick) for tick in (15, 16, 45, 46)] == [[], there, there, []]
    here, end, now, spells = Pose(8.5, 10.0, 0.0), Pose(9.5, 10.0, 0.0), 60, []
    for _ in range(6):
        assert robot.note(now, here, end) == there
        later = now
        while robot.note(later + 1):
            later += 1
        spells.append(later - now)
        now = later + 2
    assert spells == [80, 160, 320, 320, 320, 320]
    assert MOST_SPELLS * MEMORY == 320
    robot.hear(now, (2, (20.0, 20.0)))
    assert robot.note(now) == []


def test_a_bump_moves_a_silent_robot_to_where_it_agrees_with_it() -> None:
    robot = silent_at_ten()
    # From (10, 10) towards (11, 6.45), the middle of the cancelled move, until the two would touch.
    share = 1.4 / math.hypot(1.0, 3.55)
    ((x, y, reach),) = robot.note(20, Pose(11.0, 6.0, 0.0), Pose(11.0, 6.9, 0.0))
    assert (x, y) == pytest.approx((11.0 - share * 1.0, 6.45 + share * 3.55), abs=1e-3)
    x, y, reach = robot.note(21, Pose(11.0, 8.0, 0.0))[0]
    assert math.dist((x, y), (11.0, 8.0)) == pytest.approx(reach, abs=2e-3)  # the robot stands where it stands


def test_a_bump_into_a_robot_that_is_heard_teaches_nothing() -> None:
    robot = Robot(2)
    robot.hear(3, (2, (10.0, 10.0)))
    assert robot.note(3, Pose(8.0, 10.0, 0.0), Pose(9.0, 10.0, 0.0)) == []
    # Both were on their way, so the gap between them may be a step of each.
    assert robot.note(3, Pose(6.7, 10.0, 0.0), Pose(7.7, 10.0, 0.0)) == []
    assert robot.note(3, Pose(6.5, 10.0, 0.0), Pose(7.5, 10.0, 0.0)) != []


@pytest.mark.parametrize(("end_x", "late", "explains"), [
    (7.581, 0, True),  # 2.419 m from it: 1.4 m, a step of 1 m and 0.02 m for rounding
    (7.579, 0, False),
    (4.581, 3, True),  # it may have made 3 steps more since it was heard
    (4.579, 3, False),
])  # fmt: skip
def test_a_robot_heard_explains_a_bump_within_its_steps(end_x: float, late: int, explains: bool) -> None:
    robot = Robot(2)
    robot.hear(9, (2, (10.0, 10.0)), sent=9 - late)
    assert (
        robot.note(9, Pose(end_x - 1.0, 10.0, 0.0), Pose(end_x, 10.0, 0.0)) == []
        if explains
        else [(end_x - 0.5 + 1.4, 10.0, 1.4)]
    )


@pytest.mark.parametrize(("off_m", "is_it"), [(1.99, True), (2.01, False)])
def test_a_bump_within_two_strides_of_a_silent_robot_was_into_it(off_m: float, is_it: bool) -> None:
    """It should have stopped at (10, 10), and the two touch at 1.4 m."""
    robot = silent_at_ten()
    end_x = 10.0 + 1.4 + off_m
    discs = robot.note(20, Pose(end_x + 1.0, 10.0, 0.0), Pose(end_x, 10.0, 0.0))
    assert len(discs) == (1 if is_it else 2)
    assert (discs[0][0] > 10.0) is is_it


def test_what_a_robot_has_met_and_drives_away_from_does_not_explain_a_bump() -> None:
    robot = silent_at_ten()
    touching = Pose(8.6, 10.0, 0.0)
    robot.note(20, touching, Pose(9.6, 10.0, 0.0))
    silent, other = robot.note(21, touching, Pose(7.6, 10.0, 0.0))
    assert silent == (10.0, 10.0, 1.4)
    assert other == pytest.approx((6.7, 10.0, 1.4))


def test_a_robot_that_stands_learns_nothing_from_a_bump() -> None:
    robot, here = Robot(2), Pose(8.0, 10.0, 0.0)
    assert robot.note(0, here, Pose(8.0, 10.0, 1.0)) == []


def test_a_bump_away_from_a_silent_robot_that_was_not_met_yet_is_laid_to_it() -> None:
    robot = silent_at_ten()
    (silent,) = robot.note(20, Pose(8.6, 10.0, 0.0), Pose(7.6, 10.0, 0.0))
    assert silent == (10.0, 10.0, 1.4)


def test_one_that_was_not_heard_in_the_tick_of_the_bump_is_in_the_way_until_it_is() -> None:
    robot = silent_at_ten()
    assert robot.note(6) == []
    assert robot.note(7, Pose(8.5, 10.0, 0.0), Pose(9.5, 10.0, 0.0)) == [(10.0, 10.0, 1.4)]
    robot.hear(8, (2, (11.0, 10.0)))
    assert robot.note(8) == []


def test_something_unknown_is_in_the_way_for_longer_and_longer_and_then_forgotten() -> None:
    robot, here, end, spells, now = Robot(2), Pose(8.0, 10.0, 0.0), Pose(9.0, 10.0, 0.0), [], 0
    for _ in range(4):
        assert robot.note(now, here, end) == [(9.9, 10.0, 1.4)]
        later = now
        while robot.note(later + 1):
            later += 1
        spells.append(later - now)
        now = later + 2
    assert spells == [FIRST, 2 * FIRST, 4 * FIRST, 8 * FIRST]
    now += MOST_SPELLS * MEMORY
    assert robot.note(now) == []
    robot.note(now, here, end)
    assert robot.note(now + FIRST)
    assert not robot.note(now + FIRST + 1)


def test_a_second_unknown_thing_elsewhere_is_another() -> None:
    robot = Robot(2)
    robot.note(0, Pose(8.0, 10.0, 0.0), Pose(9.0, 10.0, 0.0))
    assert robot.note(1, Pose(8.0, 20.0, 0.0), Pose(9.0, 20.0, 0.0)) == [(9.9, 10.0, 1.4), (9.9, 20.0, 1.4)]


def test_what_is_closed_is_half_a_point_wider_but_leaves_the_robot_its_point() -> None:
    robot = Robot(2)
    disc = (10.0, 10.0, 1.4)
    assert robot.obstacles.closed([disc], FAR) == [(10.0, 10.0, 1.65)]
    (closed,) = robot.obstacles.closed([disc], Pose(8.6, 10.1, 0.0))
    assert closed[2] == pytest.approx(math.dist((8.75, 10.25), (10.0, 10.0)))


def test_a_robot_heard_late_is_expected_where_it_drives_and_after_a_bump_where_it_was_met() -> None:
    robot = Robot(2)
    for tick in range(8, 20):
        robot.hear(tick, (2, (tick - 4.0, 10.0)), sent=tick - 4)
    assert robot.place_of(19, 2) == (19.0, 10.0)
    assert robot.note(19, Pose(16.0, 10.0, 0.0), Pose(17.0, 10.0, 0.0)) == []
    assert robot.place_of(19, 2) == (17.9, 10.0)
    for tick in range(20, 23):
        robot.hear(tick, (2, (tick - 4.0, 10.0)), sent=tick - 4)
        assert robot.place_of(tick, 2) == (17.9, 10.0)
    robot.hear(23, (2, (18.2, 10.0)), sent=19)
    assert robot.place_of(23, 2)[0] == pytest.approx(18.2 + 4 * 0.2)


def test_a_silent_robot_counts_as_met_from_a_bump_until_it_is_open_again() -> None:
    robot = silent_at_ten()
    assert robot.met(20) == {}
    robot.note(20, Pose(8.5, 10.0, 0.0), Pose(9.5, 10.0, 0.0))
    ((number, until),) = robot.met(20)
    assert (number, until) == (2, 20 + MEMORY)
    assert robot.met(until).keys() == {(2, until)}
    assert robot.met(until + 1) == {}
    robot.note(until + 1, Pose(8.5, 10.0, 0.0), Pose(9.5, 10.0, 0.0))
    assert robot.met(until + 1).keys() == {(2, until + 1 + 2 * MEMORY)}


def test_a_silent_robot_that_was_never_met_and_one_of_which_a_frame_is_missing_are_no_wrecks() -> None:
    robot = silent_at_ten()
    assert robot.note(20) == [(10.0, 10.0, 1.4)]
    assert robot.met(20) == {}
    robot = Robot(2)
    robot.hear(19, (2, (10.0, 10.0)))
    assert len(robot.note(20, Pose(8.5, 10.0, 0.0), Pose(9.5, 10.0, 0.0))) == 1
    assert robot.met(20) == {}


def test_something_unknown_is_no_wreck() -> None:
    robot = Robot(2)
    robot.note(0, Pose(8.0, 10.0, 0.0), Pose(9.0, 10.0, 0.0))
    assert robot.met(0) == {}
