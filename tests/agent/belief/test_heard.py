"""Where the robots are that one listener has heard of."""

from __future__ import annotations

import numpy as np
import pytest

from agent.belief.shared import HeardPeers
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
