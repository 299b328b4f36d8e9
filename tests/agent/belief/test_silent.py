"""Which robots a mind takes for silent."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.belief.believed import Area, Beliefs
from agent.belief.posts import Posts
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
    inboxes = Inboxes(numbers, Rules(numbers, BOUNDS, 2.0, step=STEP))
    belief = Beliefs(inboxes, footprint_of(Terrain("t", everywhere, 2.5), 5.0), shares=True).join(2, area)
    talks, last = dict.fromkeys(numbers[1:], True), dict[int, tuple[int, Pose]]()
    for tick in range(40):
        talks = {number: talk != (dice.random() < 0.2) for number, talk in talks.items()}
        now = {number: Pose(number + 0.25 * tick, 9.0, 0.0) for number, talk in talks.items() if talk}
        frames = [encode(Position.of(number, tick, tick * STEP, pose)) for number, pose in now.items()]
        last |= {number: (tick, pose) for number, pose in now.items()}
        belief.hear(tick, Pose(1.0, 1.0, 0.0), frames)
        silent = [(pose.x, pose.y, 0.75) for _, (at, pose) in sorted(last.items()) if tick - at > patience]
        assert belief.silent(tick, patience, dict.fromkeys(numbers, 0.5), 0.25) == silent
