"""Short patrols of random buildings, and what is wrong with them."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fogwatch.inprocess import run_in_process
from patrol.journal import Status, TickRecord
from patrol.measures.best_tour import own_grounds
from patrol.measures.progress import stalest_outside
from patrol.measures.stays import SAMPLE_S, Stay
from patrol.prepare import Prepared, prepare
from patrol.scenario import Scenario, load_scenario
from patrol.values import Kind
from tests.random_building import TEAM, random_building
from worldsim.world import World

ROAMS = (4.0, 120.0)
"""Radius of a circle, m, and the longest time in s that a robot may be in it while ground outside of it grows stale.

For a robot slower than 1 m/s the time is longer in proportion.
"""

HALTS = (0.5, 60.0)
"""The same for a robot that hardly moves."""

DEAD_ENDS = {"holonomic": 0.05, "differential": 0.05, "car": 0.15}
"""Largest share of a robot's decisions in dead ends. In these buildings cars meet where there is no room to pass."""

MODELS: tuple[Kind, ...] = ("holonomic", "differential", "car")
POINTS = (0.1, 0.15, 0.2, 0.25, 0.3)


@dataclass(frozen=True)
class Findings:
    """The course of a patrol.

    Attributes:
        what: The patrol, in one line.
        model: Of the robots.
        invalid: The verdict's checks that failed.
        warnings: The verdict's warnings.
        stays: Robots that were in one place for too long (`ROAMS`), one line each.
        halts: Robots that hardly moved for too long (`HALTS`), one line each.
        dead_ends: Largest share of a robot's decisions in dead ends.
        seen: Share of what can be seen that was seen.
    """

    what: str
    model: Kind
    invalid: tuple[str, ...]
    warnings: tuple[str, ...]
    stays: tuple[str, ...]
    halts: tuple[str, ...]
    dead_ends: float
    seen: float

    @property
    def stuck(self) -> list[str]:
        """Findings that no patrol may have."""
        trapped = [warning for warning in self.warnings if "trapped" in warning]
        too_often = [f"dead ends: {self.dead_ends:.0%}"] if self.dead_ends > DEAD_ENDS[self.model] else []
        return [*self.invalid, *trapped, *self.halts, *too_often]

    @property
    def left_out(self) -> list[str]:
        """Ground that was not seen for long, or never; cars cannot turn wherever they fit, so it may happen to them."""
        return [*self.stays, *(warning for warning in self.warnings if "trapped" not in warning)]


def random_scenario(seed: int, folder: Path, longest_s: float = 600.0) -> Scenario:
    """A scenario that says no more than building, body and number of robots.

    Args:
        seed: Random seed.
        folder: An existing folder for the building's map.
        longest_s: Longest duration, s; the shortest is two thirds of it.
    """
    rng = np.random.default_rng(seed)
    model = MODELS[int(rng.integers(3))]
    point = float(rng.choice(POINTS))
    low, high = (0.3, 0.5) if model == "car" else (0.15, 0.4)
    count, radius = int(rng.integers(1, TEAM + 1)), round(float(rng.uniform(low, high)), 3)
    robots = {
        "count": count,
        "model": model,
        "radius": radius,
        "speed": round(float(rng.uniform(0.5, 1.5)), 2),
        "turning_radius": round(float(rng.uniform(0.6, 1.2)), 2),
    }
    building = random_building(seed, radius, point)
    return load_scenario(
        {
            "name": f"building-{seed}",
            "terrain": {"map": str(building.write(folder))},
            "point": point,
            "duration": float(round(rng.uniform(2.0 / 3.0, 1.0) * longest_s)),
            "seed": seed,
            "robots": robots,
        }
    )


class LongStays:
    """Finds robots that stay in a circle although ground outside of it, which they could see, is not seen meanwhile."""

    def __init__(self, prepared: Prepared, world: World) -> None:
        """Start before the first tick.

        Args:
            prepared: The scenario, its terrain and the bodies' static fields.
            world: Before its first tick.
        """
        self._prepared = prepared
        self._fog = world.truth.fog
        self._step = prepared.scenario.step
        self._every = max(round(SAMPLE_S / self._step), 1)
        slow = max(1.0, 1.0 / min(spec.speed for spec in prepared.scenario.roster))
        self._stays = [(radius, math.ceil(longest_s * slow)) for radius, longest_s in (ROAMS, HALTS)]
        self._grounds = own_grounds(prepared)
        self._been: dict[tuple[int, float], deque[tuple[int, float, float]]] = {}
        self._found: dict[tuple[int, float], str] = {}

    def tick(self, record: TickRecord) -> None:
        """Take in a tick.

        Args:
            record: Of the tick.
        """
        if record.k % self._every:
            return
        for row in record.robots:
            assert row.status is Status.ALIVE
            for radius, longest_s in self._stays:
                been = self._been.setdefault((row.number, radius), deque())
                been.append((record.k, row.x, row.y))
                while (record.k - been[0][0]) * self._step > longest_s:
                    been.popleft()
                if (record.k - been[0][0] + 1) * self._step > longest_s:
                    self._look(row.number, radius, longest_s, been)

    def lines(self, within: float) -> tuple[str, ...]:
        """The findings, one line for each robot.

        Args:
            within: Radius of the circles, m.
        """
        return tuple(line for (_, radius), line in sorted(self._found.items()) if radius == within)

    def _look(self, number: int, radius: float, longest_s: int, been: deque[tuple[int, float, float]]) -> None:
        xs, ys = [x for _, x, _ in been], [y for _, _, y in been]
        middle = 0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys))
        if any(math.dist(middle, place) > radius for place in zip(xs, ys, strict=True)):
            return
        stay = Stay(been[0][0], *middle, radius)
        terrain, ground = self._prepared.terrain, self._grounds[number].patrolled
        at = stalest_outside(stay, terrain, ground, self._fog.last_seen)
        if at is None:
            return
        x, y = terrain.centre(*at)
        last_s = int(self._fog.last_seen[at]) * self._step
        self._found[number, radius] = (
            f"r{number} was within {radius:g} m of ({middle[0]:.2f}, {middle[1]:.2f}) for {longest_s} s until "
            f"{been[-1][0] * self._step:g} s, and ({x:.2f}, {y:.2f}) was last seen at {last_s:g} s"
        )


def patrol(scenario: Scenario) -> Findings:
    """Run a scenario in this process.

    Args:
        scenario: Without faults.
    """
    prepared = prepare(scenario)
    watching: list[LongStays] = []

    def watch(world: World) -> Callable[[TickRecord], None]:
        watching.append(LongStays(prepared, world))
        return watching[0].tick

    outcome = run_in_process(prepared, keep=False, watch=watch)
    spec, summary = scenario.roster[0], outcome.summary
    turning = f", turning radius {spec.turning_radius:g} m" if spec.model == "car" else ""
    return Findings(
        f"{scenario.name}: {len(scenario.roster)} x {spec.model}, radius {spec.radius:g} m, {spec.speed:g} m/s"
        f"{turning}, points of {scenario.point:g} m, {scenario.duration:g} s",
        spec.model,
        tuple(check.name for check in outcome.verdict.checks if not check.ok),
        tuple(outcome.verdict.warnings),
        watching[0].lines(ROAMS[0]),
        watching[0].lines(HALTS[0]),
        max(robot.dead_end_share for robot in summary.robots.values()),
        summary.seen_share,
    )
