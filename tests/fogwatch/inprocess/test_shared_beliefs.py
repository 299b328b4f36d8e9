"""Minds of one process that share beliefs do and believe what they would do and believe each by itself."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.mind import Mind
from fogwatch.inprocess import Outcome, run_in_process
from patrol.radio.peers import Peer
from patrol.scenario import Scenario, load_scenario
from tests.fleets import end_of
from worldsim.world import World

TICKS = 24
DILATED: dict[str, Any] = {"policy": "potential-field", "options": {"separation": "claims", "random_move": 0.02}}

FAULTS: Mapping[str, list[dict[str, Any]]] = {
    "none": [],
    "loss": [{"kind": "loss", "rate": 0.2}],
    "short loss": [{"kind": "loss", "at": 5, "for": 2, "rate": 0.1}],
    "bursts": [{"kind": "loss", "rate": 0.4, "mean_burst": 4}],
    "losses": [{"kind": "loss", "rate": 0.2}, {"kind": "loss", "from": "r1", "rate": 0.5, "id": "more"}],
    "delay": [{"kind": "delay", "delay": {"exponential": 0.6}}],
    "reorder": [{"kind": "reorder", "rate": 0.3, "hold": 1.0}],
    "duplicate": [{"kind": "duplicate", "rate": 0.3, "delay": {"exponential": 0.6}}],
    "silence": [{"kind": "silence", "at": 3, "for": 6, "who": "r2", "direction": "both"}],
    "long silence": [{"kind": "silence", "at": 2, "who": ["r2", "r3"], "direction": "in"}],
    "partition": [{"kind": "partition", "at": 3, "for": 6, "groups": "halves"}],
    "range": [{"kind": "range", "reach": 20.0}],
    "bandwidth": [{"kind": "bandwidth", "who": "r1", "bytes_per_s": 30.0}],
    "stranger": [{"kind": "spoof", "at": 2, "for": 8, "by": "stranger", "as": "r4", "payload": {"offset": [15, 0]}}],
    "insider": [{"kind": "spoof", "at": 2, "for": 8, "by": "r2", "as": "r3", "payload": {"offset": [1, 0]}}],
    "drift": [{"kind": "drift", "at": 2, "who": "r1", "growth": [0.3, 0.1]}],
    "clock": [{"kind": "clock", "at": 2, "who": "r4", "offset": 3}],
    "kill and restart": [{"kind": "kill", "at": 4, "who": "r2"}, {"kind": "restart", "at": 8, "who": "r2"}],
    "pause": [{"kind": "pause", "at": 3, "for": 5, "who": "r3"}],
    "leave": [{"kind": "leave", "at": 3, "who": "r1"}],
    "join": [{"kind": "join", "at": 5, "who": "r6"}],
}
"""By what makes beliefs differ: every kind of fault."""


def scenario(faults: list[dict[str, Any]], **more: Any) -> Scenario:
    robots = {"count": 5, "model": "holonomic", "spare": 1, **more.pop("robots", {})}
    settings = {"terrain": {"builtin": "yards"}, "point": 1.0, "robots": robots, "duration": 0.5 * TICKS}
    return load_scenario({**settings, "faults": faults, **more})


class Watched:
    """The beliefs of every mind of a run at the end of each tick."""

    def __init__(self) -> None:
        self.fogs: dict[tuple[int, int], NDArray[np.int32]] = {}
        self.peers: dict[tuple[int, int], dict[int, Peer]] = {}
        self.counts: dict[tuple[int, int], tuple[Any, int]] = {}
        self.groups: list[int] = []

    def __call__(self, world: World, minds: Mapping[int, Mind]) -> None:
        for number, mind in minds.items():
            at = world.tick, number
            self.fogs[at] = mind.belief.dilated.copy()
            self.peers[at] = dict(mind.belief.peers)
            self.counts[at] = dict(mind.belief.refused), mind.belief.fog.mfow(world.tick)
        self.groups.append(len({id(mind.belief.shared) for mind in minds.values()}))


def compared(given: Scenario) -> tuple[Watched, Watched]:
    """Run a scenario with shared beliefs and without, check that the traces agree, and return both runs' beliefs."""
    watched: list[Watched] = []
    outcomes: list[Outcome] = []
    for share in (True, False):
        watched.append(Watched())
        outcomes.append(run_in_process(given, share=share, look=watched[-1]))
    one, other = outcomes
    assert one.verdict.valid, one.verdict.failed
    assert one.journal.end is not None
    assert other.journal.end is not None
    assert one.journal.end.trace_hash == other.journal.end.trace_hash
    return watched[0], watched[1]


@pytest.mark.parametrize("policy", [DILATED, {}], ids=["dilated", "default"])
@pytest.mark.parametrize("kind", FAULTS)
def test_under_every_fault_minds_believe_the_same(kind: str, policy: dict[str, Any]) -> None:
    shared, alone = compared(scenario(FAULTS[kind], patrol=policy))
    assert shared.fogs.keys() == alone.fogs.keys()
    for at, fog in alone.fogs.items():
        assert np.array_equal(shared.fogs[at], fog), at
    assert shared.peers == alone.peers
    assert shared.counts == alone.counts


@pytest.mark.parametrize(
    "more",
    [
        {"radio": {"trail": 2}},
        {"robots": {"model": "car"}},
        {"sensor": {"angle": 120}},
        {"sensor": {"quality": 0.5}},
        {"radio": {"adaptive": {"error": 1.0, "silence": 4.0}}},
        {"intruders": [{"place": [40, 22], "at": 2, "for": 10}]},
        {"patrol": {"options": {"separation": "artificial-obstacles"}}},
    ],
    ids=["trails", "cars", "narrow", "quality", "adaptive", "intruder", "obstacles"],
)
def test_whatever_else_there_is_they_do_the_same_under_losses(more: dict[str, Any]) -> None:
    faults = [*FAULTS["loss"], *FAULTS["kill and restart"]]
    shared, alone = compared(scenario(faults, **more))
    assert shared.peers == alone.peers
    assert shared.counts == alone.counts


def test_as_long_as_all_arrives_there_is_one_belief_and_those_that_missed_something_part() -> None:
    shared, alone = compared(scenario(FAULTS["none"], patrol=DILATED))
    assert set(shared.groups) == {1}
    assert set(alone.groups) == {5}
    shared, _ = compared(scenario(FAULTS["silence"], patrol=DILATED))
    assert shared.groups[0] == 1
    assert shared.groups[-1] == 2  # r2 on the one side, all others on the other


@pytest.mark.parametrize("kind", ["none", "short loss", "pause"])
def test_minds_in_several_workers_share_beliefs_too(kind: str) -> None:
    given = scenario(FAULTS[kind], patrol=DILATED)
    together, alone = run_in_process(given, workers=3), run_in_process(given, share=False)
    assert end_of(together.journal) == end_of(alone.journal)


def test_bodies_of_different_sizes_have_beliefs_of_their_own() -> None:
    robots = [{"model": "holonomic", "radius": radius} for radius in (0.3, 0.3, 1.5, 1.5)]
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "robots": robots, "duration": 0.5 * TICKS}
    shared, _ = compared(load_scenario(given))
    assert set(shared.groups) == {2}
