"""The rules of the rivals against their formulas, worked out by hand on a small graph.

        3 ---12--- 0 ---10--- 1 ---20--- 2          lengths in m; 1 and 3 are joined as well, 5 m

The robot is at 1, at time 100 s. The vertices were visited at 60, 100, 20 and 90 s: idle for 40, 0, 80 and 10 s. By its
own visits alone they have been idle for 70, 0, 60 and 80 s.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from agent.policies.found import POLICIES
from experiments.rivals.assignment import bids
from experiments.rivals.conscientious import stale_way
from experiments.rivals.known import Known, Other
from patrol.classes.named_class import NamedClass, find
from patrol.graph import graph_of
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.radio.peers import Peer
from patrol.scenario import load_scenario
from patrol.scenario.policies import BUILT_IN
from tests.agent.minds import setup_of

PLACES = ((12.0, 5.0), (22.0, 5.0), (42.0, 5.0), (20.0, 9.6))
EDGES = ((0, 1, 10.0), (1, 2, 20.0), (1, 3, 5.0), (0, 3, 12.0))
VISITED_S = (60.0, 100.0, 20.0, 90.0)
PIXEL = 0.1
SPEED = 1.0


def policy(name: str, **options: Any) -> Any:
    """A rival on a graph of its own; 1 m/s, three robots."""
    graph = {"vertices": [list(place) for place in PLACES], "edges": [list(edge) for edge in EDGES]}
    facts = {"terrain": {"builtin": "open", "graph": graph}, "point": 1.0}
    robots = {"count": 3, "model": "holonomic", "speed": SPEED}
    scenario = load_scenario({**facts, "robots": robots, "patrol": {"policy": name, "options": options}})
    return find(NamedClass(POLICIES, name, None, options))(setup_of(prepare(scenario)))


def known(*others: Other, draw: float = 0.0) -> Known:
    """The knowledge of the robot; other robots are numbered from 2 on."""
    own_s, here = np.array((30.0, 100.0, 40.0, 20.0)), {"at": 1, "place": PLACES[1], "now_s": 100.0}
    visits: dict[str, Any] = {**here, "visited_s": np.array(VISITED_S), "own_s": own_s, "found_s": np.zeros(4)}
    heard = dict(enumerate(others, 2))
    return Known(graph_of(PLACES, EDGES, PIXEL), 0.4, 0.5, 1, 3, others=heard, draw=lambda _: draw, **visits)


def going_to(vertex: int, at: int = 0, place: tuple[float, float] = (12.0, 5.0)) -> Other:
    return Other(place, 200, at, vertex)


def test_random_takes_each_neighbour_as_likely() -> None:
    # Neighbours in the order of the edges: 0, 2, 3.
    assert [list(policy("random").route(known(draw=draw))) for draw in (0.0, 0.34, 0.99)] == [[0], [2], [3]]


def test_cr_knows_its_own_visits_only() -> None:
    # By itself: 70, 60 and 80 s; by all visits 2 would be the stalest.
    assert list(policy("cr").route(known())) == [3]


def knows_all(**more: Any) -> Known:
    """The knowledge of a robot that made all visits itself."""
    chosen = known(**more)
    chosen.own_s = chosen.visited_s
    return chosen


def test_hcr_adds_idleness_and_nearness() -> None:
    # 0: (20 - 10) / 20 + 70 / 80 = 1.375; 2: 0 + 60 / 80 = 0.75; 3: 15 / 20 + 1 = 1.75.
    assert list(policy("hcr").route(known())) == [3]
    # 0: 0.5 + 40 / 80 = 1; 2: 0 + 1 = 1; 3: 15 / 20 + 10 / 80 = 0.875. 0 and 2 are equal.
    assert [list(policy("hcr").route(knows_all(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]


def test_hpcc_looks_at_all_vertices_and_goes_by_stale_ones() -> None:
    # The longest way from 1 is that to 2, 20 m, and all vertices are neighbours: as for HCR.
    assert list(policy("hpcc").route(known())) == [3]
    assert [list(policy("hpcc").route(knows_all(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]
    # From 2, idle for 40, 0, 1 and 80 s. 0: 0 / 30 + 40 / 80 = 0.5; 1: 10 / 30 + 0 = 0.33; 3: 5 / 30 + 1 = 1.17.
    away = known()
    away.at, away.own_s = 2, np.array((60.0, 100.0, 99.0, 20.0))
    assert list(policy("hpcc").route(away)) == [1, 3]


def test_hpcc_goes_round_by_a_stale_vertex() -> None:
    away = known()
    away.at, away.own_s = 3, np.array((0.0, 10.0, 100.0, 100.0))
    # From 3 to 0, I_max = 100: straight 0 + (12 - 5) / 15 = 0.47; over 1, 10 / 100 + 0 and then 0 + 5 / 15: 0.43.
    assert stale_way(away, 0, 100.0) == [1, 0]
    away.own_s[1] = 20.0
    assert stale_way(away, 0, 100.0) == [0], "over 1 it is 0.53 now"


def test_greedy_takes_the_greatest_idleness_per_way() -> None:
    # 40 / 10 = 4, 80 / 20 = 4, 10 / 5 = 2.
    assert [list(policy("greedy").route(known(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]
    later = known()
    later.visited_s[2] = 19.0
    assert list(policy("greedy").route(later)) == [2]


def test_gbs_weighs_idleness_per_edge_in_pixels() -> None:
    chosen, rule = known(), policy("gbs")
    # Gains are 40 s / 100 px = 0.4, 80 / 200 = 0.4 and 10 / 50 = 0.2; G1 exp(ln(10) / 100 * 0.4) = 0.1 * 10^0.004.
    assert rule.chance(chosen, 0) == pytest.approx(0.1009253, abs=1e-7)
    assert rule.chance(chosen, 3) == pytest.approx(0.1004616, abs=1e-7)
    assert [list(rule.route(known(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]
    # With edge_min 150 px, 0 gains 40 / 150 and 2 gains 80 / 200.
    assert list(policy("gbs", edge_min=150.0).route(chosen)) == [2]
    assert policy("gbs", g2=0.3).chance(chosen, 0) == 1.0


def test_sebs_keeps_away_from_where_others_go() -> None:
    rule = policy("sebs")
    # 0 and 2 gain the same. One other robot that goes to 0 makes that 2^(3 - 1) / (2^3 - 1) = 4 / 7 of it.
    assert list(rule.route(known(going_to(0)))) == [2]
    assert list(rule.route(known(going_to(2)))) == [0]
    # One that goes to 0 and one to 2: 4 / 7 of 0.1009 each; 3 has 0.1005.
    assert list(rule.route(known(going_to(0), going_to(2)))) == [3]
    # With G2 = 0.4, 0 and 2 have 1, and 3 has 0.1 * 10^0.5 = 0.316: more than 2 / 7, but less than 4 / 7.
    sure = policy("sebs", g2=0.4)
    assert list(sure.route(known(going_to(0), going_to(2)))) == [0]
    assert list(sure.route(known(going_to(0), going_to(0), going_to(2), going_to(2)))) == [3]


def test_cbls_leaves_out_what_others_aim_at_and_learns_from_visits() -> None:
    rule = policy("cbls")
    # All means are the present idleness. Priors: 0 is 3/4 40 + 1/4 10 = 32.5; 2 has one neighbour only: 80; 3 is
    # 3/4 10 + 1/4 40 = 17.5. Arcs are equal.
    assert list(rule.route(known())) == [2]
    assert list(rule.route(known(going_to(2)))) == [0]
    # Three visits that found 2 fresh: (3 * 0 + 80) / 4 = 20.
    often = known()
    often.visits = np.array((0, 0, 3, 0))
    assert list(rule.route(often)) == [0]
    # All are taken, so what lies beyond them does not count: 40, 80 and 10.
    assert list(rule.route(known(going_to(0), going_to(2), going_to(3)))) == [2]


def test_cbls_counts_the_visits_of_all_robots() -> None:
    """Robot 1 visits vertex 0 at 5 s, robot 2 at 20 s; a stay is one visit."""
    seen = Known(graph_of(PLACES, EDGES, PIXEL), 0.4, 0.5, 1, 2)
    for tick, x, other in ((10, 12.0, 30.0), (11, 12.0, 30.0), (20, 22.0, 20.0), (40, 22.0, 12.0), (60, 22.0, 20.0)):
        peers = {2: Peer(tick, Pose(other, 5.0, 0.0), tick)}
        seen.look(SimpleNamespace(time_s=0.5 * tick, tick=tick, reported=Pose(x, 5.0, 0.0), peers=peers, draw=None))  # type: ignore[arg-type]
    assert seen.visits[0] == 2
    # 5 s at the first visit, 20 - 5.5 s at the second, and 10 s since.
    assert seen.mean_idleness[0] == pytest.approx((5.0 + 14.5 + 10.0) / 3)
    assert seen.visitor[0] == 2


def test_cbls_rewards_the_arc_to_the_vertex_that_is_visited_least() -> None:
    rule = policy("cbls")
    rule.route(known())
    after = known()
    after.at, after.visits, after.visited_s[2] = 2, np.array((4, 1, 1, 1)), 100.0
    rule.route(after)
    # Per neighbour: 0 has 4 / 2, 2 has 1 / 1, 3 has 1 / 2. The posterior was 32.5 : 80 : 17.5, with an entropy of
    # (0.3466 + 0.2988 + 0.2700) / ln 3 = 0.8331.
    assert [rule._arcs[1, vertex] for vertex in (0, 2, 3)] == pytest.approx([0.8331, 1.0, 1.1669], abs=1e-4)


def test_cbls_breaks_ties_by_idleness() -> None:
    rule = policy("cbls")
    rule.route(known())
    after = known()
    after.at, after.visits, after.visited_s[2] = 2, np.array((2, 1, 1, 2)), 100.0
    rule.route(after)
    # All have one visit per neighbour: 0, idle for 40 s, is rewarded, and 2, which has just been visited, punished.
    assert [rule._arcs[1, vertex] for vertex in (0, 2, 3)] == pytest.approx([1.1669, 0.8331, 1.0], abs=1e-4)


def test_er_expects_the_idleness_at_its_arrival() -> None:
    rule = policy("er")
    # 0: (110 - 60) / 10 = 5; 2: (120 - 20) / 20 = 5; 3: (105 - 90) / 5 = 3.
    assert [list(rule.route(known(draw=draw))) for draw in (0.0, 0.6)] == [[0], [2]]
    # Another robot, 4 m from 0, is there at 104: |110 - 104| / 10 = 0.6.
    assert list(rule.route(known(going_to(0, at=3, place=(12.0, 9.0))))) == [2]
    # Of two that go there, the later one counts, wherever it is listed: at 170, |110 - 170| / 10 = 6.
    near, far = going_to(0, at=3, place=(12.0, 9.0)), going_to(0, at=3, place=(12.0, 75.0))
    assert [list(rule.route(known(*two))) for two in ((near, far), (far, near))] == [[0], [0]]


def test_mns_sums_three_parts() -> None:
    # I' and d' are 0.5 and 0.5 for 0, 1 and 1 for 2, 0.125 and 0.25 for 3.
    # 0: -0.2138 * -0.3086 + 0.3807 + 0.4853 * -0.2292 = 0.335; 2: 0.1320 + 0.7613 - 0.2225 = 0.671; 3: 0.077.
    rule = policy("mns")
    assert list(rule.route(known(going_to(1)))) == [2]
    assert list(rule.route(known(going_to(2)))) == [0]
    assert list(rule.route(known(going_to(2), going_to(0)))) == [3]


def test_mns_alone_looks_at_the_whole_graph() -> None:
    # From 0; idle for 0, 0, 100 and 70 s, 0, 10, 30 and 12 m away. 2 is best with 0.671; 3 has 0.0259 + 0.6118 - 0.1518
    # = 0.486. The way to 2 leads over 1.
    at = known()
    at.at, at.visited_s = 0, np.array((100.0, 100.0, 0.0, 30.0))
    assert list(policy("mns").route(at)) == [1]
    at.others = {2: going_to(0)}
    assert list(policy("mns").route(at)) == [3], "in a team it looks at neighbours only"


def test_dtag_stays_near_its_start_and_takes_what_nobody_else_takes() -> None:
    # From 1, where it starts: 0: 40 - 0.75 100 - 5 10 = -85; 2: 80 - 150 - 100 = -170; 3: 10 - 37.5 - 5 5.02 = -52.6.
    rule = policy("dtag")
    assert list(rule.route(known())) == [3]
    assert list(rule.route(known(going_to(3)))) == [0]
    assert rule.known.idleness.tolist() == [100.0] * 4, "at the start"
    # A robot that starts at 0: 0: 40 - 75 - 0 = -35; 2: 80 - 150 - 150 = -220; 3: 10 - 37.5 - 5 9.24 = -73.7.
    elsewhere = known()
    elsewhere.place = PLACES[0]
    assert list(policy("dtag").route(elsewhere)) == [0]


def test_dtap_takes_the_best_vertex_that_no_other_robot_is_nearer_to() -> None:
    rule = policy("dtap")
    # All three are one edge away: 8 off each. 2 is best; a robot at 2 would bid 0 for it, and one at 3 25 m.
    assert list(rule.route(known())) == [2]
    assert list(rule.route(known(Other((20.0, 9.6), 200, 3)))) == [2]
    # A robot at 2 is nearer, and 80 s is less than the mean of 32.5 and two deviations, 31.1 each.
    assert list(rule.route(known(Other((42.0, 5.0), 200, 2)))) == [0]


def test_dtap_bids_from_the_centre_of_its_tasks_times_their_number() -> None:
    # 1 is this robot's task, so it bids twice the way: 40 for 2, 20 for 0, 10 for 3. The one at 0 has no task yet: it
    # bids 30 for 2, 0 for 0 and 12 for 3.
    at = known(Other(PLACES[0], 200, 0))
    assert list(policy("dtap").route(at)) == [2], "nobody has a task"
    at.visitor = np.array((0, 1, 0, 0))
    assert list(policy("dtap").route(at)) == [3]
    # 0, 1 and 3: the sums of the ways to the others are 22, 15 and 17, so 1 is the centre.
    at.visitor = np.array((1, 1, 0, 1))
    assert bids(at, 1, 3).tolist() == [40.0, 0.0, 80.0, 20.0]
    # The other one is going from 0 to 3: its only task, and so the centre.
    assert bids(at, 2, 0, aim=3).tolist() == [24.0, 10.0, 50.0, 0.0]
    assert policy("dtap").known.idleness.tolist() == [8.0] * 4, "at the start"


def test_dtap_takes_a_very_stale_neighbour_for_which_another_bids_less() -> None:
    # The robot is on the hub of a star. Its tasks are the hub and 3, so it bids 30 for 1 to 4, and 3 for 5. The other
    # one, at 2 and without a task, bids 20, 0 for 2, and 11 for 5.
    places = [(20.0, 20.0), (30.0, 20.0), (10.0, 20.0), (20.0, 30.0), (20.0, 10.0), (21.0, 20.0)]
    star = graph_of(places, [(0, leaf, 1.0 if leaf == 5 else 10.0) for leaf in range(1, 6)], PIXEL)
    visitor = np.array((1, 0, 0, 1, 0, 0))

    def chosen(*idle: float) -> list[int]:
        at = Known(star, 0.4, 0.5, 1, 2, at=0, now_s=100.0, visited_s=100.0 - np.array(idle), visitor=visitor)
        at.others[2] = Other(places[2], 200, 2)
        return list(policy("dtap").route(at))

    # The mean is 16.7 and the deviation 37.3: 100 is more than 91.2.
    assert chosen(0.0, 100.0, 0.0, 0.0, 0.0, 0.0) == [1]
    # The mean is 36.7 and the deviation 39: 100 is less than 114.7, and 5 is the first one that this robot wins.
    assert chosen(0.0, 100.0, 60.0, 60.0, 0.0, 0.0) == [5]


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
    rule.plan(at)
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
    # The common tour is 0, 3, 1, 2: at 0, 12, 17 and 37 of 67 m. Starts are at 1 and 2. From 1 on, 2 comes after 20 m,
    # 0 after 50 m and 3 after 62 m; a stretch is 33.5 m long.
    first, second = policy("partition"), policy("partition")
    one, two = known(Other((42.0, 5.0), 200, 2)), known(Other((22.0, 5.0), 200, 1))
    two.number, two.at, two.others = 2, 2, {1: two.others[2]}
    cells = [sorted({rule.route(at)[0] for _ in range(8)}) for rule, at in ((first, one), (second, two))]
    assert cells == [[1, 2], [0, 3]]


@pytest.mark.parametrize("name", sorted(set(POLICIES.built_in) - {*BUILT_IN, "learned"}))
def test_only_vertices_that_a_way_leads_to_are_chosen(name: str) -> None:
    """Vertex 2 is cut off, and another robot is there."""
    at = known(Other(PLACES[2], 200, 2))
    at.graph = graph_of(PLACES, [edge for edge in EDGES if 2 not in edge[:2]], PIXEL)
    at.visited_s[2] = -1e6
    rule = policy(name)
    assert {vertex for _ in range(6) for vertex in rule.route(at)} <= {0, 1, 3}
