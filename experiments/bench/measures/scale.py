"""What a router carries, measured, and what fleets of up to 100,000 robots would need of routers, modelled."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.bench.measures.fleets import STEP_S, square_scenario
from experiments.bench.measures.horizon import horizon_m
from experiments.bench.tools.groups import SCALE
from experiments.bench.tools.measure import Effort, Measured, Task, Unmeasured
from experiments.bench.traffic_model import Fleet, RouterCost, cores_needed, largest_fleet, regions_of
from patrol.prepare import prepare
from patrol.scenario import load_scenario

MEMBERS, MEMBERS_QUICK = (10, 20, 40), (10,)
MODELLED = (100, 1_000, 10_000, 100_000)
DENSITY = 100.0 / 1e6
"""Robots per m2 of the modelled fleets: a hundred on a square kilometre."""

SHARE = 0.5
"""The share of a core that a router is given: ticks come in bursts."""

READINGS, READINGS_QUICK = 5, 1
WINDOW_S = 4.0
PATIENCE_S = 120.0


def tasks() -> list[Task]:
    """The measures and the models."""
    return [
        Task(SCALE, "what one router carries", _router),
        *(Task(SCALE, f"model of {size} robots", partial(_model, size)) for size in MODELLED),
    ]


def _router(effort: Effort) -> Sequence[Measured]:
    found = []
    for members in MEMBERS_QUICK if effort.quick else MEMBERS:
        costs = _costs(members, effort)
        says = f"{members} members, each heard by all others"
        found += [
            Measured("processor time per delivery", "us", tuple(1e6 * cost.core_s for cost in costs), says=says),
            Measured("loopback bytes per delivery", "bytes", tuple(cost.wire_bytes for cost in costs), says=says),
        ]
    return found


@cache
def _costs(members: int, effort: Effort) -> tuple[RouterCost, ...]:
    """Some readings of what a delivery costs."""
    readings = READINGS_QUICK if effort.quick else READINGS
    return tuple(router_cost(members, WINDOW_S / 4.0 if effort.quick else WINDOW_S) for _ in range(readings))


def router_cost(members: int, seconds: float) -> RouterCost:
    """What a delivery costs a router, measured in a process of its own.

    Args:
        members: How many send and hear.
        seconds: Wall time, s.

    Raises:
        Unmeasured: The measurement failed.
    """
    arguments = ["--members", str(members), "--seconds", str(seconds)]
    command = [sys.executable, "-P", "-m", "fogwatch.router_load", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S + seconds)
    except subprocess.TimeoutExpired:
        raise Unmeasured("the measurement of the router did not end") from None
    if done.returncode != 0:
        raise Unmeasured((done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1])
    load = json.loads(done.stdout)
    return RouterCost(load["router_s"] / load["deliveries"], load["loopback_bytes"] / load["deliveries"])


def _model(size: int, effort: Effort) -> Sequence[Measured]:
    members = (MEMBERS_QUICK if effort.quick else MEMBERS)[-1]
    costs = sorted(_costs(members, effort), key=lambda cost: cost.core_s)
    return modelled(Fleet(size, 1.0 / STEP_S, DENSITY), costs[len(costs) // 2], _reach())


@cache
def _reach() -> float:
    """The horizon of the paper's policy on the square kilometre and the range of a sensor, m."""
    with TemporaryDirectory(prefix="fogwatch-bench-") as folder:
        prepared = prepare(load_scenario(square_scenario(1, Path(folder))))
    return horizon_m(prepared) + prepared.scenario.sensor.range


def modelled(fleet: Fleet, cost: RouterCost, reach: float) -> list[Measured]:
    """What a fleet needs of routers.

    Args:
        fleet: The fleet.
        cost: Of a delivery, measured.
        reach: From how far robots hear where they do not hear everybody, m.
    """
    regions = regions_of(fleet, cost, reach, SHARE)
    alone = largest_fleet(fleet.rate, cost, SHARE)
    near = f"heard within {reach:.0f} m"
    return [
        Measured("deliveries, everybody heard", "1/s", (fleet.deliveries(),)),
        Measured(
            "cores of one router, everybody heard",
            "",
            (cores_needed(fleet, cost),),
            says=f"half a core carries {alone} robots",
        ),
        Measured("traffic, everybody heard", "MB/s", (1e-6 * fleet.deliveries() * cost.wire_bytes,)),
        Measured("robots heard", "", (fleet.heard(reach),), says=near),
        Measured("deliveries", "1/s", (fleet.deliveries(reach),), says=near),
        Measured("traffic", "MB/s", (1e-6 * fleet.deliveries(reach) * cost.wire_bytes,), says=near),
        Measured("a robot receives", "kB/s", (1e-3 * fleet.heard(reach) * fleet.rate * cost.wire_bytes,), says=near),
        Measured(
            "routers of half a core",
            "",
            (float(regions.count),),
            says=f"{regions.robots:.0f} robots each, and {regions.foreign:.0f} of other regions heard",
        ),
    ]
