"""How long a full decision takes: points of 10 cm, one robot among five, after some minutes of patrol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from agent.ports import Decision
from experiments.bench.grounds import tiled, write_map
from experiments.bench.tools.groups import DECISIONS
from experiments.bench.tools.measure import Effort, Measured, Task, processor_s
from experiments.inprocess import InProcessFleet, make_minds
from patrol.exchange import Reply
from patrol.prepare import prepare
from patrol.scenario import Scenario, load_scenario
from worldsim.world import World

POINT = 0.1
WARM_TICKS, WARM_TICKS_QUICK = 200, 20
ROUNDS, ROUNDS_QUICK = 100, 10
TILED = "site, 2 x 2"
"""Four times the ground of `site`."""

TERRAINS = ("open", "yards", "clutter", "site", TILED)
QUICK_TERRAINS = ("yards",)

PAPER: Mapping[str, object] = {"patrol.commitment": "none"}
"""The paper's policy in place of our default."""

POLICIES: Mapping[str, Mapping[str, object]] = {
    "default policy, claims": {"patrol.separation": "claims"},
    "default policy, no claims": {"patrol.separation": "none"},
    "paper's policy, claims": {**PAPER, "patrol.separation": "claims"},
    "paper's policy, no claims": {**PAPER, "patrol.separation": "none"},
}


class Patrol:
    """A fleet in one process, stopped in each tick before robot 1 decides."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin the first tick.

        Args:
            scenario: The fleet's.
        """
        prepared = prepare(scenario)
        self._mind = make_minds(prepared)[1]
        self._fleet = InProcessFleet({**make_minds(prepared), 1: self._mind})
        self._world = World(prepared)
        self._decision: Decision | None = None
        self._begin()

    @property
    def places(self) -> list[tuple[float, float]]:
        """Where the robots are, (x, y) in m, in roster order."""
        return [(body.pose.x, body.pose.y) for _, body in sorted(self._world.bodies.items())]

    def decide(self) -> None:
        """Robot 1's decision of this tick; call it once a tick."""
        self._decision = self._mind.step(self._reports[1], self._heard[1])

    def next_tick(self) -> None:
        """Let the others decide, move everybody, and begin the next tick. Robot 1 has decided."""
        decision = self._decision
        assert decision is not None
        others = {number: heard for number, heard in self._heard.items() if number != 1}
        replies = dict(self._fleet.phase_b(self._world.tick, others))
        replies[1] = Reply(decision.command, decision.state, decision.goal, 0.0, 0)
        self._world.end_tick(replies)
        self._begin()

    def _begin(self) -> None:
        self._reports = self._world.begin_tick()
        self._heard = self._world.exchange(self._fleet.phase_a(self._world.tick, self._reports))


def tasks() -> list[Task]:
    """The measures of decisions."""
    return [
        Task(DECISIONS, f"{terrain}, {policy}", partial(_decision, terrain, settings))
        for terrain in TERRAINS
        for policy, settings in POLICIES.items()
    ]


def _decision(terrain: str, settings: Mapping[str, object], effort: Effort) -> Sequence[Measured]:
    if effort.quick and terrain not in QUICK_TERRAINS:
        return []
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        patrol = Patrol(load_scenario(_scenario(terrain, Path(folder)), settings))
    warm, rounds = (WARM_TICKS_QUICK, ROUNDS_QUICK) if effort.quick else (WARM_TICKS, ROUNDS)
    for _ in range(warm):
        patrol.decide()
        patrol.next_tick()
    values = []
    for _ in range(rounds):
        values.append(1e3 * processor_s(patrol.decide))
        patrol.next_tick()
    return [Measured("a full decision", "ms", tuple(values))]


def _scenario(terrain: str, folder: Path) -> dict[str, Any]:
    if terrain != TILED:
        return {"terrain": {"builtin": terrain}, "point": POINT}
    path = write_map(tiled("site", POINT), POINT, folder / "site-2x2.yaml")
    return {"terrain": {"map": str(path)}, "point": POINT}
