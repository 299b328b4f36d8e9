"""Paths through regions against a plain Dijkstra, and patrols on them."""

import heapq
import itertools
import math
import statistics
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.kernels.wave import FAR, SETTLED, STATUS
from agent.routes.ground import Ground
from agent.routes.region_paths import Regions
from fogwatch.inprocess import run_in_process
from patrol.ground.terrain import Terrain
from patrol.prepare import Prepared, prepare
from patrol.regions.split import RegionSplit, split_regions
from patrol.scenario import Scenario, load_scenario
from tests.present import present

Bools = NDArray[np.bool_]
Place = tuple[int, int]


class Reference:
    """The region method's path lengths, straight from its formula; places are (row, col), lengths in points."""

    def __init__(self, split: RegionSplit) -> None:
        self.parts = split.parts
        width = split.parts.shape[1]
        self.links = [(divmod(link.points[0], width), link.parts) for link in split.connections]

    def from_place(self, start: Place) -> dict[int, float]:
        """Length of the shortest way from a place to each connection that can be reached."""
        links = enumerate(self.links)
        heap = [(math.dist(start, place), n) for n, (place, parts) in links if self.parts[start] in parts]
        heapq.heapify(heap)
        found: dict[int, float] = {}
        while heap:
            away, number = heapq.heappop(heap)
            if number in found:
                continue
            found[number] = away
            place, parts = self.links[number]
            for other, (there, others) in enumerate(self.links):
                if set(parts) & set(others):
                    heapq.heappush(heap, (away + math.dist(place, there), other))
        return found

    def length(self, start: Place, ways: dict[int, float], target: Place) -> float:
        """Length of the path from the start to a target, infinity where there is none."""
        if self.parts[start] == self.parts[target]:
            return math.dist(start, target)
        part = self.parts[target]
        ends = [(away, *self.links[number]) for number, away in ways.items()]
        lengths = [away + math.dist(place, target) for away, place, parts in ends if part in parts]
        return min(lengths, default=math.inf)


def any_place(mask: Bools, seed: int) -> Place:
    places = np.argwhere(mask)
    row, col = places[seed % len(places)]
    return int(row), int(col)


def random_ground(seed: int) -> tuple[Terrain, Bools, RegionSplit, Place]:
    """A terrain of random boxes, where on most of it a body fits, the regions of that, and a start."""
    height, width = 40, 46
    rng = np.random.default_rng(seed)
    free = np.ones((height, width), dtype=np.bool_)
    for _ in range(rng.integers(0, 12)):
        row, col = rng.integers(0, height), rng.integers(0, width)
        free[row : row + rng.integers(1, 16), col : col + rng.integers(1, 16)] = False
    free[0, 0] = True
    terrain, body = Terrain("made", free, 1.0), free & (rng.random(free.shape) > 0.02)
    return terrain, body, split_regions(terrain, body), any_place(body, seed)


def paths_from(terrain: Terrain, body: Bools, split: RegionSplit, start: Place, span: int, *limits: int) -> Regions:
    paths = Regions(terrain.height, terrain.width, span, split)
    paths.begin(Ground(terrain, body), start[0] + 1, start[1] + 1)
    for limit in limits:
        paths.extend(limit)
    return paths


def settled(paths: Regions) -> dict[Place, tuple[int, Place]]:
    """Length and first bend of the known paths, by target."""
    found = {}
    for row, col in np.argwhere(paths.state & STATUS == SETTLED):
        up, across = divmod(int(paths.bend[row, col]), paths.state.shape[1])
        target = (int(row) + paths.row0, int(col) + paths.col0)
        found[target] = (int(paths.length[row, col]), (up + paths.row0, across + paths.col0))
    return found


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_lengths_are_those_of_the_formula(seed: int) -> None:
    terrain, body, split, start = random_ground(seed)
    reference = Reference(split)
    ways = reference.from_place(start)
    found = settled(paths_from(terrain, body, split, start, 400, 40_000))
    for row, col in np.argwhere(body):
        target = (int(row), int(col))
        length = reference.length(start, ways, target)
        if length == math.inf:
            assert target not in found
        else:
            assert found[target][0] == pytest.approx(100.0 * length, abs=0.51)
    assert set(found) <= {(int(row), int(col)) for row, col in np.argwhere(body)}


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_bends_are_the_first_connections_of_shortest_paths(seed: int) -> None:
    terrain, body, split, start = random_ground(seed)
    reference = Reference(split)
    places = {place for place, _ in reference.links}
    for target, (length, bend) in settled(paths_from(terrain, body, split, start, 400, 40_000)).items():
        if split.parts[target] == split.parts[start]:
            assert bend == target
            continue
        assert bend == target or bend in places
        assert bend != start
        onward = reference.length(bend, reference.from_place(bend), target)
        # A connection lies in both its regions.
        sides = {part for place, parts in reference.links if place == bend for part in parts}
        if split.parts[target] in sides:
            onward = math.dist(bend, target)
        assert 100.0 * (math.dist(start, bend) + onward) == pytest.approx(length, abs=0.51)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), first=st.integers(0, 4000), last=st.integers(0, 4000))
def test_a_limit_settles_just_the_shorter_paths(seed: int, first: int, last: int) -> None:
    terrain, body, split, start = random_ground(seed)
    everything = settled(paths_from(terrain, body, split, start, 400, 40_000))
    limit = max(first, last)
    near = settled(paths_from(terrain, body, split, start, -(-limit // 100), first, limit))
    assert near == {target: path for target, path in everything.items() if path[0] <= limit}


def test_who_stands_on_a_connection_is_in_both_regions() -> None:
    terrain, body, split, _ = random_ground(3)
    assert len(split.connections) > 3
    for link in split.connections:
        start = divmod(link.points[0], terrain.width)
        found = settled(paths_from(terrain, body, split, start, 400, 40_000))
        for target, (length, bend) in found.items():
            if split.parts[target] in link.parts:
                assert (length, bend) == (round(100.0 * math.dist(start, target)), target)
            if target != start:
                assert bend != start


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 4))
def test_lengths_from_several_starts_are_the_least_of_each(seed: int, count: int) -> None:
    terrain, body, split, _ = random_ground(seed)
    starts = [any_place(body, seed + 7919 * number) for number in range(count)]
    ground = Ground(terrain, body)
    paths = Regions(terrain.height, terrain.width, 400, split)
    each = []
    for row, col in starts:
        paths.begin(ground, row + 1, col + 1)
        paths.extend(2500)
        each.append(np.where(paths.state & STATUS == SETTLED, paths.length, FAR))
    framed = [(row + 1, col + 1) for row, col in starts]
    assert np.array_equal(paths.lengths_from(ground, *framed[0], framed, 2500), np.minimum.reduce(each))


def test_a_start_in_no_region_has_no_paths() -> None:
    terrain, body, split, _ = random_ground(5)
    start = any_place(~body & terrain.free, 0)
    assert settled(paths_from(terrain, terrain.free, split, start, 400, 40_000)) == {}


# --- patrols ---------------------------------------------------------------------------------------------------------


def scenario(terrain: str, model: str, ticks: int, seed: int = 7, **options: object) -> Scenario:
    facts = {"terrain": {"builtin": terrain}, "point": 0.5, "seed": seed, "duration": 0.5 * ticks}
    patrol = {"policy": "potential-field", "options": {"paths": "regions", **options}}
    return load_scenario({**facts, "robots": {"count": 3, "model": model}, "patrol": patrol})


QUICK = ("yards", "car", "mode"), ("clutter", "holonomic", "vector")


@pytest.mark.parametrize(
    ("terrain", "model", "direction"),
    [
        pytest.param(*case, marks=() if case in QUICK else pytest.mark.accept)
        for case in itertools.product(("yards", "clutter"), ("car", "holonomic"), ("mode", "vector"))
    ],
)
def test_patrols_on_regions_see_everything(terrain: str, model: str, direction: str) -> None:
    outcome = run_in_process(scenario(terrain, model, 800, direction=direction))
    assert outcome.verdict.valid, outcome.verdict.failed
    assert outcome.summary.seen_share == 1.0


def test_open_ground_is_one_region_and_patrolled_much_as_on_straight_paths() -> None:
    """The same but for the rim, where no body fits: its points pull from their posts or from where they are."""

    def fog_mean_s(paths: str) -> float:
        """Over four seeds: one run differs from the next by a third."""
        found = []
        for seed in range(1, 5):
            run = scenario("open", "holonomic", 600, seed=seed, paths=paths)
            found.append(run_in_process(run, verify_fog=False).summary.fog_mean_s or 0.0)
        return statistics.fmean(found)

    assert fog_mean_s("regions") == pytest.approx(fog_mean_s("straight"), rel=0.15)


def test_claims_work_over_regions() -> None:
    outcome = run_in_process(scenario("yards", "holonomic", 300, separation="claims"))
    assert outcome.verdict.valid, outcome.verdict.failed
    assert outcome.summary.seen_share > 0.9


def test_a_saved_split_gives_the_same_trace(tmp_path: Path) -> None:
    wanted = scenario("yards", "car", 60)
    prepared = prepare(wanted)
    prepared.save(tmp_path)
    ends = [run_in_process(each).journal.end for each in (prepared, Prepared.load(wanted, tmp_path))]
    assert ends[0] is not None
    assert ends[0].trace_hash == present(ends[1]).trace_hash
