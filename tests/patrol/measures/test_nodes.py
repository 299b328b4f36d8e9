import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from patrol.graph import graph_of
from patrol.journal.records import Status
from patrol.measures.nodes import NodeTotals
from patrol.random import draw
from patrol.summary.metric import metrics_of
from patrol.summary.model import NodeFigures
from tests.present import present

GRAPH = graph_of([(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)], [(0, 1, 10.0), (1, 2, 10.0)])


def record(k: int, *places: tuple[float, float]) -> Any:
    rows = [SimpleNamespace(number=n, status=Status.ALIVE, x=x, y=y) for n, (x, y) in enumerate(places, 1)]
    return SimpleNamespace(k=k, robots=rows)


def figures(*ways: list[float]) -> dict[str, Any]:
    """Robots on the x axis, a place for each tick of 1 s."""
    totals = NodeTotals(GRAPH, dict.fromkeys(range(1, len(ways) + 1), 0.4), 1.0)
    for k, places in enumerate(zip(*ways, strict=True)):
        totals.tick(record(k, *((x, 0.0) for x in places)))
    found = totals.figures()
    assert found is not None
    return found


def test_idleness_in_both_families() -> None:
    # Vertex 0 is visited at 0 and 4 s, 1 at 2 and 6 s (in passing, between two ticks), 2 never.
    found = figures([0.0, 5.0, 12.0, 5.0, 0.0, 5.0, 12.0])
    idle = [[0, 1, 2, 3, 0, 1, 2], [0, 1, 0, 1, 2, 3, 0], [0, 1, 2, 3, 4, 5, 6]]
    idle[1][3] = 0  # on the way back it passes by again
    idle[1][4:] = [1, 2, 0]
    assert found["idleness_mean_s"] == pytest.approx(sum(map(sum, idle)) / 21)
    assert found["idleness_end_s"] == pytest.approx((2 + 0 + 6) / 3)
    assert found["idleness_late_s"] == pytest.approx(sum(sum(each[3:]) for each in idle) / 12)
    assert found["worst_s"] == 6.0
    assert found["worst_mean_s"] == pytest.approx(sum(max(each) for each in zip(*idle, strict=True)) / 7)
    assert found["worst_end_s"] == 6.0
    assert (found["visits"], found["unvisited"], found["once"], found["least_visits"]) == (5, [2], [], 0)
    # Visits to 0 end 0 and 4 s, those to 1 end 2, 2 and 3 s: the first ones do not count, and 2 has a mean of 0.
    assert found["visits_mean_s"] == pytest.approx((4.0 + 2.0 + 0.0) / 3)


def test_a_robot_that_stays_visits_once() -> None:
    found = figures([0.0, 0.0, 0.0, 10.0, 0.0])
    assert found["visits"] == 3
    assert found["return_s"] == [2.0] * 7, "left at 2 s, back at 4 s"
    assert (found["return_mean_s"], found["return_deviation_s"]) == (2.0, 0.0)
    # Means over visits are 2, 0 and 0 s: two vertices are not visited again.
    assert (found["visits_worst_s"], found["visits_median_s"]) == (2.0, 0.0)
    assert found["visits_mean_s"] == pytest.approx(2 / 3)
    assert found["visits_deviation_s"] == pytest.approx(math.sqrt(8 / 9))
    assert (found["unvisited"], found["once"]) == ([2], [1])


def test_return_times_are_told_by_their_whole_distribution() -> None:
    """The robot comes back after 10, 20, ... 110 s, in another order, and between two ends of a stay it stands."""
    returns = [70, 10, 110, 40, 90, 20, 60, 100, 30, 80, 50]
    found = figures([0.0, *(x for ticks in returns for x in [5.0] * (ticks - 1) + [0.0])])
    assert found["return_s"] == [10.0, 20.0, 35.0, 60.0, 85.0, 100.0, 110.0]
    assert found["return_mean_s"] == 60.0


def test_the_median_of_two_vertices_in_the_middle_is_half_way_between_them() -> None:
    four = graph_of([(10.0 * n, 0.0) for n in range(4)], [(n, n + 1, 10.0) for n in range(3)])
    totals = NodeTotals(four, {1: 0.4}, 1.0)
    for k, x in enumerate([0.0, 5.0, 0.0, 10.0, 15.0, 15.0, 15.0, 10.0, 20.0, 25.0, 25.0, 20.0]):
        totals.tick(record(k, (x, 0.0)))
    found = present(totals.figures())
    # Vertices 0, 1, 2 and 3 are come back to after 2, 4, 3 and no seconds, the last as a mean of 0.
    assert found["visits_median_s"] == 2.5


def test_a_robot_at_just_the_distance_of_a_visit_visits_once() -> None:
    assert figures([0.4, 0.4, 0.4])["visits"] == 1
    assert figures([0.41, 0.41, 0.41])["visits"] == 0
    assert figures([0.4, 0.41, 0.4])["visits"] == 2


def test_robots_interfere_at_most_once_in_ten_seconds() -> None:
    near, far = [0.0] * 25, [2.0] * 25
    assert figures(near, far)["interference"] == 3, "at 0, 10 and 20 s"
    assert figures(near, far)["interference_per_min"] == pytest.approx(3 * 60 / 25)
    assert [figures(near[:ticks], far[:ticks])["interference"] for ticks in (10, 11, 20, 21)] == [1, 2, 2, 3]
    assert figures(near, [2.1] * 25)["interference"] == 0
    assert figures(near, near, near)["interference"] == 6, "the second and the third robot, not each pair"


def test_the_bytes_of_the_original_are_counted_at_visits() -> None:
    def sent(policy: str) -> int | None:
        totals = NodeTotals(GRAPH, {1: 0.4}, 1.0, policy)
        for k, x in enumerate((0.0, 10.0, 20.0)):
            totals.tick(record(k, (x, 0.0)))
        found = totals.figures()
        assert found is not None
        sent_bytes: int | None = found["original_bytes"]
        return sent_bytes

    # Three visits; on a graph of three vertices dtag sends 3 + 3 words of two bytes.
    assert [sent(policy) for policy in ("cr", "gbs", "sebs", "dtag")] == [0, 18, 24, 36]
    assert sent("committed") is None


def test_the_entropy_rate_is_that_of_the_next_vertex() -> None:
    assert str(figures([0.0, 10.0, 0.0, 10.0, 0.0])["entropy_bits"]) == "0.0"  # and not -0.0
    # From 1 to 0 and to 2, each twice, and from both back to 1: half of the moves are worth one bit.
    mixed = figures([10.0, 0.0, 10.0, 20.0, 10.0, 0.0, 10.0, 20.0, 10.0])["entropy_bits"]
    assert mixed == pytest.approx(0.5 * -math.log2(0.5))


def test_every_measure_is_declared_in_order() -> None:
    assert list(figures([0.0, 10.0])) == [key for key, _ in metrics_of(NodeFigures)]


def test_measures_of_random_ways_are_those_of_the_visits() -> None:
    """Three robots step at random along the axis; everything is counted again from a table of ticks and vertices."""
    line = 400
    steps = [[round(4.0 * draw(7, robot, k) - 2.0) for k in range(line)] for robot in range(3)]
    ways = [[float(abs((x + 20) % 40 - 20)) for x in np.cumsum(each).tolist()] for each in steps]
    found = figures(*ways)
    at = np.array([0.0, 10.0, 20.0])
    last, idle = np.zeros(3), np.zeros((line, 3))
    ends: list[list[float]] = [[], [], []]
    inside, counts = [set[int]()] * 3, [0, 0, 0]
    for k in range(line):
        for robot, way in enumerate(ways):
            begin, end = way[max(k - 1, 0)], way[k]
            passed = (np.abs(at - 0.5 * (begin + end)) <= 0.5 * abs(end - begin) + 0.4) & (
                (at - begin) * (end - begin) > 0
            )
            for vertex in np.flatnonzero((np.abs(at - end) <= 0.4) | passed).tolist():
                if vertex not in inside[robot]:
                    ends[vertex].append(k - last[vertex])
                    counts[vertex] += 1
                last[vertex] = k
            inside[robot] = set(np.flatnonzero(np.abs(at - way[k]) <= 0.4).tolist())
        idle[k] = k - last
    half, means = line // 2, [np.mean(each[1:]) for each in ends]
    returns = np.sort(np.concatenate([each[1:] for each in ends]))
    ranks = np.arange(returns.size) / (returns.size - 1) * 100.0
    expected = {
        "visits": sum(counts),
        "least_visits": min(counts),
        "unvisited": [],
        "once": [],
        "idleness_mean_s": idle.mean(),
        "idleness_late_s": idle[half:].mean(),
        "idleness_end_s": idle[-1].mean(),
        "worst_mean_s": idle.max(axis=1).mean(),
        "worst_s": idle.max(),
        "worst_late_s": idle[half:].max(),
        "worst_end_s": idle[-1].max(),
        "visits_mean_s": np.mean(means),
        "visits_worst_s": max(means),
        "visits_median_s": np.median(means),
        "visits_deviation_s": np.std(means),
        "return_s": [np.interp(percent, ranks, returns) for percent in (0, 10, 25, 50, 75, 90, 100)],
        "return_mean_s": returns.mean(),
        "return_deviation_s": returns.std(),
    }
    assert {key: found[key] for key in expected} == {
        key: value if isinstance(value, list) and not value else pytest.approx(value) for key, value in expected.items()
    }
    assert idle[:half].max() > idle[half:].max(), "so that the wrong half shows"


def test_a_robot_that_comes_back_elsewhere_has_visited_nothing_on_the_way() -> None:
    totals = NodeTotals(GRAPH, {1: 0.4}, 1.0)
    totals.tick(record(0, (0.0, 0.0)))
    totals.tick(record(1))
    totals.tick(record(2, (20.0, 0.0)))
    assert [(visit.vertex, visit.at_s) for visit in totals.visits] == [(0, 0.0), (2, 2.0)]
