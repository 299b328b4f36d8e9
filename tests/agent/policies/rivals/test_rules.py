"""The rules of the rivals against their formulas, worked out by hand on a small graph.

        3 ---12--- 0 ---10--- 1 ---20--- 2          lengths in m; 1 and 3 are joined as well, 5 m

The robot is at 1, at time 100 s. The vertices were visited at 60, 100, 20 and 90 s: idle for 40, 0, 80 and 10 s.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from agent.policies.found import POLICIES
from agent.policies.rivals.known import Known, Other
from patrol.classes.named_class import NamedClass, find
from patrol.graph.graph import graph_of
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from tests.agent.minds import setup_of

PLACES = ((12.0, 5.0), (22.0, 5.0), (42.0, 5.0), (20.0, 9.6))
EDGES = ((0, 1, 10.0), (1, 2, 20.0), (1, 3, 5.0), (0, 3, 12.0))
VISITED_S = (60.0, 100.0, 20.0, 90.0)
PIXEL = 0.1
SPEED = 1.0


def policy(name: str, **options: Any) -> Any:
    """A rival on a graph of its own; 1 m/s, three robots."""
    scenario = load_scenario(
        {
            "terrain": {
                "builtin": "open",
                "graph": {"vertices": [list(place) for place in PLACES], "edges": [list(edge) for edge in EDGES]},
            },
            "point": 1.0,
            "robots": {"count": 3, "model": "holonomic", "speed": SPEED},
            "patrol": {"policy": name, **({"options": options} if options else {})},
        }
    )
    found = find(NamedClass(POLICIES, name, None, options))
    return found(setup_of(prepare(scenario)))


def known(*others: Other, draw: float = 0.0) -> Known:
    """What the robot knows; other robots are numbered from 2 on."""
    return Known(
        graph_of(PLACES, EDGES, PIXEL),
        0.4,
        0.5,
        1,
        3,
        at=1,
        now_s=100.0,
        visited_s=np.array(VISITED_S),
        own_s=np.array((30.0, 100.0, 40.0, 20.0)),
        found_s=np.zeros(4),
        others=dict(enumerate(others, 2)),
        draw=lambda _: draw,
    )


def going_to(vertex: int, at: int = 0, place: tuple[float, float] = (12.0, 5.0)) -> Other:
    return Other(place, 200, at, vertex)


def test_random_takes_each_neighbour_as_likely() -> None:
    # Neighbours in the order of the edges: 0, 2, 3.
    assert [list(policy("random").route(known(draw=draw))) for draw in (0.0, 0.34, 0.99)] == [[0], [2], [3]]


def test_cr_knows_its_own_visits_only() -> None:
    # By itself: 70 s, 60 s and 80 s ago.
    assert list(policy("cr").route(known())) == [3]


def test_hcr_adds_idleness_and_nearness() -> None:
    # 0: (20 - 10) / 20 + 40 / 80 = 1; 2: 0 + 1 = 1; 3: 15 / 20 + 10 / 80 = 0.875. 0 and 2 are equal.
    assert [list(policy("hcr").route(known(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]


def test_hpcc_looks_at_all_vertices_and_goes_by_stale_ones() -> None:
    # The longest way of the graph is from 2 to 0, 30 m.
    # 0: 20 / 30 + 40 / 80 = 1.17; 2: 10 / 30 + 1 = 1.33; 3: 25 / 30 + 10 / 80 = 0.96.
    assert list(policy("hpcc").route(known())) == [2]
    # From 2 with 3 as stale as can be. Over 1: (80 - 0) / 80 + 15 / 15 = 2, then 0 + 0; nothing else leads there.
    away = known()
    away.at, away.visited_s = 2, np.array((60.0, 100.0, 99.0, 20.0))
    assert list(policy("hpcc").route(away)) == [1, 3]


def test_greedy_takes_the_greatest_idleness_per_way() -> None:
    # 40 / 10 = 4, 80 / 20 = 4, 10 / 5 = 2.
    assert [list(policy("greedy").route(known(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]
    later = known()
    later.visited_s[2] = 19.0
    assert list(policy("greedy").route(later)) == [2]


def test_gbs_weighs_idleness_per_edge_in_pixels() -> None:
    chosen, rule = known(), policy("gbs")
    # 0: 40 s / 100 px = 0.4; G1 exp(ln(10) / 100 * 0.4).
    assert rule.chance(chosen, 0) == pytest.approx(0.1 * math.exp(math.log(10.0) * 0.4 / 100.0))
    assert rule.chance(chosen, 3) == pytest.approx(0.1 * math.exp(math.log(10.0) * 0.2 / 100.0))
    # With edge_min 150 px, 0 gains 40 / 150 and 2 gains 80 / 200.
    assert list(policy("gbs", edge_min=150.0).route(chosen)) == [2]
    assert policy("gbs", g2=0.3).chance(chosen, 0) == 1.0


def test_sebs_keeps_away_from_where_others_go() -> None:
    rule = policy("sebs")
    # 0 and 2 gain the same. One other robot that goes to 0 makes that 2^(3 - 1) / (2^3 - 1) = 4 / 7 of it.
    assert list(rule.route(known(going_to(0)))) == [2]
    assert list(rule.route(known(going_to(2)))) == [0]
    # Two that go to 0 and one to 2: 2 / 7 against 4 / 7, and 3 has nearly the whole of it.
    assert list(rule.route(known(going_to(0), going_to(2)))) == [3]


def test_cbls_leaves_out_what_others_aim_at_and_learns_from_visits() -> None:
    rule = policy("cbls")
    # All means are the present idleness. Priors: 0 is 3/4 40 + 1/4 10, 2 has one neighbour only: 80; arcs are equal.
    assert list(rule.route(known())) == [2]
    assert list(rule.route(known(going_to(2)))) == [0]


def test_cbls_rewards_the_arc_to_the_vertex_that_is_visited_least() -> None:
    rule = policy("cbls")
    rule.route(known())
    rule._visits = [4, 1, 0, 1]
    after = known()
    after.at = 2
    rule.route(after)
    # Per neighbour: 0 has 4 / 2, 2 has 1 / 1 with the visit that has just been, 3 has 1 / 2.
    assert rule._arcs[1, 3] > 1.0
    assert rule._arcs[1, 0] < 1.0
    assert rule._arcs[1, 2] == 1.0


def test_er_expects_the_idleness_at_its_arrival() -> None:
    rule = policy("er")
    # 0: (110 - 60) / 10 = 5; 2: (120 - 20) / 20 = 5; 3: (105 - 90) / 5 = 3.
    assert [list(rule.route(known(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]
    # Another robot, 4 m from 0, is there at 104: |110 - 104| / 10 = 0.6.
    assert list(rule.route(known(going_to(0, at=3, place=(12.0, 9.0))))) == [2]


def test_mns_sums_three_parts() -> None:
    def score(idle: float, away: float) -> float:
        total = 0.0
        for a, b, s in ((0.41935197, -1.036573603, -0.21384633), (1.02416510, -0.262816527, 2.57125805)):
            x = a * idle + b * away
            total += x if x > 0 else s * x
        x = -0.43140551 * idle - 0.027082452 * away
        return total + (x if x > 0 else 0.48526923 * x)

    scores = {0: score(0.5, 0.5), 2: score(1.0, 1.0), 3: score(0.125, 0.25)}
    best = max(scores, key=lambda vertex: scores[vertex])
    rule = policy("mns")
    assert list(rule.route(known(going_to(1)))) == [best]
    assert list(rule.route(known(going_to(best)))) != [best]
    # A robot alone looks at the whole graph and takes the first step there.
    assert list(rule.route(known())) == [best]


def test_dtag_stays_near_its_start_and_takes_what_nobody_else_takes() -> None:
    # From 1, where it starts: 0: 40 - 0.75 100 - 5 10 = -85; 2: 80 - 150 - 100 = -170; 3: 10 - 37.5 - 5 5.02 = -52.6.
    rule = policy("dtag")
    assert list(rule.route(known())) == [3]
    assert list(rule.route(known(going_to(3)))) == [0]


def test_dtap_takes_the_best_vertex_that_no_other_robot_is_nearer_to() -> None:
    rule = policy("dtap")
    # All three are one edge away: 8 off each. 2 is best; a robot at 2 would bid 0 for it, and one at 3 25 m.
    assert list(rule.route(known())) == [2]
    assert list(rule.route(known(Other((20.0, 9.6), 200, 3)))) == [2]
    # A robot at 2 is nearer, and 80 s is less than the mean of 32.5 and two deviations, 31.1 each.
    assert list(rule.route(known(Other((42.0, 5.0), 200, 2)))) == [0]


def test_a_tour_leads_to_every_vertex_once_a_round() -> None:
    rule = policy("tour")
    at = known()
    round_of = [rule.route(at)[0] for _ in range(8)]
    assert round_of[0] == 1
    assert sorted(round_of[:4]) == [0, 1, 2, 3]
    assert round_of[:4] == round_of[4:]


def test_an_even_tour_waits_for_what_is_missing_to_an_equal_share() -> None:
    rule = policy("even-tour")
    # 2 lies at the end of a dead end, so the tour leads there once; a round takes 10 + 20 + 20 + 5 + 12 = 67 s.
    at = known(going_to(0))
    rule._next, at.at = rule.tour.index(2), 2
    at.found_s = np.array((0.0, 0.0, 10.0, 0.0))
    assert list(rule.route(at)) == []
    at.now_s += 67.0 / 2 - 10.0 - 0.5
    assert list(rule.route(at)) == []
    at.now_s += 1.0
    assert len(rule.route(at)) == 1


def test_ahpa_gives_each_robot_what_is_nearest_to_its_start() -> None:
    # Starts at 1 and at 2: 0 is 10 m from 1, 3 is 5 m.
    rule = policy("ahpa")
    at = known(Other((42.0, 5.0), 200, 2))
    assert sorted({rule.route(at)[0] for _ in range(6)}) == [0, 1, 3]
    # It is silent: all are this robot's.
    at.others.clear()
    assert sorted({rule.route(at)[0] for _ in range(8)}) == [0, 1, 2, 3]


def test_partitions_are_stretches_of_the_common_tour() -> None:
    first, second = policy("partition"), policy("partition")
    one, two = known(Other((42.0, 5.0), 200, 2)), known(Other((22.0, 5.0), 200, 1))
    two.number, two.at, two.others = 2, 2, {1: two.others[2]}
    cells = [sorted({rule.route(at)[0] for _ in range(8)}) for rule, at in ((first, one), (second, two))]
    assert sorted(cells[0] + cells[1]) == [0, 1, 2, 3]
    assert all(cells)
