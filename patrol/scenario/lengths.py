"""The lengths of the patrol that follow a robot's body, where the scenario leaves them to ``auto``.

The paper's lengths belong to the paper's body: radius 1 m, 4.4 m/s, steps of 0.5 s. Kept for a robot of 0.3 m at 1 m/s
they make it swing between two goals across a doorway. So ``auto`` takes them as multiples of radius, stride and sensor
range that give the paper's numbers for the paper's body. This module is the only place that resolves ``auto``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

from patrol.errors import BadInput
from patrol.pose import TAU
from patrol.scenario.policies import OPTION_LENGTHS, PatrolOptions, PatrolSpec
from patrol.scenario.sections import RobotSpec
from patrol.values import AUTO, LARGEST, Auto, wrong

STANDING_GAP = 1.0
"""Gap between two bodies that stand around an intruder, m."""

MILLIMETRE = 1e-3


@dataclass(frozen=True, slots=True)
class BodyLengths:
    """The lengths of one robot's patrol, in m; the defaults are the paper's, for the paper's body."""

    # from the robot to its goal (paper, step 7: 5.5 m); auto: 2.5 strides, at least 5.5 radii and one point
    goal_distance: float = 5.5
    # side of the square in which the goal is refined (paper: 2 m); auto: 2 radii, at most twice the goal distance, so
    # that the square does not reach behind the robot
    refine_side: float = 2.0
    refine_reach: float = 10.0  # reach of the obstacle field psi (paper: 10 m); auto: 10 radii, at least one point
    # half-width of the window that spreads staleness, 0 for none (paper, Table 7: 4 to 5 m is best for cars); auto: 5
    # radii
    dilatation: float = 5.0
    obstacle_radius: float = 5.0  # of the artificial obstacle at each other robot; auto: 5 radii
    fuzzy_distance: float = 5.5  # R_0, from which an obstacle weakens its sector; auto: 5.5 radii
    # from an intruder to the robots around it; auto: 8 radii or what all robots need to stand there side by side,
    # whichever is more, but at most 0.8 sensor ranges; of the team's largest radius, as all robots must agree on the
    # ring
    surround_distance: float = 8.0
    critical_width: float = 8.0  # passages narrower than this are critical areas; auto: 8 radii

    def with_options(self, options: object) -> BodyLengths:
        """Replace lengths by those that a policy's settings state.

        Of a policy that is not built in only a field `dilatation` counts; BadInput if it is no length.
        """
        names = OPTION_LENGTHS if isinstance(options, PatrolOptions) else OPTION_LENGTHS[:1]
        chosen = {name: getattr(options, name, AUTO) for name in names}
        for name, length in chosen.items():
            if length != AUTO and not (isinstance(length, int | float) and 0.0 <= length <= LARGEST):
                raise BadInput(f"patrol.options.{name} = {length!r}: expected a length from 0 on, in m, or auto")
        return replace(self, **{name: float(length) for name, length in chosen.items() if length != AUTO})


PAPER_LENGTHS = BodyLengths()
"""The lengths of the paper's body."""

FIELDS = tuple(field.name for field in fields(BodyLengths) if field.name not in OPTION_LENGTHS)
"""The fields of a scenario's section `patrol` that may be ``auto``."""


def resolve_lengths(
    patrol: PatrolSpec, roster: Sequence[RobotSpec], point: float, step: float, sensor_range: float
) -> Mapping[int, BodyLengths]:
    """Return the lengths of every robot's patrol, by robot number.

    For example, a robot of 0.3 m at 1 m/s with steps of 0.5 s has a goal distance of 1.65 m and a dilatation of 1.5 m.

    They are what the section states, and for each ``auto`` what follows from the body, in multiples of 1 mm. Robots of
    one radius and speed share an object. `point` and `sensor_range` are in m, `step` is in s.
    """
    ring = _ring_radius(roster, sensor_range)
    bodies = {(spec.radius, spec.speed) for spec in roster}
    by_body = {
        (radius, speed): _compute_lengths(patrol, radius, speed * step, min(point, LARGEST), ring)
        for radius, speed in bodies
    }
    return {spec.number: by_body[spec.radius, spec.speed] for spec in roster}


def check_refinement(patrol: PatrolSpec, roster: Sequence[RobotSpec], lengths: Mapping[int, BodyLengths]) -> None:
    """Refuse a square of refinement that would reach behind a robot.

    Such a side is more than twice a robot's goal distance. The error names the side that the scenario states, because
    ``auto`` never leads to that.
    """
    mixed = len({body.goal_distance for body in lengths.values()}) > 1
    for spec in roster:
        side, distance = lengths[spec.number].refine_side, lengths[spec.number].goal_distance
        if side > 2.0 * distance:
            how = "" if patrol.goal_distance != AUTO else f" (auto, for {spec.name})" if mixed else " (auto)"
            limit = f"patrol.goal_distance is {distance:g} m{how}, so at most {2.0 * distance:g}"
            raise wrong("patrol.refine_side", f"the square must not reach behind the robot: {limit}", side)


def _compute_lengths(patrol: PatrolSpec, radius: float, stride: float, point: float, ring: float) -> BodyLengths:
    """Compute the lengths for a radius, a stride, a point and an automatic `surround_distance`, all in m."""
    goal = _resolve_length(patrol.goal_distance, max(_round_length(max(2.5 * stride, 5.5 * radius)), point))
    return BodyLengths(
        goal_distance=goal,
        refine_side=_resolve_length(patrol.refine_side, min(_round_length(2.0 * radius), 2.0 * goal)),
        refine_reach=_resolve_length(patrol.refine_reach, max(_round_length(10.0 * radius), point)),
        surround_distance=_resolve_length(patrol.surround_distance, ring),
        dilatation=_round_length(5.0 * radius),
        obstacle_radius=_round_length(5.0 * radius),
        fuzzy_distance=_round_length(5.5 * radius),
        critical_width=_round_length(8.0 * radius),
    ).with_options(patrol.options)


def _ring_radius(roster: Sequence[RobotSpec], sensor_range: float) -> float:
    """Return the automatic `surround_distance` of a team, m."""
    radii = [spec.radius for spec in roster]
    widest = max(radii)
    side_by_side = len(radii) * (2.0 * widest + STANDING_GAP) / TAU
    return _round_length(min(max(8.0 * widest, side_by_side), 0.8 * sensor_range))


def _resolve_length(value: float | Auto, automatic: float) -> float:
    return automatic if value == AUTO else value


def _round_length(length: float) -> float:
    """Round a length to whole millimetres, and to what a scenario may state."""
    return min(max(round(length, 3), MILLIMETRE), LARGEST)
