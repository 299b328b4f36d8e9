"""Minds that miss ticks or start late: paused and resumed, killed and restarted, and what their peers make of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agent.build import mind_maker, shared_by
from agent.ports import Decision
from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Pose
from patrol.scenario import load_scenario
from tests.agent.minds import STEP, at, prepared_on


class Pair:
    """Two robots in one room of 30 x 20 m; those that are down stand still and say nothing."""

    def __init__(self, model: str) -> None:
        terrain = Terrain("room", np.ones((40, 60), dtype=np.bool_), 0.5)
        robots = {"count": 2, "model": model}
        radio = {"trail": 2, "forget_after": 5}
        patrol = {"dilatation": 2.0, "separation": "claims", "commitment": "none", "manoeuvres": False}
        patrol |= {"random_move": 0.1, "random_move_for": "holonomic"}
        mapping = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": robots, "radio": radio, "patrol": patrol}
        scenario = load_scenario({**mapping, "sensor": {"range": 4.0}})
        self.poses = [Pose(6.0, 6.0, 0.3), Pose(20.0, 12.0, 2.0)]
        prepared = prepared_on(scenario, terrain, self.poses)
        self.make = mind_maker(prepared, shared_by(prepared, groups=len(prepared.scenario.roster)))
        self.minds = [self.make(number, 1) for number in (1, 2)]
        self.terrain = terrain
        self.bumped = [False, False]
        self.k = 0

    def run(self, ticks: int, *up: int) -> list[list[Decision]]:
        """So many ticks with these robots (0, 1) up; their decisions."""
        decisions = []
        for k in range(self.k, self.k + ticks):
            frames = {index: self.minds[index].frames(at(k, self.poses[index])) for index in up}
            decided = []
            for index in up:
                heard = [frame for other, sent in frames.items() if other != index for frame in sent]
                decided.append(self.minds[index].step(at(k, self.poses[index], self.bumped[index]), heard))
            for index, decision in zip(up, decided, strict=True):
                self.bumped[index] = not self._move(index, decision)
            decisions.append(decided)
        self.k += ticks
        return decisions

    def _move(self, index: int, decision: Decision) -> bool:
        after = advance(self.poses[index], decision.command, STEP)
        other = self.poses[1 - index]
        free = path_is_free(self.terrain, self.poses[index], decision.command, STEP, 1.0)
        free = free and math.dist((after.x, after.y), (other.x, other.y)) >= 2.0
        if free:
            self.poses[index] = after
        return free


@pytest.mark.parametrize("model", MODELS)
def test_a_resumed_mind_goes_on_with_what_it_knew(model: str) -> None:
    pair = Pair(model)
    pair.run(60, 0, 1)
    knew = pair.minds[1].belief.fog.last_seen.copy()
    pair.run(40, 0)
    assert (pair.minds[1].belief.fog.last_seen == knew).all()
    first = pair.run(1, 0, 1)[0]
    assert pair.minds[1].belief.peers[1].tick == 100
    assert pair.minds[0].belief.peers[2].tick == 100
    assert first[1].mfow >= 40
    later = pair.run(100, 0, 1)
    assert [decided.rejected for decided in later[-1]] == [0, 0]
    assert later[-1][1].mfow < 100


@pytest.mark.parametrize("model", MODELS)
def test_a_restarted_mind_knows_nothing_and_catches_up(model: str) -> None:
    pair = Pair(model)
    pair.run(80, 0, 1)
    pair.run(20, 0)
    pair.minds[1] = pair.make(2, 2)
    first = pair.run(1, 0, 1)[0]
    belief = pair.minds[1].belief
    assert first[1].mfow == 100
    assert 0 < belief.fog.seen < belief.fog.points / 2
    assert belief.peers[1].tick == pair.minds[0].belief.peers[2].tick == 100
    later = pair.run(150, 0, 1)
    assert [decided.rejected for decided in later[-1]] == [0, 0]
    assert belief.fog.seen == belief.fog.points
    assert later[-1][1].mfow < 80
