"""A situation for tests of a policy: what it knows in one tick, from a drawing of the ground.

Theory of operation
    A drawing becomes the terrain of a scenario, and `agent.build` puts a robot's mind together on it, as for a run. The
    mind hears the other robots' frames, but with a sensor that sees nothing, so that ages are exactly those asked for.
    Its `look` then makes the view that the policy gets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from agent.policies.found import POLICIES
from fogwatch.testing.broken import class_of, put_up
from patrol.errors import BadInput, printable, quoted

if TYPE_CHECKING:
    from agent.belief.believed import BelievedFog
    from agent.ports import Intent, Policy, PolicySetup
    from agent.view import View
    from patrol.ground.footprint import Footprint
    from patrol.pose import Pose
    from patrol.scenario import Scenario

    Drawn = np.ndarray[Any, np.dtype[np.str_]]

WALL, FLOOR = "#", "."
MOST_DRAWN = 40_000
"""Characters of a drawing at most."""

POINTS = 5
"""Points along the side of a character: a body passes through a gap of one character, along its middle."""

MOST_AGE_S = 1e6
BODY = 0.3
"""Radius of the robots in sides of a character, unless given."""
GIVEN_OTHERWISE = {
    "terrain": "draw it",
    "point": "give side",
    "robots.count": "draw the robots",
    "robots.starts": "draw the robots",
    "patrol.policy": "give policy",
    "closures": "draw what is closed as walls",
}
"""Fields that no setting may name, and what to do instead."""


@dataclass(frozen=True, slots=True)
class Situation:
    """A policy's setup and view in one tick.

    Attributes:
        setup: What the policy was made with.
        view: What it sees.
        policy: The policy, which has decided nothing yet; None where none was given.
        places: By each character of the drawing but walls and floor, the middle (x, y) in m of the first that there is,
            from the top and from the left.
        drawing: The lines of the drawing, the upper one first.
        side: Of a character's square, m.
    """

    setup: PolicySetup
    view: View
    policy: Policy | None
    places: Mapping[str, tuple[float, float]]
    drawing: tuple[str, ...]
    side: float

    def character_at(self, x: float, y: float) -> str:
        """Return the character that is drawn at a place.

        Args:
            x: m.
            y: m.

        Raises:
            ValueError: The place is not on the drawing.
        """
        row, col = len(self.drawing) - 1 - math.floor(y / self.side), math.floor(x / self.side)
        if not (0 <= row < len(self.drawing) and 0 <= col < len(self.drawing[0])):
            raise ValueError(f"({x:g}, {y:g}) is not on the drawing")
        return self.drawing[row][col]

    def decide(self) -> Intent:
        """Ask the policy for its intent; what it raises comes through.

        Raises:
            ValueError: No policy was given.
            agent.ports.PolicyFailed: The answer is no intent.
        """
        from agent.answers import checked

        if self.policy is None:
            raise ValueError("draw_situation was given no policy; give one as its second argument")
        return checked(self.policy.decide(self.view))


def draw_situation(
    drawing: str,
    policy: type[Any] | str | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    ages: Mapping[str, float] | None = None,
    heard: Mapping[str, float] | None = None,
    side: float = 1.0,
    heading: float = 0.0,
    settings: Mapping[str, Any] | None = None,
) -> Situation:
    """Make the view of robot 1 from a drawing of the ground, for a unit test of a policy's choice.

        situation = draw_situation(
            '''
            #########
            #1..#..a#
            #...#...#
            #......2#
            #########
            ''',
            MyPolicy,
            ages={"a": 300},
        )
        intent = situation.decide()
        assert situation.character_at(intent.x, intent.y) == "a"

    Args:
        drawing: A character for each square of ground, the upper line at the highest y: ``#`` a wall, ``.`` floor,
            ``1`` the robot itself, ``2`` to ``9`` the others, from 2 on; letters are floor with a name. The lower left
            corner of the drawing is at (0, 0).
        policy: The class, or its name as in a scenario; None for a view alone.
        options: What `patrol.options` says.
        ages: By character, the age of its ground in s; 0 unless given. ``{".": 60, "a": 300}`` means that "a" is the
            stalest.
        heard: By character of another robot, how long ago it was heard last, s; 0 unless given.
        side: Of a character's square, m; the grid has 5 x 5 points on it.
        heading: Of all robots, rad.
        settings: More of the scenario, by dotted field, such as ``{"robots.model": "car", "sensor.range": 4}``. Robots
            are holonomic, with a radius of 0.3 sides, unless it says otherwise.

    Returns:
        The situation.

    Raises:
        BadInput: The drawing, an age or a setting is wrong.
        RuleBroken: There is no such policy.
    """
    from agent.belief.believed import Beliefs
    from agent.build import Shared, build_mind
    from agent.policies.found import PolicyKind, policy_of
    from patrol.exchange import Sensed
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.prepare import inboxes_of, prepare
    from patrol.radio.message import Position, as_received, encode

    grid = _read_drawing(drawing)
    robots = _robot_numbers(grid)
    places = {name: _middle_of(grid, name, side) for name in sorted(set(map(str, grid.flat)) - {WALL, FLOOR})}
    poses = {number: Pose(*places[str(number)], heading) for number in robots}
    scenario = _make_scenario(policy, options, poses, side, settings)
    prepared = prepare(scenario, Terrain("drawing", _point_characters(grid) != WALL, scenario.point))
    setups: list[PolicySetup] = []
    kind = policy_of(scenario)

    def make(setup: PolicySetup) -> Policy:
        setups.append(setup)
        return kind.make(setup)

    noted = PolicyKind(kind.name, make, kind.options, kind.ours)
    shared = Shared(prepared, kind=noted)
    shared.beliefs = Beliefs(
        inboxes_of(scenario, [1], prepared.terrain.bounds, None), _blind_footprint(shared.footprint)
    )
    mind = build_mind(shared, 1)
    ticks_ago = {name: _age_ticks(age, "ages", name, grid, scenario) for name, age in (ages or {}).items()}
    silent = {name: _age_ticks(age, "heard", name, grid, scenario) for name, age in (heard or {}).items()}
    for name in silent:
        if name not in {str(number) for number in robots if number != 1}:
            raise BadInput(f"heard: {name}: is no other robot of the drawing; name one, such as '2'")
    now = max([0, *ticks_ago.values(), *silent.values()])
    own_pose = as_received(poses[1])
    for tick in sorted({now, *(now - ago for ago in silent.values())}):
        heard_now = [number for number in robots if number != 1 and now - silent.get(str(number), 0) == tick]
        frames = [encode(Position.of(n, tick, tick * scenario.step, poses[n])) for n in heard_now]
        mind.belief.hear(tick, own_pose, frames)
    _let_age(mind.belief.shared, grid, ticks_ago, now)
    view = mind.look(Sensed(now, poses[1], clock_s=now * scenario.step))
    (setup,) = setups
    lines = tuple("".join(line) for line in grid)
    return Situation(setup, view, None if policy is None else mind.policy, places, lines, side)


def _blind_footprint(footprint: Footprint) -> Footprint:
    """Return a footprint that sees nothing, for the same ground and kind of sensor."""
    from patrol.ground.footprint import Footprint, SensorSetup
    from patrol.ground.footprint import View as SensorView

    class Blind:
        all_round = footprint.all_round
        leaves_age = footprint.leaves_age

        def __init__(self, setup: SensorSetup) -> None:
            del setup

        def visible(self, pose: Pose) -> SensorView:
            del pose
            return SensorView(0, 0, np.zeros((1, 1), dtype=np.uint8), np.ones((1, 1)) if self.leaves_age else None)

    setup = SensorSetup(footprint.terrain, footprint.range_m, footprint.line_of_sight)
    return Footprint(setup, Blind(setup))


def _read_drawing(drawing: str) -> Drawn:
    """Return the characters of a drawing, row 0 at the top."""
    if not isinstance(drawing, str):
        raise BadInput(f"drawing: {quoted(drawing)}: expected a text with a line for each row, such as '#1..a#'")
    lines = [line.strip() for line in drawing.strip().splitlines()]
    if not lines or not lines[0]:
        raise BadInput("drawing: is empty; draw a line for each row, such as '#1..a#'")
    if len(lines) * len(lines[0]) > MOST_DRAWN:
        raise BadInput(f"drawing: has more than {MOST_DRAWN} characters; draw a smaller one")
    for number, line in enumerate(lines, start=1):
        if len(line) != len(lines[0]):
            lengths = f"{len(line)} characters, line 1 {len(lines[0])}"
            raise BadInput(f"drawing: line {number} has {lengths}; make them equal")
        for character in line:
            if not (character in (WALL, FLOOR) or (character.isascii() and character.isalnum() and character != "0")):
                raise BadInput(f"drawing: line {number}: {printable(character)}: expected #, ., 1 to 9 or a letter")
    return np.array([list(line) for line in lines])


def _robot_numbers(grid: Drawn) -> list[int]:
    """Return the numbers of the robots in a drawing."""
    numbers = sorted(int(character) for character in grid.flat if character.isdigit())
    if numbers != list(range(1, len(numbers) + 1)) or not numbers:
        raise BadInput(f"drawing: has the robots {numbers}; draw 1, and others as 2, 3, ..., each once")
    return numbers


def _middle_of(grid: Drawn, name: str, side: float) -> tuple[float, float]:
    row, col = np.argwhere(grid == name)[0].tolist()
    return (col + 0.5) * side, (len(grid) - row - 0.5) * side


def _point_characters(grid: Drawn) -> Drawn:
    """Return the character of each point, row 0 at the lowest y."""
    return grid[::-1].repeat(POINTS, axis=0).repeat(POINTS, axis=1)


def _make_scenario(
    policy: type[Any] | str | None,
    options: Mapping[str, Any] | None,
    poses: Mapping[int, Pose],
    side: float,
    settings: Mapping[str, Any] | None,
) -> Scenario:
    from patrol.scenario import load_scenario

    if not (math.isfinite(side) and side > 0.0):
        raise BadInput(f"side = {side}: expected the side of a character in m, above 0")
    for field in settings or {}:
        for fixed_field, instead in GIVEN_OTHERWISE.items():
            if f"{fixed_field}.".startswith(f"{field}.") or f"{field}.".startswith(f"{fixed_field}."):
                raise BadInput(f"settings: {field}: a situation has this from elsewhere; {instead}")
    starts = [[pose.x, pose.y, pose.heading] for pose in poses.values()]
    mapping = {
        "terrain": {"builtin": "open"},  # the drawing is handed to `prepare`
        "point": side / POINTS,
        "robots": {"count": len(poses), "model": "holonomic", "radius": BODY * side, "starts": starts},
    }
    if policy is not None:
        is_built_in = isinstance(policy, str) and policy in POLICIES.built_in
        mapping["patrol"] = {"policy": policy if is_built_in else put_up(class_of(policy, POLICIES))}
    chosen = {f"patrol.options.{name}": value for name, value in (options or {}).items()}
    return load_scenario(mapping, {**chosen, **(settings or {})}, called="situation")


def _age_ticks(age_s: float, what: str, name: str, grid: Drawn, scenario: Scenario) -> int:
    """Return an age in ticks."""
    if not isinstance(name, str) or name == WALL or not (grid == name).any():
        raise BadInput(f"{what}: {name}: is on no floor of the drawing; name a character that is")
    if isinstance(age_s, bool) or not isinstance(age_s, int | float) or not 0.0 <= age_s <= MOST_AGE_S:
        raise BadInput(f"{what}: {name} = {quoted(age_s)}: expected s from 0 to {MOST_AGE_S:g}")
    return round(age_s / scenario.step)


def _let_age(fog: BelievedFog, grid: Drawn, ticks_ago: Mapping[str, int], now: int) -> None:
    """Have every point of a drawing seen as long ago as asked for."""
    from patrol.ground.footprint import View as SensorView

    points = _point_characters(grid)
    seen_at = np.full(points.shape, now, dtype=np.int64)
    for name, ago in ticks_ago.items():
        seen_at[points == name] = now - ago
    for tick in np.unique(seen_at).tolist():
        mask = np.ascontiguousarray(seen_at == tick).astype(np.uint8)
        quality = None if fog.looked is fog.fog.last_seen else np.ones(mask.shape)
        fog.take([(tick, SensorView(0, 0, mask, quality))], now)
