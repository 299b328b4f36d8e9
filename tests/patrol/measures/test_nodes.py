from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from patrol.graph import graph_of
from patrol.journal.records import Status
from patrol.measures.nodes import NodeTotals
from patrol.summary.metric import metrics_of
from patrol.summary.model import NodeFigures

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
    assert figures([0.0, 10.0, 0.0, 10.0, 0.0])["entropy_bits"] == 0.0
    # From 1 to 0 and to 2, each twice, and from both back to 1: half of the moves are worth one bit.
    mixed = figures([10.0, 0.0, 10.0, 20.0, 10.0, 0.0, 10.0, 20.0, 10.0])["entropy_bits"]
    assert mixed == pytest.approx(0.5 * -math.log2(0.5))


def test_every_measure_is_declared_in_order() -> None:
    assert list(figures([0.0, 10.0])) == [key for key, _ in metrics_of(NodeFigures)]
