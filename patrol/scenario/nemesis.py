"""The nemesis: random faults, drawn into a concrete timeline when a scenario is loaded.

In each interval one fault begins, at a drawn tick and of a drawn kind, and lasts for 0.3 to 2 intervals. All have ended
before the quiet window at the end of the run: killed robots are started again, paused ones go on, and those that
left join again. A robot suffers one process fault at a time, and there is always one that suffers none.
"""

from __future__ import annotations

import math
from typing import Any

from patrol.faults.kinds import Join, Leave
from patrol.faults.nemesis import DRAWN, RobotsHit, When, draw_fault, room_for
from patrol.random import Draws, Purpose
from patrol.scenario.model import Scenario

SHORTEST, LONGEST = 0.3, 2.0
"""Shortest and longest time of a fault, in intervals."""


def written_out(scenario: Scenario) -> Scenario:
    """Replace a scenario's nemesis by concrete faults, after those that it has."""
    if scenario.nemesis is None:
        return scenario
    mapping = scenario.model_dump(mode="json", exclude_none=True, exclude={"nemesis"})
    return Scenario.model_validate(mapping | {"faults": mapping["faults"] + drawn_faults(scenario)})


def drawn_faults(scenario: Scenario) -> list[dict[str, Any]]:
    """Draw the concrete faults of a scenario's nemesis, by the intervals they begin in.

    They are entries of the scenario's `faults`. They depend on the nemesis, the roster, the seed, the step and the
    duration, and on spare robots that the scenario's own faults let join or leave.
    """
    spec, step = scenario.nemesis, scenario.step
    if spec is None:
        return []
    end, width = room_for(spec, step, scenario.ticks)
    seed = scenario.seed if spec.seed is None else spec.seed
    kinds = tuple(DRAWN) if spec.kinds == "all" else spec.kinds
    robots = RobotsHit([robot.name for robot in scenario.roster if not robot.spare], _coming_and_going(scenario))
    taken_ids = {fault.id for fault in scenario.faults}
    drawn: list[dict[str, Any]] = []
    for slot in range(math.ceil(end / width)):
        draws = Draws(seed, Purpose.NEMESIS, slot)
        first = math.ceil(slot * width)
        begin = draws.whole(first, max(first, min(end, math.ceil((slot + 1) * width)) - 1))
        length = max(1, round(width * draws.between(SHORTEST, LONGEST)))
        if begin < end:
            when = When(step, begin, min(end, begin + length))
            drawn += _number_faults(draw_fault(draws, kinds, robots, when), slot + 1, taken_ids)
    return drawn


def _coming_and_going(scenario: Scenario) -> set[str]:
    """Find the robots that the scenario's own faults may let join or leave."""
    names = {robot.name for robot in scenario.roster}
    coming_and_going: set[str] = set()
    for fault in scenario.faults:
        if isinstance(fault, Join | Leave):
            who = {fault.who} if isinstance(fault.who, str) else fault.who if isinstance(fault.who, tuple) else names
            coming_and_going |= names.intersection(who) or names
    return coming_and_going


def _number_faults(faults: list[dict[str, Any]], number: int, taken: set[str | None]) -> list[dict[str, Any]]:
    """Give a fault and what heals it ids that no other fault has."""
    name = f"n{number}"
    while taken.intersection((name, f"{name}-heals")):
        name = f"{name}x"
    return [{"id": name if index == 0 else f"{name}-heals", **fault} for index, fault in enumerate(faults)]
