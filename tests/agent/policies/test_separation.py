"""Rules that keep robots apart: claims, artificial obstacles, semaphores, repulsion; and the fuzzy sectors."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.policies.forces import FuzzySectors, repel
from agent.policies.potential_field import share_table
from agent.policies.separation import RandomSteps, artificial_obstacles, critical_areas, numbered, occupied_areas
from agent.ports import Bearing, Intent, Place, Policy
from agent.routes.ground import Area, Ground
from agent.view import View
from patrol.ground.cspace import narrow_passages
from patrol.ground.terrain import Terrain
from patrol.pose import TAU, Pose
from patrol.radio.peers import Peer
from patrol.random import Purpose
from patrol.scenario import PotentialFieldOptions
from tests.agent.minds import fields_of, pull_on
from tests.agent.plans import Robots, prepared_in, two_rooms

HERE = Pose(10.0, 10.0, 0.0)


class Watching:
    """A policy that decides as another does, and keeps what that was shown and answered."""

    def __init__(self, other: Policy) -> None:
        self._other = other
        self.decided: list[tuple[View, Intent]] = []

    def decide(self, view: View) -> Intent:
        intent = self._other.decide(view)
        self.decided.append((view, intent))
        return intent


def peers(*places: tuple[float, float]) -> dict[int, Peer]:
    return {number: Peer(0, Pose(x, y, 0.0), 0) for number, (x, y) in enumerate(places, start=2)}


FIELD = fields_of(np.ones((81, 81), dtype=np.bool_))


@pytest.mark.parametrize(
    ("probability", "drawn", "steps"),
    [
        (0.25, 0.0, True),
        (0.25, math.nextafter(0.25, 0.0), True),
        (0.25, 0.25, False),
        (1.0, 0.999, True),
        (0.0, 0.0, False),
    ],
)
def test_a_random_step_is_made_as_often_as_asked(probability: float, drawn: float, steps: bool) -> None:
    view = cast("View", SimpleNamespace(draw=lambda index, _: (drawn, 0.375)[index]))
    assert RandomSteps(probability).draw(view) == (0.75 * math.pi if steps else None)


def test_a_claim_leaves_half_of_a_force_halfway_and_nothing_at_the_rival() -> None:
    table = share_table(0.3, 0.1)
    middle = table.size // 2
    assert table[middle] == 0.5
    assert table[middle + 300] == pytest.approx(1 / (1 + math.e))
    assert table[middle - 300] == pytest.approx(1 / (1 + math.exp(-1)))
    assert table[0] == pytest.approx(1.0)
    assert 0.0 < table[-1] < 1e-17


@pytest.mark.parametrize(
    ("direction", "separation", "closed"),
    [
        ("mode", "claims", False),
        ("vector", "claims", False),
        ("mode", "claims", True),
        ("mode", ["claims", "artificial-obstacles"], True),
    ],
)
def test_a_claimed_point_pulls_the_nearest_robot(direction: str, separation: str | list[str], closed: bool) -> None:
    """A rival's own disc, of an artificial obstacle or of giving way, is in everybody's way but its own."""
    seen = np.full((81, 81), 100, dtype=np.int32)
    seen[40, 70] = 0
    seen[40, 2] = 40
    ground = Ground(Terrain("field", FIELD.cspace, 0.5), FIELD.reach)
    place = ground.terrain.centre(40, 65)
    if closed:
        ground.begin([(*place, 2.0)])
        assert ground.join(*place) is None
    rival = ground.static.join(*place)
    assert rival == (41, 66)
    for rules, rivals, chosen in (("none", [rival], True), (separation, [], True), (separation, [rival], False)):
        options: dict[str, Any] = {"direction": direction, "separation": rules}
        sums = pull_on(FIELD, (41, 41), seen, rivals=rivals, ground=ground, **options).sums
        assert bool(sums[0] > 0 if direction == "vector" else int(np.argmax(sums)) in (0, 1, 7)) is chosen


def test_without_rivals_claims_change_nothing() -> None:
    seen = np.random.default_rng(3).integers(0, 100, (81, 81)).astype(np.int32)
    sums = [pull_on(FIELD, (30, 50), seen, separation=separation).sums for separation in ("none", "claims")]
    assert np.array_equal(sums[0], sums[1])


@pytest.mark.parametrize(
    ("policy", "options", "model", "probability"),
    [
        ("potential-field", {}, "holonomic", 0.1),
        ("potential-field", {"random_move": 0.25}, "car", 0.25),
        ("agent.policies.commitment:Commitment", {}, "car", 0.02),
    ],
)
def test_random_steps_are_as_frequent_as_stated(
    policy: str, options: dict[str, Any], model: str, probability: float
) -> None:
    """The tick's draws alone decide whether one is made, and its direction."""
    robot = {"model": model, "radius": 0.3, "speed": 1.0}
    patrol = {"policy": policy, "options": options}
    robots = Robots(prepared_in(two_rooms(), [Pose(2.0, 2.0, 0.0)], robot, patrol=patrol, sensor={"range": 3.0}))
    watching = Watching(robots.minds[0].policy)
    robots.minds[0].policy = watching
    for _ in range(200):
        robots.tick()
    steps = {view.tick: intent.wander for view, intent in watching.decided if isinstance(intent, Bearing | Place)}
    assert len(steps) > 150
    expected = {
        view.tick: TAU * view.draw(1, Purpose.RANDOM_MOVE)
        for view, _ in watching.decided
        if view.draw(0, Purpose.RANDOM_MOVE) < probability
    }
    assert {k: wander for k, wander in steps.items() if wander is not None} == {
        k: angle for k, angle in expected.items() if k in steps
    }
    assert bool(expected) is (probability > 0.0)


def test_an_artificial_obstacle_stands_at_each_peer_but_never_on_the_robot() -> None:
    discs = artificial_obstacles(HERE, peers((20.0, 10.0), (12.0, 10.0), (10.0, 10.0)), 5.0, 0.5)
    assert discs == [(20.0, 10.0, 5.0), (12.0, 10.0, 1.5)]


def corridor() -> Terrain:
    """Two rooms joined by a corridor of 4 m, and a niche of 4 m that leads nowhere."""
    passable = np.zeros((60, 120), dtype=np.bool_)
    passable[5:55, 5:45] = True
    passable[5:55, 75:115] = True
    passable[26:34, 45:75] = True
    passable[40:48, 115:118] = True
    return Terrain("corridor", passable, 0.5)


def test_narrow_passages_join_wider_ground_and_niches_do_not() -> None:
    terrain = corridor()
    (area,) = narrow_passages(terrain, terrain.free, 6.0)
    rows, cols = np.nonzero(area)
    assert rows.min() >= 26
    assert rows.max() < 34
    assert cols.min() in range(42, 48)
    assert cols.max() in range(72, 78)
    assert narrow_passages(terrain, terrain.free, 3.5) == []


def test_a_semaphore_closes_an_area_that_another_robot_is_in() -> None:
    terrain = corridor()
    areas = critical_areas(None, terrain, terrain.free, 6.0)
    grid = numbered(areas, terrain.shape)
    outside, inside = Pose(10.0, 15.0, 0.0), Pose(30.0, 15.0, 0.0)
    assert occupied_areas(grid, terrain, outside, peers((30.0, 15.0))) == [1]
    assert occupied_areas(grid, terrain, outside, peers((12.0, 15.0), (-5.0, 3.0))) == []
    assert occupied_areas(grid, terrain, inside, peers((28.0, 15.0))) == []
    ground = Ground(terrain, terrain.free)
    before = ground.state.copy()
    ground.begin([])
    ground.close(areas=[Area(areas[0])])
    assert (ground.state[1:-1, 1:-1][areas[0]] == 0).all()
    ground.begin([])
    assert np.array_equal(ground.state, before)


def test_critical_areas_may_be_given_as_polygons() -> None:
    terrain = corridor()
    polygon = ((25.0, 13.0), (30.0, 13.0), (30.0, 17.0), (25.0, 17.0))
    (area,) = critical_areas((polygon,), terrain, terrain.free, 8.0)
    assert area[30, 55]
    assert not area[30, 70]


@pytest.mark.parametrize("direction", ["mode", "vector"])
def test_repulsion_pushes_away_from_a_peer_and_less_from_far(direction: str) -> None:
    rules = {"direction": direction, "separation": "repulsion", "repulsion": 1.0}
    options = PotentialFieldOptions.model_validate(rules)
    results = []
    for distance in (3.0, 30.0):
        sums = np.array([0.0, 0.0, 10.0]) if direction == "vector" else np.full(8, 1.25)
        before = sums.copy()
        repel(sums, HERE, peers((10.0, 10.0 + distance)), options)
        gained = sums - before
        results.append(-gained[1] if direction == "vector" else gained[6])
        assert np.count_nonzero(np.abs(gained) > 1e-9) == 1
    assert results[0] == pytest.approx(10.0 * math.exp(-0.09))
    assert results[1] < 0.01


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), row=st.integers(0, 29), col=st.integers(0, 29))
def test_fuzzy_coefficients_equal_their_formula(seed: int, row: int, col: int) -> None:
    passable = np.random.default_rng(seed).random((30, 30)) < 0.97
    coefficients = FuzzySectors(Terrain("t", passable, 0.5), 8, 5.5).coefficients(row, col)
    closest = np.full(8, math.inf)
    for r in range(row - 12, row + 13):
        for c in range(col - 12, col + 13):
            inside = 0 <= r < 30 and 0 <= c < 30
            if (inside and passable[r, c]) or (r, c) == (row, col):
                continue
            sector = round(math.atan2(r - row, c - col) / (math.pi / 4)) % 8
            closest[sector] = min(closest[sector], 0.5 * math.hypot(r - row, c - col))
    assert coefficients == pytest.approx(np.minimum(1.0, closest / 5.5))
