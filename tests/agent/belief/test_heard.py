"""Which robots one listener has heard of, where they are, and which of them have fallen silent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.belief.believed import Belief
from agent.belief.posts import Posts
from agent.belief.shared import Company, HeardPeers
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.ears import Ear, Ears
from patrol.radio.inbox import Inbox
from patrol.radio.message import Position, encode
from patrol.radio.peers import PeerTracker

STEP = 0.5
BOUNDS = (0.0, 0.0, 50.0, 50.0)


@pytest.fixture
def ears() -> Ears:
    """Robot 2 of the robots 2, 5, 7 and 9 has heard 5 at tick 0, 7 at tick 1, and never 9."""
    numbers = (2, 5, 7, 9)
    found = Ears(numbers, STEP, speed=2.0)
    ear = Ear(found.row_of(2), Inbox(2, numbers, BOUNDS, 2.0, step=STEP), PeerTracker())
    for tick, number, x in ((0, 5, 3.25), (1, 7, 40.5)):
        frame = encode(Position.of(number, tick, tick * STEP, Pose(x, 10.0 + x / 4.0, 1.0)))
        found.listen(tick, {2: ear}, {2: [frame]})
    return found


def test_places_are_those_of_the_peers_in_the_order_of_their_numbers(ears: Ears) -> None:
    peers = HeardPeers(ears, ears.row_of(2))
    assert list(peers) == [5, 7]
    assert peers.places.tolist() == [[peer.pose.x, peer.pose.y] for peer in peers.values()]
    assert HeardPeers(ears, ears.row_of(9)).places.shape == (0, 2)


@pytest.mark.parametrize(("since", "expected"), [(0, [5, 7]), (1, [7]), (2, [])])
def test_only_who_was_heard_since_a_tick_has_a_place(ears: Ears, since: int, expected: list[int]) -> None:
    peers = HeardPeers(ears, ears.row_of(2), since)
    assert list(peers) == expected
    assert len(peers.places) == len(expected)
    assert peers.places.dtype == np.float64


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), patience=st.integers(0, 6))
def test_a_shared_belief_takes_the_same_robots_for_silent_as_one_of_its_own(seed: int, patience: int) -> None:
    dice = np.random.default_rng(seed)
    numbers, radii = (2, 5, 7, 9), dict.fromkeys((2, 5, 7, 9), 0.5)
    open_ground = np.ones((20, 20), dtype=np.bool_)
    footprint = footprint_of(Terrain("t", open_ground, 2.5), 5.0)
    nowhere = Posts(np.full((20, 20), -1, dtype=np.int32))

    def inbox() -> Inbox:
        return Inbox(2, numbers, BOUNDS, 2.0, step=STEP)

    def blank() -> Belief:
        return Belief(open_ground, open_ground, nowhere, footprint, inbox(), 0)

    company, alone = Company(numbers, STEP, 2.0, footprint), blank()
    shared = company.join(2, inbox(), blank, kind=0)
    here, talks = Pose(1.0, 1.0, 0.0), dict.fromkeys(numbers[1:], True)
    for tick in range(40):
        talks = {number: talk != (dice.random() < 0.2) for number, talk in talks.items()}
        heard = [
            encode(Position.of(number, tick, tick * STEP, Pose(number + 0.25 * tick, 9.0, 0.0)))
            for number, talk in talks.items()
            if talk
        ]
        company.hear(tick, {2: here}, {2: heard})
        alone.update(tick, here, heard, STEP)
        assert shared.silent(tick, patience, radii, 0.25) == alone.silent(tick, patience, radii, 0.25)
