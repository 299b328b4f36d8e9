"""What a robot misses that hears only those near it.

A *near* mind hears only positions from within a distance, and otherwise the same as its robot. In each tick both
decide, and the robot does what its own mind says: so all decisions that are compared are about the same situation. A
near mind keeps what it decided before, such as its target, so a decision that differs can make later ones differ.

What the difference is worth is another question. It is answered by whole runs with and without a radio of that range.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from functools import partial
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
SEEDS, SEEDS_QUICK = (1, 2), (1,)
TIMES = (1.0, 2.0, 4.0)
"""The distances that are tried, as multiples of the horizon."""

APART = math.pi / 4.0
"""Directions that differ by more lie in different sectors of the paper's eight, rad."""

FOREVER_S = 1e9

POLICIES: Mapping[str, Mapping[str, object]] = {
    "default policy": {},
    "paper's policy": {"patrol.commitment": "none"},
}


def tasks() -> list[Task]:
    """The measures of hearing only those near."""
    return [
        Task(HORIZON, f"{policy}, {times:g} x the horizon", partial(_compare, settings, times))
        for policy, settings in POLICIES.items()
        for times in TIMES
    ]


def horizon_m(prepared: Prepared) -> float:
    """The path length beyond which no force can change a decision of the paper's policy, m.

    Args:
        prepared: The scenario.
    """
    fields, point = prepared.fields[1], prepared.scenario.point
    longest = 400 * sum(fields.reach.shape)
    law = ForceLaw(prepared.scenario.patrol, point, int(fields.patrolled.sum()), longest)
    return law.limit * point / 100.0


def _compare(settings: Mapping[str, object], times: float, effort: Effort) -> Sequence[Measured]:
    size, seeds = (SIZE_QUICK, SEEDS_QUICK) if effort.quick else (SIZE, SEEDS)
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        scenario = square_scenario(size, Path(folder))
        scenario["duration"] = DURATION_QUICK_S if effort.quick else DURATION_S
        prepared = prepare(load_scenario(scenario, settings))
        reach = times * (horizon_m(prepared) + prepared.scenario.sensor.range)
        differ, turned, heard = decisions_that_differ(prepared, reach, effort.seconds)
        ratios = [_mfow(scenario, settings, seed, reach) / _mfow(scenario, settings, seed) for seed in seeds]
    distance = f"heard within {reach:.0f} m"
    return [
        Measured("decisions that differ", "%", (100.0 * differ,), says=f"{distance}, {size} robots"),
        Measured("by more than 45 degrees", "%", (100.0 * turned,), says="of all decisions"),
        Measured("robots heard", "", (heard,), says=f"on average, of {size - 1}"),
        Measured(
            "late mean MFoW, as a ratio to hearing all", "", tuple(ratios), says=f"seeds {', '.join(map(str, seeds))}"
        ),
    ]


def decisions_that_differ(prepared: Prepared, reach: float, seconds: float = FOREVER_S) -> tuple[float, float, float]:
    """Compare near minds with those that hear everybody, tick by tick.

    Args:
        prepared: The scenario.
        reach: From how far a near mind hears positions, m.
        seconds: Wall time after which the comparison ends, s.

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
    until = time.monotonic() + seconds
    for k in range(prepared.scenario.ticks):
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
        if time.monotonic() > until:
            break
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


_known: dict[str, float] = {}
"""MFoW of fleets in which everybody is heard, which several distances are compared with."""


def _mfow(scenario: Mapping[str, Any], settings: Mapping[str, object], seed: int, reach: float | None = None) -> float:
    """The late mean MFoW of a whole run, s; reach: from how far radios are heard, m, None for any distance."""
    chosen = {**settings, "seed": seed}
    if reach is not None:
        faults = [{"kind": "range", "reach": reach}]
        return run_apart({**scenario, "faults": faults}, FOREVER_S, settings=chosen).mfow_late_s
    key = repr((scenario["name"], scenario["duration"], sorted(chosen.items())))
    if key not in _known:
        _known[key] = run_apart(scenario, FOREVER_S, settings=chosen).mfow_late_s
    return _known[key]
