"""What is left out because it is too far away to change which way a robot goes, against the sums of everything."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.belief.dilated import Dilated
from agent.belief.posts import Posts
from agent.policies.potential_field.kernels.beyond import beyond
from agent.policies.potential_field.pull.direction import bearings_by_force
from agent.policies.potential_field.pull.field import Field, Pull
from agent.policies.potential_field.pull.force import ForceLaw
from agent.policies.potential_field.pull.rungs import Rungs
from agent.routes.ground import Area, Ground
from agent.routes.straight import Straight
from agent.routes.wave import Wave
from experiments.inprocess import run_in_process
from patrol.ground.fields import StaticFields
from patrol.ground.fog import Fog
from patrol.ground.terrain import Terrain
from patrol.scenario import PotentialFieldOptions, open_scenario

POINT = 0.25
TICK = 300


class Room:
    """A terrain with walls and hidden points, seen in patches, and a field of forces over it.

    With ``kept_out`` no body may enter some areas that are patrolled from outside, and others are closed for this tick.
    With ``leaving_age`` the robot looks around in a way that leaves some of the points' age.
    """

    def __init__(self, seed: int, *, kept_out: bool = False, leaving_age: bool = False, **patrol: Any) -> None:
        dice = np.random.default_rng(seed)
        shape = int(dice.integers(90, 260)), int(dice.integers(90, 260))
        passable = np.ones(shape, dtype=np.bool_)
        for _ in range(int(dice.integers(0, 30))):
            row, col = (int(dice.integers(0, size)) for size in shape)
            passable[row : row + int(dice.integers(1, 40)), col : col + int(dice.integers(1, 40))] = False
        rows, cols = (dice.integers(0, size, 5) for size in shape)
        passable[rows, cols] = True
        self.places = [(int(row) + 1, int(col) + 1) for row, col in zip(rows, cols, strict=True)]
        keep_out, closed = np.zeros((2, *shape), dtype=np.bool_)
        extra = np.random.default_rng((seed, 1))
        for area in (keep_out, closed) if kept_out else ():
            for row, col in extra.integers(0, shape, (4, 2)):
                area[row : row + int(extra.integers(1, 30)), col : col + int(extra.integers(1, 30))] = True
            area[rows, cols] = False
        reach = passable & ~keep_out
        proxy = np.full(shape, -1, dtype=np.int32)
        hidden = np.argwhere(~reach[:, :-1] & reach[:, 1:])
        for row, col in hidden[dice.random(len(hidden)) < 0.5]:
            proxy[row, col] = row * shape[1] + col + 1
        patrolled = reach | (proxy >= 0)
        straight = patrol.get("paths") == "straight"
        fields, posts = (
            StaticFields(reach, reach, patrolled, proxy),
            Posts(np.full_like(proxy, -1) if straight else proxy),
        )
        self.fog = Fog(patrolled)
        self.dilated = Dilated(self.fog, patrolled if straight else reach, posts, int(dice.integers(0, 20)))
        boxes = []
        for _ in range(int(dice.integers(1, 60))):
            row, col = (int(dice.integers(0, size)) for size in shape)
            part = slice(row, row + int(dice.integers(1, 90))), slice(col, col + int(dice.integers(1, 90)))
            seen = np.where(patrolled[part], np.int32(dice.integers(0, TICK)), self.fog.last_seen[part])
            self.fog.last_seen[part] = np.maximum(self.fog.last_seen[part], seen)
            boxes.append((row, row + seen.shape[0] - 1, col, col + seen.shape[1] - 1))
        self.dilated.changed(boxes)
        self.mfow = TICK - max(0, int(self.fog.last_seen[patrolled].min()))
        self.looked = self.fog.last_seen
        if leaving_age:
            self.looked = self.looked.copy()
            row, col = (int(place) for place in (rows[0], cols[0]))
            span = int(extra.integers(1, 60))
            self.looked[max(0, row - span) : row + span, max(0, col - span) : col + span] = TICK
        self.ground = Ground(Terrain("room", passable, POINT, keep_out=keep_out), reach)
        self.ground.close(areas=[Area(closed)] if closed.any() else [])
        spec = PotentialFieldOptions.model_validate({"dilatation": 0, **patrol})
        self.field = Field(spec, fields, posts, POINT, {})
        self.law = ForceLaw(spec, POINT, int(patrolled.sum()), 400 * sum(shape))
        self.posts = posts

    def standing(self, _: int = 0) -> NDArray[np.int32]:
        height, width = self.fog.last_seen.shape
        return self.dilated.within((0, height - 1, 0, width - 1), TICK)

    def both(self) -> tuple[Pull, Pull]:
        """With all forces, and with those that are needed, asked a few times as by a robot that stays."""
        rivals = self.places[1:]
        ask = (self.ground, *self.places[0], self.fog.last_seen, self.standing, TICK, self.mfow, rivals, self.looked)
        whole = self.field.pull(*ask)
        return whole, [self.field.lead(*ask, self.dilated.blocks) for _ in range(3)][-1]


LAWS = [("f3", "g4"), ("f1", "g4"), ("f4", "g3"), ("f5", "g5"), ("f1", "g1"), ("f2", "g2")]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    law=st.sampled_from(LAWS),
    separation=st.sampled_from(["none", "claims"]),
    paths=st.sampled_from(["wave", "straight"]),
    sectors=st.sampled_from([4, 8, 16]),
    tolerance=st.sampled_from([0.0, 1e-16, 1e-8, 1e-3, 0.05, 0.5]),
    kept_out=st.booleans(),
    leaving_age=st.booleans(),
)
@example(71457, ("f5", "g4"), "none", "wave", 32, 1e-3, False, False)
@example(71061, ("f5", "g5"), "none", "wave", 16, 0.5, False, False)
def test_what_is_left_out_changes_no_order_no_stop_and_no_bend(
    seed: int,
    law: tuple[str, str],
    separation: str,
    paths: str,
    sectors: int,
    tolerance: float,
    kept_out: bool,
    leaving_age: bool,
) -> None:
    patrol = {"fow": law[0], "distance": law[1], "separation": separation, "sectors": sectors, "tolerance": tolerance}
    patrol["paths"] = paths
    whole, some = Room(seed, kept_out=kept_out, leaving_age=leaving_age, **patrol).both()
    expected = bearings_by_force(whole.sums)
    sure = sectors if some.sure is None else some.sure
    assert bearings_by_force(some.sums)[:sure] == expected[:sure]
    assert (some.near, some.bend) == (whole.near, whole.bend)
    if some.sure is None:
        assert np.array_equal(some.sums, whole.sums)


@pytest.mark.parametrize("paths", ["wave", "straight"])
def test_much_is_left_out_where_what_is_stale_lies_close_by(paths: str) -> None:
    left_out = [Room(seed, separation="claims", paths=paths).both()[1].sure is not None for seed in range(8)]
    assert sum(left_out) > 4


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), law=st.sampled_from(LAWS), straight=st.booleans())
def test_bounds_hold_for_all_forces_beyond_a_length(seed: int, law: tuple[str, str], straight: bool) -> None:
    room = Room(seed, fow=law[0], distance=law[1], paths="straight" if straight else "wave")
    row, col = room.places[0]
    by_age, decay = room.law.pull(room.mfow), room.law.decay
    height, width = room.fog.last_seen.shape
    sizes = height, width, max(height, width)
    window = Straight(*sizes, room.fog.patrolled != 0) if straight else Wave(*sizes)
    window.begin(room.ground, row, col)
    window.extend(room.law.limit)
    lengths = window.length[1:-1, 1:-1].astype(np.int64)
    known = (window.state[1:-1, 1:-1] & 3 == 3) & (lengths > 0) & (lengths <= room.law.limit)
    standing = room.standing()
    has_age = known & (standing <= TICK)
    posts = room.posts.rows[known[room.posts.rows[:, 2], room.posts.rows[:, 3]]]
    far = np.concatenate((lengths[has_age], lengths[posts[:, 2], posts[:, 3]]))
    ages = TICK - np.concatenate((standing[has_age], np.maximum(room.fog.last_seen[posts[:, 0], posts[:, 1]], 0)))
    forces = by_age[ages] * decay[far]
    asked = np.array([100, 900, 4000, min(11_111, room.law.limit - 1)], dtype=np.int64)
    bounds = np.zeros((2, asked.size))
    beyond(*room.dilated.blocks, row - 1, col - 1, TICK, straight, by_age, decay, asked, bounds)
    for length, total, greatest in zip(asked, *bounds, strict=True):
        rest = forces[far > length]
        assert rest.sum() <= total * (1.0 + 1e-9)
        assert rest.max(initial=0.0) <= greatest


@pytest.mark.parametrize(("straight", "far"), [(False, 141 * 64 + 100 * 96), (True, 17_233)])
def test_a_block_begins_where_the_shortest_way_to_it_ends(straight: bool, far: int) -> None:
    oldest, count = np.full((5, 11), 50, dtype=np.int32), np.zeros((5, 11), dtype=np.int32)
    oldest[4, 10], count[4, 10] = 10, 3
    by_age, decay = np.arange(51.0), 1.0 / np.arange(1.0, 30_000.0)
    bounds = np.zeros((2, 2))
    asked = np.array([1000, 29_000], dtype=np.int64)
    beyond(oldest, count, 16, 0, 0, 0, 50, straight, by_age, decay, asked, bounds)
    assert bounds[:, 0].tolist() == [3 * 40.0 * decay[far], 40.0 * decay[far]]
    assert bounds[:, 1].tolist() == [3 * 40.0 * decay[29_001], 40.0 * decay[29_001]]


def test_a_rung_does_only_if_all_the_rest_cannot_change_the_order() -> None:
    rungs = Rungs(1000, 0, 10**6)
    rungs._bounds[:] = [[1e-3], [1e-6]]
    assert rungs.sure(0, np.array([1.0, 3.0, 2.0, 2.0005]), 0.5) == 1
    assert rungs.sure(0, np.array([1.0, 3.0, 2.0, 2.5]), 0.5) == 4
    assert rungs.sure(0, np.array([3.0, 3.0, 0.0, 0.0]), 0.5) == 0
    assert rungs.sure(0, np.array([3.0, 2.0, 0.0, 0.0]), 0.5) == 2
    assert rungs.sure(0, np.array([3.0, 2.0, 0.0, 0.0]), 1e-7) == 0
    assert rungs.sure(0, np.zeros(4), 0.0) == 0


def test_robots_climb_until_no_rung_is_left() -> None:
    rungs = Rungs(1000, 0, 10**6)
    rungs._bounds[:] = 1e9
    rung, climbed = 0, 0
    while rung < rungs.lengths.size:
        assert rungs.after(rung, np.ones(4), 1.0) > rung
        rung, climbed = rungs.after(rung, np.ones(4), 1.0), climbed + 1
    assert 1 < climbed <= rungs.lengths.size


@pytest.mark.parametrize("body", ["holonomic", "differential", "car"])
@pytest.mark.parametrize(("separation", "paths"), [("none", "wave"), ("claims", "wave"), ("claims", "straight")])
def test_a_fleet_that_leaves_out_what_is_too_far_drives_as_one_that_does_not(
    body: str, separation: str, paths: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    given_ = {"point": 0.5, "duration": 60, "robots.count": 3, "robots.model": body, "patrol.policy": "potential-field"}
    run = partial(run_in_process, verify_fog=False)
    traces = []
    for whole in (False, True):
        if whole:
            monkeypatch.setattr(Field, "lead", lambda self, *asked: self.pull(*asked[:-1]))
        outcome = run(
            open_scenario("yards", {**given_, "patrol.options.separation": separation, "patrol.options.paths": paths})
        )
        assert outcome.journal.end is not None
        traces.append(outcome.journal.end.trace_hash)
    assert traces[0] == traces[1]
