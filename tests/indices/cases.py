"""Runs and calls that use the indices of every kernel; run by `test_indices.py` where all of them are checked.

Fleets on the smallest of grounds meet what an index may leave: windows at the rim, one point, one row, one robot.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from agent.kernels import plan, surroundings
from agent.policies.found import POLICIES
from experiments.intruders.ground import ground_of
from experiments.intruders.planner import OUTSIDE, Planner
from experiments.kernels.footprints import seen_by_none
from fogwatch.inprocess import run_in_process
from monitor.page.maps import TiledMap, survey_of
from monitor.replay.replay import VisitCounter
from patrol.errors import BadInput
from patrol.ground.fog import Fog
from patrol.ground.footprint import View
from patrol.ground.ways import framed
from patrol.kernels import footprint
from patrol.kernels.tour import shorten
from patrol.kernels.ways import FAR, way_between
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Rules
from patrol.radio.message import Position, encode
from patrol.scenario import load_scenario
from tests.indices.checked import PLACES, USED, kernel_of

POINT = 0.5
MAP = f"image: m.pgm\nresolution: {POINT}\norigin: [1, -2, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
Grid = NDArray[np.bool_]


def grids(most: int) -> st.SearchStrategy[Grid]:
    """Free ground of at most so many rows and columns, at least one point of it."""

    def make(seed: int, height: int, width: int, walls: float) -> Grid:
        dice = np.random.default_rng(seed)
        free = dice.random((height, width)) >= walls
        free[dice.integers(height), dice.integers(width)] = True
        return free

    sides = st.integers(3, most)
    return st.builds(make, st.integers(0, 2**32 - 1), sides, sides, st.sampled_from([0.0, 0.05, 0.2]))


def write_map(folder: str, free: Grid) -> str:
    """Write a map, a pixel for each point, and return its name."""
    Image.fromarray(np.where(free, 254, 0).astype(np.uint8)).save(Path(folder, "m.pgm"))
    Path(folder, "m.yaml").write_text(MAP)
    return str(Path(folder, "m.yaml"))


LETTERS = [{"letter": ["first-step"], "ties": ties} for ties in ("diagonal", "straight", "drawn")]
PAPER = st.builds(
    lambda options, letter: options | letter,
    st.fixed_dictionaries(
        {
            "paths": st.sampled_from(["wave", "straight", "regions"]),
            "direction": st.sampled_from(["mode", "vector"]),
            "dilatation": st.sampled_from([0.0, 0.5, 3.0, 40.0]),
            "fow": st.sampled_from(["f1", "f3", "f5"]),
            "distance": st.sampled_from(["g1", "g3", "g4"]),
            "sectors": st.sampled_from([4, 8, 16]),
            "separation": st.sampled_from(["none", ["claims", "semaphores"], ["artificial-obstacles"]]),
        }
    ),
    st.sampled_from([{}, {"letter": ["square-window"]}, *LETTERS]),
)
OTHERS = [name for name in POLICIES.built_in if name not in ("learned", "potential-field", "stochastic")]
BOXES = st.tuples(st.floats(1.0, 5.0), st.floats(-2.0, 2.0)).map(
    lambda at: [[at[0], at[1]], [at[0] + 1.2, at[1]], [at[0] + 1.2, at[1] + 1.2], [at[0], at[1] + 1.2]]
)


def policies(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """A policy with its options."""
    options = PAPER if name == "potential-field" else st.just({})
    return st.fixed_dictionaries({"policy": st.just(name), "options": options})


@st.composite
def fleets(draw: st.DrawFn, named: list[str]) -> dict[str, Any]:
    """A scenario but for its ground."""
    policy = draw(st.sampled_from(named).flatmap(policies))
    changes = policy["options"].get("paths", "wave") == "wave" and draw(st.booleans())
    return {
        "point": POINT,
        "duration": draw(st.sampled_from([3.0, 8.0])),
        "seed": draw(st.integers(0, 999)),
        "robots": {
            "count": draw(st.integers(1, 3)),
            "model": draw(st.sampled_from(["holonomic", "differential", "car"])),
            "radius": draw(st.sampled_from([0.05, 0.2, 0.45])),
            "turning_radius": 0.4,
            "speed": 0.5,
        },
        "sensor": {
            "range": draw(st.sampled_from([0.5, 0.8, 2.0, 99.0])),
            "angle": draw(st.sampled_from([360.0, 90.0])),
            "line_of_sight": draw(st.booleans()),
            "quality": draw(st.sampled_from([1.0, 0.5])),
        },
        "patrol": {**policy, "avoidance": draw(st.sampled_from(["none", "goal-refinement"]))},
        "radio": draw(st.sampled_from([{}, {"model": "path-loss"}, {"trail": 2}])),
        "faults": draw(st.sampled_from([[], [{"kind": "loss", "at": 0, "rate": 0.4}, {"kind": "clock", "offset": 1}]])),
        "closures": [{"name": "door", "polygon": draw(BOXES), "closed": [[1, 4]]}] if changes else [],
    }


def patrol(fleet: dict[str, Any], free: Grid, share: bool) -> None:
    """Run a fleet, unless it has no room there."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            scenario = load_scenario({**fleet, "terrain": {"map": write_map(folder, free)}})
            outcome = run_in_process(scenario, share=share)
        except BadInput:
            return
    assert outcome.verdict.valid, outcome.verdict.failed


@settings(max_examples=120)
@given(free=grids(9), fleet=fleets(["potential-field"]), share=st.booleans())
def test_the_papers_policy(free: Grid, fleet: dict[str, Any], share: bool) -> None:
    patrol(fleet, free, share)


@settings(max_examples=80)
@given(free=grids(9), fleet=fleets(["stochastic", "committed"]), share=st.booleans())
def test_the_default_and_the_tour(free: Grid, fleet: dict[str, Any], share: bool) -> None:
    patrol(fleet, free, share)


@settings(max_examples=80)
@given(free=grids(9), fleet=fleets(OTHERS), share=st.booleans())
def test_rivals(free: Grid, fleet: dict[str, Any], share: bool) -> None:
    patrol(fleet, free, share)


ROOMS = """
.........
.#...##..
...#.....
.###..#..
......##.
.#.......
"""
ZONE = {"name": "z", "polygon": [[2.6, -0.4], [3.6, -0.4], [3.6, 0.6], [2.6, 0.6]]}
BY_HAND = [[[x, -2.0], [x + 6.6, -2.0], [x + 6.6, 6.8], [x, 6.8]] for x in (1.0, 7.6)]
INTRUDERS = [{"place": place, "at": 1, "for": 2} for place in ([1.7, -1.2], [8.0, -1.3], [13.5, -1.5], [8.0, 6.5])]
TOUR: dict[str, Any] = {"patrol.policy": "committed"}
PAPERS: dict[str, Any] = {"policy": "potential-field", "options": {"separation": ["claims", "repulsion"]}}


@pytest.mark.parametrize(
    "settings",
    [
        {"patrol": {**PAPERS, "options": {"paths": "regions", "separation": ["claims", "repulsion"]}}},
        {"patrol": {**PAPERS, "options": {"paths": "straight", "origin": "robot", "fuzzy": True}}, "sensor.angle": 90},
        {"patrol": {**PAPERS, "options": {"letter": ["first-step"], "ties": "drawn"}}},
        {"patrol": {**PAPERS, "options": {"letter": ["first-step"], "ties": "straight"}}, "robots.radius": 0.45},
        {"patrol": {**PAPERS, "avoidance": "goal-refinement", "refine_side": 2.5}},
        {"patrol": {**PAPERS, "options": {"paths": "regions", "regions": BY_HAND}}},
        {"zones": [{**ZONE, "weight": 4.0}], "robots.count": 2, "duration": 3.0, "faults": []},
        {"zones": [{**ZONE, "keep_out": True}], "radio": {"trail": 3, "model": "path-loss"}, **TOUR},
        {"intruders": INTRUDERS, "duration": 3.0, "faults": []},
        {"radio.adaptive": {"error": 1, "silence": 3}, **TOUR},
    ],
)
def test_features(settings: dict[str, Any], tmp_path: Path) -> None:
    rooms = np.array([[square == "." for square in line] for line in ROOMS.split()])
    free = np.kron(rooms, np.ones((3, 3), dtype=np.bool_))
    fleet: dict[str, Any] = {
        "point": POINT,
        "duration": 7.0,
        "robots.count": 2,
        "robots.radius": 0.2,
        "robots.speed": 1.0,
    }
    fleet |= {"robots.turning_radius": 0.4, "sensor.range": 2.0, "terrain": {"map": write_map(str(tmp_path), free)}}
    faults = [{"kind": "loss", "at": 0, "for": 15, "rate": 0.4}, {"kind": "range", "at": 5, "for": 9, "reach": 3.0}]
    outcome = run_in_process(load_scenario({}, {**fleet, "faults": faults, **settings}), share=False)
    assert outcome.verdict.valid, outcome.verdict.failed


SEEDS = st.integers(0, 2**32 - 1)
RADII = st.floats(0.0, 13.0) | st.integers(1, 13).map(lambda whole: whole - 9e-10)


@given(free=grids(9), row=st.integers(-3, 12), col=st.integers(-3, 12), radius=RADII, angle=st.floats(0, 6))
def test_views_from_on_and_off_the_ground(free: Grid, row: int, col: int, radius: float, angle: float) -> None:
    reach = int(radius + 1e-9)
    view = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=np.uint8)
    for kernel in (footprint.cast, footprint.disc):
        kernel(free.view(np.uint8), row, col, radius, view, row - reach, col - reach)
    footprint.keep_sector(view, angle, angle)


@given(seed=SEEDS, stations=st.integers(1, 9), robots=st.integers(1, 4))
def test_plans_and_tours(seed: int, stations: int, robots: int) -> None:
    """Robots may have nothing to visit, and a station may have no other one near."""
    dice = np.random.default_rng(seed)
    apart = dice.integers(0, 99, (stations, stations)).astype(np.int32)
    apart += apart.T
    shorten(apart, dice.permutation(stations))
    parts = np.array_split(dice.permutation(stations), robots)
    routes, counts = np.zeros((robots, stations), dtype=np.int64), np.array([len(part) for part in parts])
    for robot, part in enumerate(parts):
        routes[robot, : len(part)] = part
    near = np.argsort(apart, axis=1)
    near = np.ascontiguousarray(near[:, 1:9] if stations > 1 else near)
    paces, ages = dice.uniform(0.5, 2.0, robots), dice.uniform(0, 60, stations)
    rates = dice.uniform(0.5, 2.0, stations)
    inputs = (dice.random((robots, stations)), apart.astype(float), paces, ages, rates, near, 60, seed)
    pinned = dice.random(robots) < 0.5
    choices = dice.permutation(stations)
    plans, costs = np.zeros((stations, robots, stations), dtype=np.int64), np.zeros(stations)
    plan.compare(
        routes, counts, pinned, 0, choices, *inputs, plans, np.zeros((stations, robots), dtype=np.int64), costs
    )
    plan.improve(routes, counts, pinned, *inputs)


def ticks_and_counts(seed: int, free: Grid) -> tuple[NDArray[np.int32], Grid]:
    """The tick at which each point was last seen, up to 20, and those points that count, at least one."""
    dice = np.random.default_rng(seed)
    counts = dice.random(free.shape) < 0.7
    counts[dice.integers(free.shape[0]), dice.integers(free.shape[1])] = True
    return dice.integers(-1, 21, free.shape).astype(np.int32), counts


@given(heard=st.lists(st.tuples(st.integers(1, 4), st.integers(0, 9)), max_size=6))
def test_what_is_heard(heard: list[tuple[int, int]]) -> None:
    """A robot may hear nobody, itself, a stranger and too old frames."""
    inboxes = Inboxes([1], Rules((1, 2, 3), (0.0, 0.0, 9.0, 9.0), 10.0))
    for tick in (9, 10):
        inboxes.hear(tick, {1: [encode(Position.of(number, k, 0.0, Pose(4.0, 4.0, 0.0))) for number, k in heard]})
        assert len(inboxes.peers(1).columns.places) == len({number for number, _ in heard} & {2, 3})


@given(seed=SEEDS, free=grids(9), half=st.integers(0, 6), up=st.integers(-3, 12), across=st.integers(-3, 12))
def test_surroundings_of_a_learned_policy(seed: int, free: Grid, half: int, up: int, across: int) -> None:
    """The robot may be off the grid, alone, and nobody may be heard."""
    last_seen, counts = ticks_and_counts(seed, free)
    dice = np.random.default_rng(seed)
    window = np.empty((2, 2 * half + 1, 2 * half + 1), dtype=np.float32)
    surroundings.fill_window(last_seen, counts, free, up, across, 20, 1, window)
    ways, sums = np.empty(8, dtype=np.int64), np.empty((8, 4), dtype=np.int64)
    rays = np.array([[[k * row, k * col] for k in range(1, half + 1)] for row in (-1, 0, 1) for col in (-1, 0, 1)])[:8]
    surroundings.count_free(free, up, across, rays.reshape(8, half, 2), ways)
    surroundings.sum_ages(last_seen, counts, up, across, half, 20, sums)
    places = dice.uniform(-9.0, 9.0, (int(dice.integers(0, 4)), 2))
    features, heard = np.empty((8, 5), dtype=np.float32), np.empty((half, 4), dtype=np.float32)
    surroundings.fill_features(sums, 20, ways, max(half, 1), places, 0.0, 0.0, 5.0, 1.0, 0.0, features)
    surroundings.fill_heard(places, np.arange(len(places)), 0.0, 0.0, 9.0, 20, 10.0, heard)


@given(seed=SEEDS, free=grids(40))
def test_maps_of_the_page(seed: int, free: Grid) -> None:
    last_seen, counts = ticks_and_counts(seed, free)
    survey_of(last_seen, counts, 20)
    survey_of(last_seen, np.zeros_like(counts), 20)
    tiled = TiledMap(0, free.shape)
    for k in range(3):
        tiled.update(np.where(free, k, last_seen), k)
    tiled.packet(1)


@given(seed=SEEDS, free=grids(9))
def test_ways_between_two_points(seed: int, free: Grid) -> None:
    """No way may lead from one point to the other."""
    dice = np.random.default_rng(seed)
    is_open = framed(free)
    first, last = dice.choice(np.flatnonzero(is_open), 2).tolist()
    length, queues = np.full(is_open.shape, FAR, dtype=np.int32), np.empty((2, is_open.size, 2), dtype=np.int32)
    way_between(is_open, first, last, length, queues, np.empty(is_open.size, dtype=np.int32))
    assert (length == FAR).all()


@given(seed=SEEDS, free=grids(9), side=st.integers(0, 4), row0=st.integers(-12, 12), col0=st.integers(-12, 12))
def test_visits_of_a_replay(seed: int, free: Grid, side: int, row0: int, col0: int) -> None:
    """Footprints lie over the rim, beside the ground, and the last tick is looked at."""
    counter, fog = VisitCounter(ticks_and_counts(seed, free)[1], 6), Fog(ticks_and_counts(seed, free)[1])
    mask = (np.random.default_rng(seed).random((2 * side + 1, 2 * side + 1)) < 0.8).astype(np.uint8)
    for k in (0, 1, 4, 5):
        view = View(row0 % (k + 1), col0, mask)
        counter.before(k, fog, [view])
        fog.observe(view, k)
        counter.after(k, fog)
    counter.result()


@given(seed=SEEDS, free=grids(6), speed=st.sampled_from([0.5, 1.0, 2.0]), stay=st.integers(1, 9))
def test_an_intruders_way(seed: int, free: Grid, speed: float, stay: int) -> None:
    dice = np.random.default_rng(seed)
    ground = ground_of(free, 1.0)
    size = len(ground.rows)
    for start in (OUTSIDE, int(dice.integers(size))):
        chances = dice.choice([0.0, 0.25, 1.0], (9, size)).astype(np.float32)
        Planner(ground, 0.5, speed, stay * 0.5).plan(chances, start, int(dice.integers(size)))


@given(seed=SEEDS, robots=st.integers(0, 3), size=st.integers(1, 9), ahead=st.integers(0, 4))
def test_points_that_robots_may_see(seed: int, robots: int, size: int, ahead: int) -> None:
    dice = np.random.default_rng(seed)
    counts = dice.integers(0, size + 1, 5)
    points = np.concatenate([dice.permutation(size)[:count] for count in counts]).astype(np.int32)
    looks = dice.integers(0, 5, (ahead + 3, max(robots, 1))).astype(np.int32)
    samples = dice.integers(0, 2, (robots, 3)), dice.integers(0, max(robots, 1), (robots, 3))
    out = np.empty((ahead, size), dtype=np.float32)
    seen_by_none(looks, np.append(0, counts.cumsum()), points, *samples, out)


def test_every_kernel_was_used() -> None:
    """Last, for it counts what the tests above have reached: each kernel, and nearly all of their indices."""
    assert not sorted({kernel_of(place) for place in PLACES} - {kernel_of(place) for place in USED})
    assert len(USED) >= 0.97 * len(PLACES), "\n".join(sorted(PLACES - USED))
