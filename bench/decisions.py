"""One decision, from the frames heard to the command: points of 10 cm, one robot among five, on patrol."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from agent.ports import Decision
from bench.grounds import tiled, write_map
from bench.runner import Bench
from fogwatch.inprocess import InProcessFleet, make_minds
from patrol.exchange import Reply
from patrol.prepare import prepare
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.patrols import FIELD, PATROLS
from worldsim.world import World

POINT = 0.1
WARM_TICKS = 200
"""Ticks of a patrol before its decisions count."""

TILED = "site, 2 x 2"
"""Four times the ground of `site`."""

TERRAINS = ("open", "yards", "clutter", "site", TILED)

POLICIES: Mapping[str, Mapping[str, object]] = {name: {FIELD: patrol.policy} for name, patrol in PATROLS.items()}


class Patrol:
    """A fleet in one process, stopped in each tick before robot 1 decides."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin the first tick.

        Args:
            scenario: The fleet's.
        """
        prepared = prepare(scenario)
        self._mind = make_minds(prepared)[1]  # made apart: as in a process, it shares no memory with the others
        self._fleet = InProcessFleet({**make_minds(prepared), 1: self._mind})
        self._world = World(prepared)
        self._decision: Decision | None = None
        self._begin()

    @property
    def places(self) -> list[tuple[float, float]]:
        """Places of the robots, (x, y) in m, in roster order."""
        return [(body.pose.x, body.pose.y) for _, body in sorted(self._world.bodies.items())]

    def decide(self) -> None:
        """Robot 1's decision of this tick; call it once a tick."""
        self._decision = self._mind.step(self._reports[1], self._heard[1])

    def next_tick(self) -> None:
        """Let the others decide, move everybody, and begin the next tick. Robot 1 has decided."""
        decision = self._decision
        assert decision is not None
        others = {number: position for number, position in self._heard.items() if number != 1}
        replies = dict(self._fleet.phase_b(self._world.tick, others))
        replies[1] = Reply(decision.command, decision.state, decision.goal, 0.0, 0)
        self._world.end_tick(replies)
        self._begin()

    def _begin(self) -> None:
        self._reports = self._world.begin_tick()
        self._heard = self._world.exchange(self._fleet.phase_a(self._world.tick, self._reports))


def main() -> None:
    """Measure a decision on all terrains with all policies: each value is one, after so many ticks of patrol."""
    bench = Bench("decisions", processes=3, values=100, warmups=WARM_TICKS, loops=1)
    for terrain in TERRAINS:
        for policy, settings in POLICIES.items():
            bench.time(f"a decision, {terrain}, {policy}", decision_time(terrain, settings))
    bench.end()


def decision_time(terrain: str, settings: Mapping[str, object]) -> Callable[[int], float]:
    """Return a function that measures decisions of robot 1, tick after tick of one patrol.

    Args:
        terrain: One of `TERRAINS`.
        settings: What else is set in the scenario, by dotted field.

    Returns:
        Takes the number of ticks, and returns the processor time of their decisions, s.
    """
    patrol: Patrol | None = None

    def time_func(ticks: int) -> float:
        nonlocal patrol
        if patrol is None:
            patrol = begin_patrol(terrain, settings)
        spent_s = 0.0
        for _ in range(ticks):
            begun_s = time.process_time()
            patrol.decide()
            spent_s += time.process_time() - begun_s
            patrol.next_tick()
        return spent_s

    return time_func


def begin_patrol(terrain: str, settings: Mapping[str, object]) -> Patrol:
    """Return a patrol of five cars before its first decision.

    Args:
        terrain: One of `TERRAINS`.
        settings: What else is set in the scenario, by dotted field.
    """
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        ground: dict[str, str] = {"builtin": terrain}
        if terrain == TILED:
            ground = {"map": str(write_map(tiled("site", POINT), POINT, Path(folder) / "site-2x2.yaml"))}
        return Patrol(load_scenario({"terrain": ground, "point": POINT, "step": 0.5}, settings))


if __name__ == "__main__":
    main()
