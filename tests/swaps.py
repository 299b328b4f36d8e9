"""Swaps: two robots in two small rooms that a corridor joins, each of which has to get to the other's room.

    python -m tests.swaps                              # 1,002 swaps, as a table: some minutes
    python -m tests.swaps --count 50 --team car        # 50 swaps of cars alone
    python -m tests.swaps --wide                       # corridors of two to six bodies, in which they can pass

    +-------+                  +-------+
    | 1     +------------------+       |       The corridor is one to two bodies wide. In a narrow one the robots cannot
    |                                  |       pass each other, so one of them has to go back and let the other through.
    |       +------------------+     2 |
    +-------+                  +-------+

Robots tell each other nothing but their positions. A swap passes when both robots are in the other's room at once,
within `LIMIT` times as long as the slower one needs alone.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from pydantic import BaseModel

from agent.policies.pursuit import NEARER, NO_NEARER_S, GivenUp
from agent.ports import Intent, Place, PolicySetup
from fogwatch.inprocess import run_in_process
from patrol.ground.terrain import Terrain
from patrol.prepare import prepare
from patrol.random import Purpose, draw
from patrol.scenario import load_scenario

if TYPE_CHECKING:
    from agent.view import View
    from patrol.journal import TickRecord
    from patrol.scenario import Scenario

LIMIT = 10.0
"""A swap has to be over after so many times as long as the slower robot needs alone."""

TEAMS: Mapping[str, tuple[str, str]] = {
    "holonomic": ("holonomic", "holonomic"),
    "differential": ("differential", "differential"),
    "car": ("car", "car"),
    "holonomic, differential": ("holonomic", "differential"),
    "differential, car": ("differential", "car"),
    "car, holonomic": ("car", "holonomic"),
}
"""The bodies of robots 1 and 2."""

CLASSES = (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.1)
"""Bounds of the classes of corridors by width, in bodies."""

NARROW, WIDE = (1, 2), (2, 6)
"""Least and greatest width of a corridor, in bodies; a wide one may have a point more."""

PER_TEAM = 167
"""Swaps of each team: 1,002 in all."""

POINT = 0.05
"""Side of the terrain's points, m."""

BORDER = 2
"""Thickness of the solid border, points."""

RADII = (0.2, 0.25, 0.3, 0.35, 0.4)
"""Of the robots, m; both robots of a swap have the same."""

SPEED = 1.0
"""Top speed of all robots, m/s."""

LONGEST_ALONE_S = 300.0
"""A robot that needs longer alone cannot make the swap at all, s."""

Box = tuple[float, float, float, float]
"""Least x, least y, greatest x and greatest y of a room, m."""


class SwapPolicy:
    """Goes from place to place in the other room, and gives a place up as `committed` does."""

    class Options(BaseModel):
        """The fields of `patrol.options`."""

        rooms: tuple[Box, Box]
        """The rooms in which robots 1 and 2 start."""

    def __init__(self, setup: PolicySetup) -> None:
        """Find the places in the other room where the body fits."""
        spec, terrain, reach = setup.robot.spec, setup.ground.terrain, setup.ground.fields.reach
        room = setup.options.rooms[2 - spec.number]
        self._places = [
            (row, col)
            for row, col in np.argwhere(reach).tolist()
            if is_in(room, *terrain.centre(row, col), margin=spec.radius)
        ]
        self._given_up = GivenUp(spec.radius, terrain.point, setup.fleet.step)
        self._patience = round(NO_NEARER_S / setup.fleet.step)
        self._target: tuple[int, int] | None = None
        self._shortest = math.inf
        self._progress_at = 0

    def decide(self, view: View) -> Intent:
        """Return the place to go to."""
        target = self._target
        if target is not None and view.tick - self._progress_at > self._patience:
            self._given_up.add(view.tick, target)
            target = None
        if target is None or view.point_of((view.pose.x, view.pose.y)) == target:
            self._target = target = self._choose(view)
            self._shortest, self._progress_at = math.inf, view.tick
        place = view.place_of(target)
        way = view.way(place)
        if way is not None and way.place == place and way.length < self._shortest - NEARER * view.stride:
            self._shortest, self._progress_at = way.length, view.tick
        return Place(*place, exact=True, gives_room=True)

    def _choose(self, view: View) -> tuple[int, int]:
        left_out = {(row, col) for row, col, until, _ in self._given_up.places if view.tick < until}
        places = [place for place in self._places if place not in left_out]
        return places[int(view.draw() * len(places))]


@dataclass(frozen=True)
class Passage:
    """Two rooms and a corridor, and the robots in them.

    Attributes:
        terrain: The ground.
        rooms: The rooms in which robots 1 and 2 start.
        width: Of the corridor, in bodies.
        robots: The scenario's robots.
    """

    terrain: Terrain
    rooms: tuple[Box, Box]
    width: float
    robots: tuple[Mapping[str, object], Mapping[str, object]]


@dataclass(frozen=True)
class Swap:
    """The result of a swap.

    Attributes:
        seed: It is drawn from.
        team: A key of `TEAMS`.
        width: Of the corridor, in bodies.
        alone_s: Time that the slower robot needs alone, s.
        took_s: Time that both need together, s; infinity where the swap did not pass.
        collisions: Moves of both robots that were cancelled.
    """

    seed: int
    team: str
    width: float
    alone_s: float
    took_s: float
    collisions: int

    @property
    def passed(self) -> bool:
        """Both robots got to the other's room in time."""
        return self.took_s <= LIMIT * self.alone_s

    @property
    def ratio(self) -> float:
        """Time together by time alone."""
        return self.took_s / self.alone_s


def is_in(room: Box, x: float, y: float, margin: float = 0.0) -> bool:
    """Return True if a place is in a room.

    Args:
        room: The room.
        x: m.
        y: m.
        margin: Least distance to the room's sides, m.
    """
    left, bottom, right, top = room
    return left + margin <= x <= right - margin and bottom + margin <= y <= top - margin


def random_passage(seed: int, team: str, widths: tuple[int, int] = NARROW) -> Passage:
    """Draw a passage: the radius, both rooms (2.5 to 5 bodies a side), the corridor (2 to 12 bodies long), the starts.

    Args:
        seed: Random seed.
        team: A key of `TEAMS`.
        widths: Bounds of the corridor's width, in bodies; rooms are at least as wide.
    """
    number = iter(range(100))

    def between(low: float, high: float) -> float:
        return low + (high - low) * draw(seed, Purpose.START, next(number))

    radius = RADII[int(between(0, len(RADII)))]
    body = round(2.0 * radius / POINT)
    # Routes need a point more room than the body does.
    narrowest, widest = widths
    width = narrowest * body + 1 + int(between(0, (widest - narrowest) * body))
    length = round(between(2.0, 12.0) * body)
    sides = [round(between(2.5, 5.0) * body) for _ in range(4)]
    across_1, up_1, across_2, up_2 = sides[0], max(sides[1], width), sides[2], max(sides[3], width)
    low_1, low_2 = (-round(between(0.0, up - width)) for up in (up_1, up_2))
    bottom = min(low_1, low_2) - BORDER
    shape = (max(low_1 + up_1, low_2 + up_2) - bottom + BORDER, across_1 + length + across_2 + 2 * BORDER)
    free = np.zeros(shape, dtype=np.bool_)
    boxes: list[Box] = []
    for left, low, across, up in (
        (BORDER, low_1, across_1, up_1),
        (BORDER + across_1 + length, low_2, across_2, up_2),
        (BORDER + across_1, 0, length, width),
    ):
        free[low - bottom : low - bottom + up, left : left + across] = True
        bottom_row = low - bottom
        boxes.append((left * POINT, bottom_row * POINT, (left + across) * POINT, (bottom_row + up) * POINT))
    rooms = boxes[0], boxes[1]
    turning = between(2.0, 3.0) * radius
    robots = []
    for model, (west, south, east, north) in zip(TEAMS[team], rooms, strict=True):
        margin = radius + POINT
        start = [between(west + margin, east - margin), between(south + margin, north - margin), between(-3.0, 3.0)]
        robots.append(
            {"model": model, "radius": radius, "speed": SPEED, "turning_radius": round(turning, 2), "start": start}
        )
    return Passage(Terrain("passage", free, POINT), rooms, width / body, (robots[0], robots[1]))


def swap(seed: int, team: str, widths: tuple[int, int] = NARROW) -> Swap | None:
    """Let two robots swap their rooms, after each has driven alone.

    Args:
        seed: Random seed.
        team: A key of `TEAMS`.
        widths: As of `random_passage`.

    Returns:
        None where a robot cannot get to the other's room even alone.
    """
    passage = random_passage(seed, team, widths)
    alone_s = max(_drive(passage, seed, [number], LONGEST_ALONE_S)[0] for number in (1, 2))
    if alone_s == math.inf:
        return None
    took_s, collisions = _drive(passage, seed, [1, 2], LIMIT * alone_s)
    return Swap(seed, team, passage.width, alone_s, took_s, collisions)


def _drive(passage: Passage, seed: int, numbers: Sequence[int], longest_s: float) -> tuple[float, int]:
    """Return after how many seconds all of some robots are in the other room, and their collisions."""
    scenario = swap_scenario(passage, seed, numbers, longest_s)
    done_at = math.inf

    def look(record: TickRecord) -> None:
        nonlocal done_at
        if all(is_in(passage.rooms[2 - row.number], row.x, row.y) for row in record.robots if row.number in numbers):
            done_at = min(done_at, record.k * scenario.step)

    outcome = run_in_process(
        prepare(scenario, passage.terrain), keep=False, verify_fog=False, progress=look, stop=lambda: done_at < math.inf
    )
    return done_at, sum(robot.collisions for robot in outcome.summary.robots.values())


def swap_scenario(passage: Passage, seed: int, numbers: Sequence[int], longest_s: float) -> Scenario:
    """The scenario of a swap.

    Args:
        passage: Where.
        seed: Random seed.
        numbers: Of the robots that drive; the other one never joins.
        longest_s: How long, s.
    """
    robots = [{**robot, "spare": number not in numbers} for number, robot in enumerate(passage.robots, start=1)]
    return load_scenario(
        {
            "name": f"swap-{seed}",
            "terrain": {"builtin": "open"},
            "point": POINT,
            "duration": math.ceil(longest_s),
            "seed": seed,
            "robots": robots,
            "sensor": {"range": 3.0},
            "patrol": {"policy": "tests.swaps:SwapPolicy", "options": {"rooms": passage.rooms}},
        }
    )


def table(swaps: Sequence[Swap]) -> str:
    """Return the results by team and width of the corridor as a table in Markdown.

    Args:
        swaps: In any order.
    """
    lines = ["| bodies | corridor | passed | time, median | 95 % | collisions |", "|---|---|---|---|---|---|"]
    bounds = [*pairwise(CLASSES), (CLASSES[0], CLASSES[-1])]
    for team in TEAMS:
        for low, high in bounds:
            some = [each for each in swaps if each.team == team and low < each.width <= high]
            if not some:
                continue
            ratios = [each.ratio for each in some if each.passed]
            median, late = np.quantile(ratios, (0.5, 0.95)) if ratios else (math.nan, math.nan)
            collisions = sum(each.collisions for each in some) / len(some)
            lines.append(
                f"| {team} | {low:g} to {high:g} | {len(ratios)} of {len(some)} "
                f"| {median:.1f} | {late:.1f} | {collisions:.1f} |"
            )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Let robots swap rooms, and print a table.

    Args:
        arguments: The command line; this process's own unless given.

    Returns:
        The exit code: 0 all swaps passed, 1 at least one did not.
    """
    parser = argparse.ArgumentParser(prog="python -m tests.swaps", description="Two robots swap rooms.")
    parser.add_argument("--count", type=int, default=PER_TEAM, help="swaps of each team")
    parser.add_argument("--team", choices=TEAMS, action="append", help="a team; again for more; all unless given")
    parser.add_argument("--wide", action="store_true", help="corridors of two to six bodies instead of one to two")
    options = parser.parse_args(arguments)
    widths = WIDE if options.wide else NARROW
    numbered = [(seed, team) for team in options.team or TEAMS for seed in range(options.count)]
    swaps = [each for seed, team in numbered if (each := swap(seed, team, widths))]
    print(table(swaps))
    failed = [each for each in swaps if not each.passed]
    for each in failed:
        print(f"{each.team}, seed {each.seed}: a corridor of {each.width:.2f} bodies, {each.alone_s:g} s alone")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
