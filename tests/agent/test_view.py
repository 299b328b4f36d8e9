"""The view of a policy: read-only, no age where there is nothing to patrol, and the same chance however often asked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from agent.build import Shared, build_mind
from agent.mind import Mind
from agent.ports import Intent, Stay
from agent.view import View
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.message import Position, encode
from patrol.random import Purpose
from patrol.scenario import load_scenario
from tests.agent.minds import at, prepared_on

GRIDS = ["last_seen", "dilated", "looked", "patrolled"]
POSE = Pose(6.0041, 6.1263, -1.00049)


class Watching:
    """A policy that stands still and keeps what it was shown."""

    def __init__(self) -> None:
        self.views: list[View] = []
        self.open: list[np.ndarray] = []

    def decide(self, view: View) -> Intent:
        self.views.append(view)
        self.open.append(view.ground.open_now.copy())
        return Stay()


def two_rooms() -> Terrain:
    """Two rooms of 12 x 20 m with a wall between them that no view crosses and no way leads round."""
    passable = np.ones((40, 50), dtype=np.bool_)
    passable[:, 24:26] = False
    return Terrain("rooms", passable, 0.5)


def watched(incarnation: int = 1, seed: int = 1, quality: float = 1.0) -> tuple[Mind, Watching]:
    """The mind of robot 1, which starts in the left room, and its policy."""
    mapping = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": 3}, "seed": seed}
    sensor = {"range": 5.0, "quality": quality}
    scenario = load_scenario({**mapping, "sensor": sensor, "radio": {"forget_after": 5}})
    mind = build_mind(Shared(prepared_on(scenario, two_rooms(), [POSE])), 1, incarnation)
    mind.policy = policy = Watching()
    return mind, policy


def looked(last: int = 7, quality: float = 1.0) -> View:
    """The view at a tick, with what was seen at tick 0 from the same place."""
    mind, policy = watched(quality=quality)
    for k in (0, last):
        mind.step(at(k, POSE), [])
    return policy.views[-1]


@pytest.mark.parametrize("quality", [1.0, 0.6])
@pytest.mark.parametrize("name", GRIDS)
def test_grids_of_the_fog_are_read_only(name: str, quality: float) -> None:
    view = looked(quality=quality)
    grid: np.ndarray = getattr(view.fog, name)
    assert grid.shape == view.ground.terrain.shape
    with pytest.raises(ValueError, match="read-only"):
        grid[0, 0] = 1
    with pytest.raises(ValueError, match="read-only"):
        np.add(grid, 1, out=grid, casting="unsafe")


def test_posts_are_read_only_too() -> None:
    rows = looked().fog.posts.rows
    assert len(rows), "beside the walls no body fits"
    with pytest.raises(ValueError, match="read-only"):
        rows.sort()
    with pytest.raises(ValueError, match="read-only"):
        rows[0, 0] = 10**6


@pytest.mark.parametrize("name", GRIDS)
def test_grids_are_the_beliefs_own_and_go_with_it(name: str) -> None:
    mind, policy = watched()
    mind.step(at(0, POSE), [])
    before = getattr(policy.views[0].fog, name).copy()
    mind.step(at(9, Pose(6.0, 16.0, 0.0)), [])
    after = getattr(policy.views[0].fog, name)
    assert np.array_equal(before, after) == (name == "patrolled")


def test_age_is_the_time_since_a_point_was_seen_or_since_the_beginning() -> None:
    view = looked()
    patrolled = view.fog.patrolled
    assert not patrolled[:, 26:].any(), "the other room is out of view"
    assert (view.age[~patrolled] == 0).all()
    assert view.age.dtype == np.int32
    seen, never = patrolled & (view.fog.last_seen >= 0), patrolled & (view.fog.last_seen < 0)
    assert (view.fog.last_seen[seen] == 7).all()
    assert (view.age[seen] == 0).all()
    assert never.any()
    assert (view.age[never] == 7).all()
    assert (view.mfow, view.fog.mfow(7)) == (7, 7)
    assert (view.fog.age(9)[seen] == 2).all()
    assert view.fog.mfow(9) == 9
    mine = view.age
    mine[:] = 99  # whoever asked may change it
    assert view.age.max() == 7


def test_a_look_that_leaves_age_is_told_from_one_that_does_not() -> None:
    sharp, hazy = looked(40), looked(40, quality=0.6)
    assert np.array_equal(sharp.fog.looked, sharp.fog.last_seen)
    assert (hazy.fog.looked >= hazy.fog.last_seen).all()
    assert (hazy.fog.looked > hazy.fog.last_seen).any()


def test_a_draw_repeats_and_depends_on_tick_index_and_purpose() -> None:
    mind, policy = watched()
    for k in (0, 1):
        mind.step(at(k, POSE), [])
    first, second = policy.views
    questions = [(view, index, purpose) for view in (first, second) for index in (0, 1, 2) for purpose in Purpose]
    answers = [view.draw(index, purpose) for view, index, purpose in questions]
    assert answers == [view.draw(index, purpose) for view, index, purpose in questions]
    assert len(set(answers)) == len(answers)
    assert all(0.0 <= answer < 1.0 for answer in answers)
    assert first.draw() == first.draw(0) == first.draw(0, Purpose.POLICY)


def test_a_draw_is_the_same_in_every_run_and_another_for_another_seed_or_incarnation() -> None:
    drawn = []
    for incarnation, seed in ((1, 1), (1, 1), (2, 1), (1, 2)):
        mind, policy = watched(incarnation, seed)
        mind.step(at(3, POSE), [])
        drawn.append(policy.views[0].draw(5))
    assert drawn[0] == drawn[1]
    assert len(set(drawn)) == 3


def test_a_view_says_where_the_robot_is_and_what_others_hear_of_it() -> None:
    view = looked(3)
    assert (view.tick, view.time_s, view.pose, view.bumped) == (3, 1.5, POSE, False)
    assert view.reported == Position.of(1, 3, 1.5, POSE).pose
    assert (view.reported.x, view.reported.y) == (6.0, 6.13)
    assert view.reported.heading == pytest.approx(POSE.heading, abs=5e-4)
    assert view.stride == pytest.approx(view.spec.speed * 0.5)
    assert view.radii == {1: 1.0, 2: 1.0, 3: 1.0}
    assert view.start == (13, 13)


def test_a_robot_off_its_ground_has_no_start() -> None:
    mind, policy = watched()
    mind.step(at(0, Pose(20.0, 6.0, 0.0)), [])
    assert policy.views[0].start is None


def test_peers_are_those_heard_from_lately() -> None:
    mind, policy = watched()
    for k in range(16):
        heard = [encode(Position.of(2, k, 0.5 * k, Pose(4.0, 14.0, 0.0)))]
        if k < 5:
            heard.append(encode(Position.of(3, k, 0.5 * k, Pose(9.0, 4.0, 0.0))))
        mind.step(at(k, POSE), heard)
    known = [sorted(view.peers) for view in policy.views]
    assert known == [[2, 3]] * 15 + [[2]]
    assert policy.views[-1].peers[2].pose == Pose(4.0, 14.0, 0.0)
    where = policy.views[0].ground.terrain.point_at(9.0, 4.0)
    assert policy.open[-2][where]
    assert not policy.open[-1][where], "a silent robot is still in the way"


def test_contacts_are_those_of_the_robot_and_of_others() -> None:
    mind, policy = watched()
    heard = [Position.of(2, 0, 0.0, Pose(4.0, 14.0, 0.0)), Position.of_contact(0, 0.0, 9.0, 9.0)]
    mind.step(at(0, POSE, contacts=((3.0, 4.0),)), [encode(position) for position in heard])
    assert sorted(policy.views[0].contacts) == [(3.0, 4.0), (9.0, 9.0)]


@pytest.mark.parametrize("point", [(-1, 0), (10, 24), (10**6, 0), (0.5, 1), (3,), None], ids=str)
def test_there_is_no_stand_for_what_is_not_patrolled(point: Any) -> None:
    with pytest.raises(ValueError, match="expected the row and column of a point that the robot patrols"):
        looked().stand_to_see(point)


def test_a_point_on_which_no_body_fits_is_seen_from_its_post() -> None:
    view = looked()
    corner, middle = (0, 0), (10, 10)
    assert view.stand_to_see(middle) == view.stand_to_see(np.array(middle)) == view.place_of(middle)  # type: ignore[arg-type]
    stand = view.stand_to_see(corner)
    assert not view.ground.open_now[1, 1]
    row, col = view.point_of(stand)
    assert view.ground.open_now[row + 1, col + 1]
    assert view.lengths_to_see()[corner] == view.lengths()[row, col]
    assert np.isinf(view.lengths()[corner])
    assert np.isfinite(view.lengths_to_see()[view.fog.patrolled]).all()
