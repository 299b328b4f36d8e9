"""A robot's belief in blocked ground, and in robots that it no longer hears."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.belief.believed import Area, Beliefs
from agent.belief.blocked import Blocked, Silent
from agent.belief.dilated import Posts
from patrol.closures.ground import ChangingFootprint
from patrol.exchange import Sensed
from patrol.ground.fields import compute_fields
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Rules
from patrol.radio.message import Position, encode

MEMORY = 20
ROOM = np.ones((11, 30), dtype=np.bool_)
ROOM[:, 14] = False
ROOM[4:7, 14] = True  # a doorway of three points between two rooms
TERRAIN = Terrain("two rooms", ROOM, 1.0)
DOOR = tuple(row * 30 + 14 for row in (4, 5, 6))
BEFORE = Pose(5.5, 5.5, 0.0)
"""From here the robot sees the doorway."""


@pytest.fixture
def blocked() -> Blocked:
    """The belief of a robot in the left room, with a sensor of 10 m."""
    footprint = ChangingFootprint(lambda ground: footprint_of(ground, 10.0), TERRAIN)
    return Blocked(footprint, compute_fields(TERRAIN, 0.4, 10.0, True, [BEFORE]), 0.4, MEMORY)


def test_what_is_seen_blocked_is_left_out_with_all_behind_it(blocked: Blocked) -> None:
    blocked.sense(Sensed(0, BEFORE, blocked=DOOR))
    blocked.stand_at((5, 5))
    assert np.flatnonzero(blocked.grid).tolist() == list(DOOR)
    assert blocked.area is not None
    assert blocked.left_out is not None
    assert blocked.left_out[:, 15:].all()
    assert not blocked.left_out[:, 1:12].any()


@pytest.mark.parametrize("box", [DOOR, tuple(row * 30 + col for row in (4, 5, 6) for col in (8, 9, 10))])
def test_points_seen_free_are_forgotten_at_once_in_all_layers(box: tuple[int, ...], blocked: Blocked) -> None:
    blocked.sense(Sensed(0, BEFORE, blocked=box))
    blocked.sense(Sensed(1, BEFORE))
    assert not blocked.grid.any()
    assert blocked.area is None
    assert blocked.left_out is None


def test_a_closing_that_never_was_is_forgotten_when_the_memory_ends(blocked: Blocked) -> None:
    """Such as another robot's body in a doorway that this one does not see again."""
    away = Pose(1.5, 1.5, 0.0)
    blocked.sense(Sensed(0, BEFORE, blocked=DOOR))
    blocked.sense(Sensed(MEMORY, away))
    assert blocked.grid.any()
    blocked.sense(Sensed(MEMORY + 1, away))
    assert not blocked.grid.any()
    assert blocked.area is None


def test_a_robot_that_is_shut_in_sees_its_own_side(blocked: Blocked) -> None:
    blocked.sense(Sensed(0, Pose(20.5, 5.5, 0.0), blocked=DOOR))
    blocked.stand_at((5, 20))
    assert blocked.left_out is not None
    assert blocked.left_out[:, 1:14][TERRAIN.passable[:, 1:14]].all()
    assert not blocked.left_out[:, 17:].any()


def test_new_places_to_stand_are_found_for_what_is_in_sight_past_a_box() -> None:
    footprint = ChangingFootprint(lambda ground: footprint_of(ground, 10.0), TERRAIN)
    fields = compute_fields(TERRAIN, 0.4, 10.0, True, [BEFORE])
    posts = Posts(fields.proxy)
    belief = Blocked(footprint, fields, 0.4, MEMORY, posts)
    usual = posts.rows.tolist()
    box = tuple(row * 30 + 14 for row in (5, 6))  # leaves a gap through which no body fits
    belief.sense(Sensed(0, BEFORE, blocked=box))
    belief.stand_at((5, 5))
    assert belief.left_out is not None
    assert belief.stands is not None
    assert not belief.left_out[4, 18]
    assert belief.left_out[9, 15]
    stand = divmod(int(belief.stands[4 * 30 + 18]), 30)
    assert stand[1] < 14
    assert [4, 18, *stand] in posts.rows.tolist()
    belief.sense(Sensed(1, BEFORE))
    assert posts.rows.tolist() == usual
    assert belief.stands is None


def test_indices_off_the_terrain_are_ignored(blocked: Blocked) -> None:
    blocked.sense(Sensed(0, BEFORE, blocked=(10**6,)))
    assert not blocked.grid.any()


# --- robots that are silent ------------------------------------------------------------------------------------------


STEP = 0.5


def inboxes_of(*numbers: int) -> Inboxes:
    return Inboxes(numbers, Rules(numbers, (0.0, 0.0, 50.0, 50.0), 2.0, step=STEP))


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), patience=st.integers(0, 6))
def test_silent_are_those_not_heard_for_longer_than_is_waited(seed: int, patience: int) -> None:
    dice = np.random.default_rng(seed)
    numbers = (2, 5, 7, 9)
    everywhere = np.ones((20, 20), dtype=np.bool_)
    area = Area(everywhere, everywhere, Posts(np.full((20, 20), -1, dtype=np.int32)), 0)
    silent = Silent(dict.fromkeys(numbers, 0.5), 0.25, 1.0, patience, 30)
    here = Pose(1.0, 1.0, 0.0)
    footprint = footprint_of(Terrain("t", everywhere, 2.5), 5.0)
    belief = Beliefs(inboxes_of(*numbers), footprint, shares=True).join(2, area)
    talks, last = dict.fromkeys(numbers[1:], True), dict[int, tuple[int, Pose]]()
    for tick in range(40):
        talks = {number: talk != (dice.random() < 0.2) for number, talk in talks.items()}
        now = {number: Pose(number + 0.25 * tick, 9.0, 0.0) for number, talk in talks.items() if talk}
        frames = [encode(Position.of(number, tick, tick * STEP, pose)) for number, pose in now.items()]
        last |= {number: (tick, pose) for number, pose in now.items()}
        belief.hear(tick, here, frames)
        expected = [(pose.x, pose.y, 0.75) for _, (at, pose) in sorted(last.items()) if patience < tick - at <= 30]
        assert silent.discs(tick, here, False, belief.peers) == expected


def test_lately_begins_with_the_tick_itself() -> None:
    everywhere = np.ones((20, 20), dtype=np.bool_)
    area = Area(everywhere, everywhere, Posts(np.full((20, 20), -1, dtype=np.int32)), 0)
    inboxes = inboxes_of(1, 2, 3)
    belief = Beliefs(inboxes, footprint_of(Terrain("t", everywhere, 2.5), 5.0)).join(1, area)
    for number, tick in ((2, 5), (3, 6)):
        frame = encode(Position.of(number, tick, tick * STEP, Pose(float(number), 9.0, 0.0)))
        belief.hear(tick, Pose(1.0, 1.0, 0.0), [frame])
    for peers in (belief.peers, dict(belief.peers)):
        assert [sorted(belief.lately(peers, since)) for since in (5, 6, 7)] == [[2, 3], [3], []]


def test_a_silent_robot_is_in_the_way_until_forgotten_and_again_after_a_bump() -> None:
    here, far, inboxes = Pose(8.2, 10.0, 0.0), Pose(30.0, 30.0, 0.0), inboxes_of(1, 2)
    inboxes.hear(5, {1: [encode(Position.of(2, 5, 5 * STEP, Pose(10.0, 10.0, 0.0)))]})
    peers = inboxes.peers(1)
    silent = Silent({1: 0.7, 2: 0.7}, 0.95, 1.7, 10, 40)
    there = [(10.0, 10.0, 0.7 + 0.95)]
    assert silent.discs(15, far, False, peers) == []
    assert silent.discs(16, far, False, peers) == there
    assert silent.discs(45, far, False, peers) == there
    assert silent.discs(46, far, True, peers) == []  # a bump elsewhere
    assert silent.discs(60, here, True, peers) == there
    assert silent.discs(100, far, False, peers) == there
    assert silent.discs(101, far, False, peers) == []
    fresh = Silent({1: 0.7, 2: 0.7}, 0.95, 1.7, 10, 40)
    assert fresh.discs(16, Pose(8.5, 10.0, 0.0), False, peers) == []  # a robot inside of the disc may leave it
    assert fresh.discs(16, Pose(8.3, 10.0, 0.0), False, peers) == there
