"""Where a robot takes those that it no longer hears to stand in its way."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.belief.believed import Area, Beliefs
from agent.belief.blocked import Silent
from agent.belief.dilated import Posts
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Rules
from patrol.radio.message import Position, encode

STEP = 0.5
BOUNDS = (0.0, 0.0, 50.0, 50.0)


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), patience=st.integers(0, 6))
def test_silent_are_those_not_heard_for_longer_than_is_waited(seed: int, patience: int) -> None:
    dice = np.random.default_rng(seed)
    numbers = (2, 5, 7, 9)
    everywhere = np.ones((20, 20), dtype=np.bool_)
    area = Area(everywhere, everywhere, Posts(np.full((20, 20), -1, dtype=np.int32)), 0)
    silent = Silent(dict.fromkeys(numbers, 0.5), 0.25, 1.0, patience, 30)
    here = Pose(1.0, 1.0, 0.0)
    inboxes = Inboxes(numbers, Rules(numbers, BOUNDS, 2.0, step=STEP))
    belief = Beliefs(inboxes, footprint_of(Terrain("t", everywhere, 2.5), 5.0), shares=True).join(2, area)
    talks, last = dict.fromkeys(numbers[1:], True), dict[int, tuple[int, Pose]]()
    for tick in range(40):
        talks = {number: talk != (dice.random() < 0.2) for number, talk in talks.items()}
        now = {number: Pose(number + 0.25 * tick, 9.0, 0.0) for number, talk in talks.items() if talk}
        frames = [encode(Position.of(number, tick, tick * STEP, pose)) for number, pose in now.items()]
        last |= {number: (tick, pose) for number, pose in now.items()}
        belief.hear(tick, here, frames)
        expected = [(pose.x, pose.y, 0.75) for _, (at, pose) in sorted(last.items()) if patience < tick - at <= 30]
        assert silent.discs(tick, here, False, belief.peers) == expected


def test_a_silent_robot_is_in_the_way_until_forgotten_and_again_after_a_bump() -> None:
    numbers, here, far = (1, 2), Pose(8.2, 10.0, 0.0), Pose(30.0, 30.0, 0.0)
    inboxes = Inboxes(numbers, Rules(numbers, BOUNDS, 2.0, step=STEP))
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


def test_a_robot_inside_the_disc_of_a_silent_one_may_leave_it() -> None:
    numbers = (1, 2)
    inboxes = Inboxes(numbers, Rules(numbers, BOUNDS, 2.0, step=STEP))
    inboxes.hear(0, {1: [encode(Position.of(2, 0, 0.0, Pose(10.0, 10.0, 0.0)))]})
    silent = Silent({1: 0.7, 2: 0.7}, 0.95, 1.7, 10, 40)
    assert silent.discs(11, Pose(8.5, 10.0, 0.0), False, inboxes.peers(1)) == []
    assert len(silent.discs(11, Pose(8.3, 10.0, 0.0), False, inboxes.peers(1))) == 1
