"""Robots on graphs: they visit every vertex, hear of others' visits, and outlive them."""

from typing import Any

import numpy as np
import pytest

from agent.policies.found import POLICIES
from experiments.rivals.known import Known
from fogwatch.inprocess import run_in_process
from patrol.graph import graph_of
from patrol.pose import Pose
from patrol.radio.peers import Peer
from patrol.scenario import load_scenario
from patrol.scenario.policies import BUILT_IN
from patrol.summary.model import Summary
from tests.present import present

RIVALS = sorted(set(POLICIES.built_in) - {*BUILT_IN, "learned"})


def patrolled(policy: str, model: str = "holonomic", **more: Any) -> Summary:
    """The summary of a patrol of three robots."""
    facts = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 240, "robots": {"count": 3, "model": model}}
    outcome = run_in_process(load_scenario({**facts, "patrol": {"policy": policy}, **more}))
    assert outcome.verdict.valid, outcome.verdict.failed
    return outcome.summary


@pytest.mark.parametrize("policy", RIVALS)
def test_every_rival_patrols(policy: str) -> None:
    assert patrolled(policy).seen_share > (0.5 if policy in ("random", "dtag") else 0.8)


@pytest.mark.parametrize("model", ["car", "differential"])
def test_other_bodies_patrol_as_well(model: str) -> None:
    assert patrolled("partition", model).seen_share > 0.8


@pytest.mark.parametrize("policy", ["even-tour", "partition", "ahpa"])
def test_the_others_take_over_what_a_dead_robot_saw(policy: str) -> None:
    end_s = present(patrolled(policy, duration=700, faults=[{"kind": "kill", "at": 90, "who": "r2"}]).mfow_end_s)
    assert end_s < 300.0, "what was the dead robot's is seen again"


class View:
    """As much of a view as `Known` looks at."""

    def __init__(self, tick: int, pose: Pose, peers: dict[int, Peer]) -> None:
        self.tick, self.time_s, self.reported, self.peers = tick, 0.5 * tick, pose, peers

    def draw(self, _: int) -> float:
        return 0.0


def test_visits_are_known_from_positions_alone() -> None:
    graph = graph_of([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)], [(0, 1, 10.0), (1, 2, 10.0)])
    known = Known(graph, 0.4, 0.5, 1, 2)

    def look(tick: int, x: float, other: tuple[float, float, int]) -> list[int]:
        peers = {2: Peer(other[2], Pose(other[0], other[1], 0.0), other[2])}
        return known.look(View(tick, Pose(x, 0.0, 0.0), peers))  # type: ignore[arg-type]

    assert look(10, 0.2, (10.0, 9.0, 10)) == [0]
    assert known.others[2].at == 2, "nearest, before it visited any"
    # The other one passes vertex 2 between two ticks; this robot leaves vertex 0.
    assert look(11, 1.0, (10.0, 11.0, 11)) == []
    assert look(12, 2.0, (10.0, 11.0, 11)) == []
    assert known.visited_s.tolist() == [5.0, 0.0, 5.5]
    assert known.own_s.tolist() == [5.0, 0.0, 0.0]
    look(20, 3.0, (10.0, 8.0, 20))
    assert known.aims == {2: 1}, "it is on the only edge from there"
    assert np.all(known.idleness == 10.0 - known.visited_s)
    known.look(View(60, Pose(3.0, 0.0, 0.0), {}))  # type: ignore[arg-type]
    assert known.others == {}
