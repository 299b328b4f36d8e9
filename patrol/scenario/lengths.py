"""The lengths of the patrol that follow a robot's body, where the scenario leaves them to ``auto``.

The paper's lengths belong to the paper's body: radius 1 m, 4.4 m/s, steps of 0.5 s. Kept for a robot of 0.3 m at 1 m/s
they make it swing between two goals across a doorway. So ``auto`` takes them as multiples of radius, stride and sensor
range that give the paper's numbers for the paper's body. This module is the only place that resolves ``auto``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from patrol.pose import TAU
from patrol.values.section import wrong
from patrol.values.types import AUTO, LARGEST, Auto

if TYPE_CHECKING:
    from patrol.scenario.model import Scenario
    from patrol.scenario.robots import RobotSpec

STANDING_GAP = 1.0
"""Gap between two bodies that stand around an intruder, m."""

MILLIMETRE = 1e-3

NAMED = 8
"""Robots of one length that a note names."""


@dataclass(frozen=True, slots=True)
class BodyLengths:
    """The lengths of one robot's patrol, in m; the defaults are the paper's, for the paper's body.

    Attributes:
        goal_distance: From the robot to its goal (paper, step 7: 5.5 m). Auto: 2.5 strides, at least 5.5 radii and one
            point.
        refine_side: Side of the square in which the goal is refined (paper: 2 m). Auto: 2 radii, at most twice the
            goal distance, so that the square does not reach behind the robot.
        refine_reach: Reach of the obstacle field psi (paper: 10 m). Auto: 10 radii, at least one point.
        dilatation: Half-width of the window that spreads staleness; 0 for none (paper, Table 7: 4 to 5 m is best for
            cars). Auto: 5 radii.
        obstacle_radius: Radius of the artificial obstacle at each other robot. Auto: 5 radii.
        fuzzy_distance: R_0, from which an obstacle weakens its sector. Auto: 5.5 radii.
        surround_distance: From an intruder to the robots around it. Auto: 8 radii or what all robots need to stand
            there side by side, whichever is more, but at most 0.8 sensor ranges. It follows the largest radius of the
            team, because all robots must agree on the ring.
        critical_width: Passages narrower than this are critical areas. Auto: 8 radii.
    """

    goal_distance: float = 5.5
    refine_side: float = 2.0
    refine_reach: float = 10.0
    dilatation: float = 5.0
    obstacle_radius: float = 5.0
    fuzzy_distance: float = 5.5
    surround_distance: float = 8.0
    critical_width: float = 8.0


PAPER_LENGTHS = BodyLengths()
"""The lengths of the paper's body."""

FIELDS = tuple(field.name for field in fields(BodyLengths))
"""The fields of a scenario's section `patrol` that may be ``auto``."""


def lengths_of(scenario: Scenario, spec: RobotSpec) -> BodyLengths:
    """The lengths of one robot's patrol.

    Args:
        scenario: Its patrol, sensor, step, point and roster are used.
        spec: The robot, one of the roster.

    Returns:
        What the scenario states, and for each ``auto`` what follows from the body. Resolved lengths are multiples of
        1 mm.
    """
    return _lengths(scenario, spec.radius, spec.speed, _ring(scenario))


def lengths_by_robot(scenario: Scenario) -> dict[int, BodyLengths]:
    """The lengths of every robot's patrol, by robot number; robots of one radius and speed share an object.

    Args:
        scenario: As for `lengths_of`.
    """
    ring = _ring(scenario)
    bodies = {(spec.radius, spec.speed) for spec in scenario.roster}
    found = {body: _lengths(scenario, *body, ring) for body in bodies}
    return {spec.number: found[spec.radius, spec.speed] for spec in scenario.roster}


def common_lengths(scenario: Scenario) -> dict[str, float]:
    """What each ``auto`` of a scenario comes to, where it is the same for all robots of the roster.

    Args:
        scenario: As for `lengths_of`.

    Returns:
        Lengths in m by field of the section `patrol`.
    """
    each = set(lengths_by_robot(scenario).values())
    found = {name: {getattr(lengths, name) for lengths in each} for name in FIELDS}
    return {
        name: values.pop()
        for name, values in found.items()
        if getattr(scenario.patrol, name) == AUTO and len(values) == 1
    }


def notes_on_lengths(scenario: Scenario) -> Mapping[str, str]:
    """What each field that stays ``auto`` comes to for the robots of a mixed team.

    Args:
        scenario: Loaded, so that a field is ``auto`` only where robots differ.

    Returns:
        One line such as ``here 6.6 for truck, 1.65 for scout-1 and scout-2``, by dotted field.
    """
    each = lengths_by_robot(scenario)
    notes = {}
    for name in FIELDS:
        if getattr(scenario.patrol, name) != AUTO:
            continue
        robots: dict[float, list[str]] = {}
        for spec in scenario.roster:
            robots.setdefault(getattr(each[spec.number], name), []).append(spec.name)
        notes[f"patrol.{name}"] = "here " + ", ".join(f"{value:g} for {_listed(who)}" for value, who in robots.items())
    return notes


def check_lengths(scenario: Scenario) -> None:
    """Refuse a square of refinement that would reach behind a robot.

    Args:
        scenario: As for `lengths_of`.

    Raises:
        PydanticCustomError: The side that the scenario states is more than twice a robot's goal distance. It names the
            side, because ``auto`` never leads to that.
    """
    each = lengths_by_robot(scenario)
    mixed = len({lengths.goal_distance for lengths in each.values()}) > 1
    for spec in scenario.roster:
        side, distance = each[spec.number].refine_side, each[spec.number].goal_distance
        if side > 2.0 * distance:
            how = "" if scenario.patrol.goal_distance != AUTO else f" (auto, for {spec.name})" if mixed else " (auto)"
            limit = f"patrol.goal_distance is {distance:g} m{how}, so at most {2.0 * distance:g}"
            raise wrong("patrol.refine_side", f"the square must not reach behind the robot: {limit}", side)


def _lengths(scenario: Scenario, radius: float, speed: float, ring: float) -> BodyLengths:
    """The lengths for a radius in m, a top speed in m/s and an automatic `surround_distance` in m."""
    patrol, point = scenario.patrol, min(scenario.point, LARGEST)
    stride = speed * scenario.step
    goal = _stated(patrol.goal_distance, max(_rounded(max(2.5 * stride, 5.5 * radius)), point))
    return BodyLengths(
        goal_distance=goal,
        refine_side=_stated(patrol.refine_side, min(_rounded(2.0 * radius), 2.0 * goal)),
        refine_reach=_stated(patrol.refine_reach, max(_rounded(10.0 * radius), point)),
        dilatation=_stated(patrol.dilatation, _rounded(5.0 * radius)),
        obstacle_radius=_stated(patrol.obstacle_radius, _rounded(5.0 * radius)),
        fuzzy_distance=_stated(patrol.fuzzy_distance, _rounded(5.5 * radius)),
        surround_distance=_stated(patrol.surround_distance, ring),
        critical_width=_stated(patrol.critical_width, _rounded(8.0 * radius)),
    )


def _ring(scenario: Scenario) -> float:
    """The automatic `surround_distance` of a team, m."""
    radii = [spec.radius for spec in scenario.roster]
    widest = max(radii)
    side_by_side = len(radii) * (2.0 * widest + STANDING_GAP) / TAU
    return _rounded(min(max(8.0 * widest, side_by_side), 0.8 * scenario.sensor.range))


def _stated(value: float | Auto, automatic: float) -> float:
    return automatic if value == AUTO else value


def _rounded(length: float) -> float:
    """A length in whole millimetres, and within what a scenario may state."""
    return min(max(round(length, 3), MILLIMETRE), LARGEST)


def _listed(names: list[str]) -> str:
    """Names as text: ``a, b and c``, or the first few and how many more there are."""
    if len(names) > NAMED:
        names = [*names[:NAMED], f"{len(names) - NAMED} more"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
