"""What a robot misses that hears only those near it.

A *near* mind hears only positions from within a distance, and otherwise the same as its robot. In each tick both
decide, and the robot does what its own mind says: so all decisions that are compared are about the same situation. A
near mind keeps what it decided before, such as its target, so a decision that differs can make later ones differ.

What the difference is worth is another question. It is answered by whole runs with and without a radio of that range.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from agent.policies.potential_field.pull.force import ForceLaw
from experiments.bench.measures.fleets import run_apart, square_scenario
from experiments.bench.tools.groups import HORIZON
from experiments.bench.tools.measure import Effort, Measured, Task, Unmeasured
from experiments.inprocess import InProcessFleet, make_minds
from patrol.exchange import Sensed
from patrol.pose import Command, Pose, Velocity, wrap
from patrol.prepare import Prepared, prepare
from patrol.radio.message import decode
from patrol.scenario import load_scenario
from worldsim.world import World

SIZE, SIZE_QUICK = 100, 10
DURATION_S, DURATION_QUICK_S = 600.0, 20.0
TICKS, TICKS_QUICK = 200, 40
"""The first ticks of a patrol, in which decisions are compared."""
SEEDS, SEEDS_QUICK = (1, 2), (1,)
TIMES = (1.0, 2.0, 4.0)
"""The distances that are tried, as multiples of the horizon."""

APART = math.pi / 4.0
"""Directions that differ by more lie in different sectors of the paper's eight, rad."""

FOREVER_S = 1e9
"""Wall time that no fleet needs, s: whole runs are compared."""

POLICIES: Mapping[str, Mapping[str, object]] = {
    "default policy": {},
    "paper's policy": {"patrol.commitment": "none"},
}


def tasks() -> list[Task]:
    """The measures of hearing only those near."""
    return [
        Task(HORIZON, f"{policy}, {times:g} x the horizon", partial(_compare, policy, times))
        for policy in POLICIES
        for times in TIMES
    ]


def horizon_m(prepared: Prepared) -> float:
    """The path length beyond which no force can change a decision of the paper's policy, m.

    Args:
        prepared: The scenario.
    """
    scenario, fields, point = prepared.scenario, prepared.fields[1], prepared.scenario.point
    longest = 400 * sum(fields.reach.shape)
    team = len(scenario.roster) - len(scenario.spares)
    law = ForceLaw(scenario.patrol, point, int(fields.patrolled.sum()), longest, team)
    return law.limit * point / 100.0


def _compare(policy: str, times: float, effort: Effort) -> Sequence[Measured]:
    size, seeds, ticks = (SIZE_QUICK, SEEDS_QUICK, TICKS_QUICK) if effort.quick else (SIZE, SEEDS, TICKS)
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        prepared = prepare(load_scenario(_scenario(effort.quick, Path(folder)), POLICIES[policy]))
    reach = times * (horizon_m(prepared) + prepared.scenario.sensor.range)
    differ, turned, heard = decisions_that_differ(prepared, reach, ticks)
    ratios = [
        late_mfow(policy, seed, effort.quick, reach) / late_mfow(policy, seed, effort.quick, None) for seed in seeds
    ]
    compared = f"heard within {reach:.0f} m, {size} robots, the first {ticks} ticks"
    return [
        Measured("decisions that differ", "%", (100.0 * differ,), says=compared),
        Measured("by more than 45 degrees", "%", (100.0 * turned,), says="of all decisions"),
        Measured("robots heard", "", (heard,), says=f"on average, of {size - 1}"),
        Measured(
            "late mean MFoW, as a ratio to hearing all", "", tuple(ratios), says=f"seeds {', '.join(map(str, seeds))}"
        ),
    ]


def _scenario(quick: bool, folder: Path) -> dict[str, Any]:
    scenario = square_scenario(SIZE_QUICK if quick else SIZE, folder)
    return {**scenario, "duration": DURATION_QUICK_S if quick else DURATION_S}


def decisions_that_differ(prepared: Prepared, reach: float, ticks: int) -> tuple[float, float, float]:
    """Compare near minds with those that hear everybody, tick by tick.

    Args:
        prepared: The scenario.
        reach: From how far a near mind hears positions, m.
        ticks: For how many ticks, at most all of the scenario.

    Returns:
        The share of decisions whose command differs, the share that also go into another direction, and by how many
        robots a near mind hears on average.

    Raises:
        Unmeasured: Nobody decided anything.
    """
    world = World(prepared)
    fleet = InProcessFleet(make_minds(prepared))
    near = make_minds(prepared)
    decisions = differ = turned = heard_by = 0
    for k in range(min(ticks, prepared.scenario.ticks)):
        reports = world.begin_tick()
        heard = world.exchange(fleet.phase_a(k, reports))
        replies = fleet.phase_b(k, heard)
        places: dict[bytes, Pose] = {}
        for number, reply in replies.items():
            mind, sensed = near[number], reports[number]
            mind.frames(sensed)
            close = [frame for frame in heard[number] if _within(frame, sensed, reach, places)]
            other = mind.step(sensed, close)
            decisions += 1
            heard_by += len(close)
            if other.command != reply.command:
                differ += 1
                turned += abs(wrap(_course(other.command) - _course(reply.command))) > APART
        world.end_tick(replies)
    if not decisions:
        raise Unmeasured("no robot decided anything")
    return differ / decisions, turned / decisions, heard_by / decisions


def _within(frame: bytes, sensed: Sensed, reach: float, places: dict[bytes, Pose]) -> bool:
    pose = places.get(frame)
    if pose is None:
        pose = places[frame] = decode(frame).pose
    return math.hypot(pose.x - sensed.pose.x, pose.y - sensed.pose.y) <= reach


def _course(command: Command) -> float:
    """The direction of a holonomic robot's velocity, rad."""
    assert isinstance(command, Velocity)
    return math.atan2(command.vy, command.vx)


@cache
def late_mfow(policy: str, seed: int, quick: bool, reach: float | None) -> float:
    """The late mean MFoW of a whole run, made once: several distances are compared with the same run.

    Args:
        policy: One of `POLICIES`.
        seed: Of the run.
        quick: Whether the fleet is small and its run short.
        reach: From how far radios are heard, m; None for any distance.

    Returns:
        The mean MFoW of the run's second half, s.

    Raises:
        Unmeasured: The run's verdict is not valid.
    """
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        scenario = _scenario(quick, Path(folder))
        if reach is not None:
            scenario["faults"] = [{"kind": "range", "reach": reach}]
        readings = run_apart(scenario, FOREVER_S, settings={**POLICIES[policy], "seed": seed})
    if not readings.valid:
        raise Unmeasured("the run's verdict is not valid")
    return readings.mfow_late_s
