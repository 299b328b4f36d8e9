"""Random scenarios for a hunt: short fleets, in each of which half of all features and kinds of faults may occur.

Theory of operation
    Leaving out half of everything finds more than drawing everything each time, because features hide each other's
    faults: a fleet whose radio is jammed all the time never tells what it does with late frames (Groce et al., "Swarm
    Testing", ISSTA 2012). The seeds 2n and 2n + 1 take complementary halves, and policies come in turn, so that few
    seeds meet everything once. A scenario is made in two steps: first what the ground depends on, then what needs to
    know the ground, such as doors, docks and zones. Sections that the caller sets are left as the caller sets them.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agent.policies.found import POLICIES
from patrol.errors import NotPrepared
from patrol.faults.kinds import PROCESS_KINDS
from patrol.faults.nemesis import DRAWN
from patrol.ground.doors import Rooms
from patrol.maps.load import load_terrain
from patrol.pose import MODELS
from patrol.prepare import Prepared, prepare
from patrol.random import Draws, Purpose
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.policies import BUILT_IN, DEFAULT, LEARNED, PAPER, STOCHASTIC
from patrol.starts import starting_part

_FEATURES = (
    "adaptive, batteries, budget, building, closures, graph, intruders, key, mixed bodies, narrow view, path loss, "
    "quality, spares, trail, view through walls, zones"
)
FEATURES = _FEATURES.split(", ")
"""Features of which a seed takes half."""

FAULT_KINDS = (*DRAWN, "close", "open")
"""Kinds of faults of which a seed takes half; a nemesis does not draw the last two, because they need a closure."""

EXCLUDED = {"age": {"quality", "narrow view", "mixed bodies"}}
"""Features that a zone with such a rule leaves out: a wanted age is compared with a tour, which these have not.

Nor have vertices, so a graph then has the ground patrolled.
"""

DEFAULT_SHARE = 0.25
"""Share of the scenarios with the default policy; the others take all in turn."""

QUIET = 0.25
"""Share of a run without faults at its end."""

MOST_TRIES = 40
"""Draws of a scenario until the ground has room for it."""

KEY = b"a hunt has no secrets"
"""The key of fleets that have one."""

BUILDINGS = Path(__file__).with_name("buildings")
"""Maps of buildings that were drawn at random, for two sides of a point and two bodies each."""

DrawBuilding = Callable[[Draws, float, float], Path]
"""Returns a map that a body patrols: `draw_stored(dice, radius, point)`, with the point's side in m."""


def draw_stored(dice: Draws, radius: float, point: float) -> Path:
    """Draw one of the stored buildings, whose openings are about as wide as a body of 0.3 or 0.4 m."""
    body = 0.3 if radius <= 0.3 else 0.4
    return dice.choice(*sorted(BUILDINGS.glob(f"point{point}-radius{body}-*.yaml")))


def random_fleet(
    seed: int, folder: Path, settings: Mapping[str, Any] | None = None, draw_building: DrawBuilding = draw_stored
) -> Prepared:
    """Draw a short scenario with faults, on ground that has room for it.

        random_fleet(7, folder, {"patrol.policy": "./mine.py:Mine", "terrain": {"map": "office.yaml"}})

    Args:
        seed: Decides everything.
        folder: An existing folder, for what the scenario names: a key, a network.
        settings: Fields of the scenario that are not drawn, by dotted name. A section of which one is given is not
            drawn at all, but for `robots`.
        draw_building: Draws the maps of scenarios in buildings.

    Raises:
        BadInput: The settings are wrong, or leave no room.
    """
    problem = NotPrepared("")
    for attempt in range(MOST_TRIES):
        try:
            return prepare(_Drawing(seed, attempt, folder, settings or {}, draw_building).scenario())
        except NotPrepared as refused:
            problem = refused
    raise problem


class _Drawing:
    """One scenario in the making."""

    def __init__(
        self, seed: int, attempt: int, folder: Path, settings: Mapping[str, Any], draw_building: DrawBuilding
    ) -> None:
        self._seed = seed
        self._dice = Draws(seed, Purpose.CHAOS, attempt)
        self._folder = folder
        self._settings = settings
        self._draw_building = draw_building
        self._given = {field.partition(".")[0] for field in settings} - {"robots"}
        features = set(_half_of(FEATURES, seed, 1))
        self._rule = Draws(seed, Purpose.CHAOS, -1).choice("age", "", "", "", "") if "zones" in features else ""
        self._features = features - EXCLUDED.get(self._rule, set())
        self._kinds = _half_of(FAULT_KINDS, seed, 2)

    def scenario(self) -> Scenario:
        """Return the scenario, with its faults written out."""
        dice = self._dice
        step, ticks = dice.choice(0.5, 0.5, 0.25, 1.0), dice.whole(60, 140)
        ground = {
            "name": f"chaos-{self._seed}",
            "seed": self._seed,
            "step": step,
            "duration": ticks * step,
            **self._draw_ground(),
        }
        ground |= {"sensor": self._draw_sensor(), "patrol": self._draw_patrol()}
        mapping = self._not_given(ground)
        base = load_scenario({"terrain": {"builtin": "open"}, **mapping}, self._settings)
        self._terrain = terrain = load_terrain(base.terrain, base.point, base.base)
        part = starting_part(terrain, max(spec.radius for spec in base.roster))
        self._places = [terrain.centre(row, col) for row, col in np.argwhere(part).tolist()]
        self._doors = [(door.x, door.y, door.width) for door in Rooms(terrain, base.roster[0].radius, part).doors()]
        closures = self._draw_closures(base)
        if base.spares:
            mapping["robots"][-1]["start"] = self._draw_place()
        mapping |= self._not_given(
            {
                "radio": self._draw_radio(base),
                "docks": self._draw_docks(base, [robot["start"] for robot in mapping["robots"] if "start" in robot]),
                "zones": self._draw_zones(base),
                "closures": closures,
                "intruders": self._draw_intruders(base),
                "faults": [*self._draw_acts(base), *self._draw_closing(base, closures)],
                "nemesis": self._draw_nemesis(base),
            }
        )
        if "graph" in self._features and "terrain" not in self._given:
            mapping["terrain"] = {**mapping["terrain"], **self._draw_graph()}
        return load_scenario(mapping, self._settings)

    def _not_given(self, sections: Mapping[str, Any]) -> dict[str, Any]:
        return {name: section for name, section in sections.items() if name not in self._given}

    # --- first what the ground depends on ----------------------------------------------------------------------------

    def _draw_ground(self) -> dict[str, Any]:
        """Draw terrain, point and robots, which have to fit together."""
        dice = self._dice
        models = MODELS if "mixed bodies" in self._features else (dice.choice(*MODELS),)
        indoors = "building" in self._features or "terrain" in self._given
        radii = (dice.between(0.2, 0.4),) if indoors else (0.3, 1.0)
        bodies = [
            {
                "model": dice.choice(*models),
                "speed": dice.between(0.5, 1.5) if indoors else dice.between(1.0, 5.0),
                "radius": dice.choice(*radii),
                "turning_radius": dice.between(0.6, 1.2) if indoors else dice.between(1.0, 4.0),
                **({"battery": self._draw_battery()} if "batteries" in self._features else {}),
            }
            for _ in range(3 if "mixed bodies" in self._features else 1)
        ]
        robots = [dict(dice.choice(*bodies)) for _ in range(dice.whole(2, 6))]
        if "spares" in self._features:
            robots[-1]["spare"] = True
        if not indoors:
            builtin, point = dice.choice("open", "yards", "clutter", "site"), dice.choice(1.0, 2.0)
            return {"terrain": {"builtin": builtin}, "point": point, "robots": robots}
        point = dice.choice(0.25, 0.4)
        if "terrain" in self._given:
            return {"point": point, "robots": robots}
        building = self._draw_building(dice, radii[0], point)
        return {"terrain": {"map": str(building)}, "point": point, "robots": robots}

    def _draw_battery(self) -> dict[str, Any]:
        dice = self._dice
        capacity = dice.between(0.3, 3.0)
        return {"capacity": capacity, "idle": 10.0, "drive": 30.0, "charge": 200.0, "start": dice.between(0.5, 1.0)}

    def _draw_sensor(self) -> dict[str, Any]:
        dice = self._dice
        return {
            "range": dice.between(4.0, 8.0) if "building" in self._features else dice.between(10.0, 25.0),
            "angle": dice.choice(180, 90) if "narrow view" in self._features else 360,
            "line_of_sight": "view through walls" not in self._features,
            "quality": dice.choice(0.5, [[2, 1.0], [10, 0.3]]) if "quality" in self._features else 1.0,
        }

    def _draw_patrol(self) -> dict[str, Any]:
        dice = self._dice
        policies = [name for name in POLICIES.built_in if name != DEFAULT]
        turn, index = divmod(self._seed, len(policies))
        policy = Draws(turn, Purpose.CHAOS, 3).shuffled(policies)[index]
        if dice.share() < DEFAULT_SHARE:
            policy = DEFAULT
        return {
            "policy": policy,
            "options": self._draw_options(policy),
            "avoidance": dice.choice("none", "goal-refinement", "goal-refinement"),
            "give_way": dice.choice(True, True, False),
            "manoeuvres": dice.choice(True, True, False),
        }

    def _draw_options(self, policy: str) -> dict[str, Any]:
        dice = self._dice
        if policy == LEARNED:
            weights = self._folder / "network.npz"
            np.savez(weights, w0=np.eye(4, 9) - 0.1, b0=np.zeros(9), activation=np.array("tanh"))
            return {"weights": str(weights), "inputs": ["pose"]}
        if policy not in BUILT_IN:
            return {}
        mechanisms = ["claims", "artificial-obstacles", "semaphores"]
        options: dict[str, Any] = {}
        if policy == STOCHASTIC:
            options["unpredictability"] = dice.choice(0.0, 1.0)
        elif policy == PAPER:
            mechanisms.append("repulsion")
            direction = dice.choice("mode", "mode", "vector")
            paths = dice.choice("wave", "straight", "regions")
            options = {
                "random_move": dice.between(0.0, 0.3),
                "letter": dice.choice(False, False, ["one-direction", "far-goal"]),
                "fow": dice.choice("f1", "f2", "f3", "f4", "f5"),
                "distance": dice.choice("g1", "g2", "g3", "g4", "g5"),
                "paths": "wave" if "closures" in self._features else paths,
                "direction": direction,
                "sectors": dice.choice(8, 5, 16),
                "dilatation": dice.choice(0, 3, 5),
                "fuzzy": direction == "mode" and dice.choice(False, False, True),
            }
        separation = dice.choice("none", dice.choice(*mechanisms), dice.some(mechanisms, len(mechanisms)))
        return {**options, "separation": separation}

    # --- then what needs to know the ground --------------------------------------------------------------------------

    def _draw_place(self) -> tuple[float, float]:
        """Draw a place where the widest body gets to."""
        return self._dice.choice(*self._places)

    def _draw_box(self, half: float) -> list[list[float]]:
        """Draw a box around such a place at any angle, or around a door."""
        dice = self._dice
        (x, y), angle = self._draw_place(), dice.between(0.0, math.pi)
        if self._doors and dice.share() < 0.5:
            x, y, width = dice.choice(*self._doors)
            half, angle = 0.5 * width + self._terrain.point, 0.0
        across, up = half * math.cos(angle), half * math.sin(angle)
        return [[x + across, y + up], [x - up, y + across], [x - across, y - up], [x + up, y - across]]

    def _draw_span(self, base: Scenario) -> list[list[float]]:
        """Draw a stretch of time within the run."""
        begin, length = self._dice.whole(0, base.ticks - 10), self._dice.whole(4, 60)
        return [[begin * base.step, (begin + length) * base.step]]

    def _draw_radio(self, base: Scenario) -> dict[str, Any]:
        dice, step = self._dice, base.step
        forget_s = dice.between(10.0 * step, 40.0 * step)
        radio: dict[str, Any] = {"forget_after": forget_s}
        if "key" in self._features:
            file = self._folder / "fleet.key"
            file.write_bytes(KEY)
            radio["key"] = str(file)
        if "adaptive" in self._features:
            radio["adaptive"] = {"error": dice.between(0.0, 4.0), "silence": dice.between(step, forget_s)}
        if "budget" in self._features:
            needed = 700.0 * len(base.roster) / forget_s
            radio["budget"] = {"bits_per_s": dice.between(2.0, 8.0) * needed, "overhead": dice.choice(0, 8)}
        narrow = base.sensor.angle < 360.0
        if "trail" in self._features and not (narrow and ("adaptive" in self._features or "budget" in self._features)):
            radio |= {"trail": dice.whole(1, 4), "trail_every": 1 if narrow else dice.whole(1, 3)}
        if "path loss" in self._features:
            radio |= {"model": "path-loss", "options": {"exponent": dice.choice(2.5, 4.0), "redraw": 20.0 * step}}
        return radio

    def _draw_docks(self, base: Scenario, starts: Sequence[tuple[float, float]]) -> list[dict[str, Any]]:
        """Draw docks, some where a spare robot starts, so that it may have to wait for one that charges there."""
        if all(spec.battery is None for spec in base.roster):
            return []
        dice = self._dice
        return [{"place": dice.choice(self._draw_place(), *starts), "radius": 1.0} for _ in range(dice.whole(1, 2))]

    def _draw_closures(self, base: Scenario) -> list[dict[str, Any]]:
        if "closures" not in self._features or base.patrol.paths != "wave":
            return []
        dice = self._dice
        drawn = []
        for number in range(dice.whole(1, 3)):
            rates: dict[str, Any] = {"closes": dice.between(0.02, 0.2), "opens": dice.between(0.05, 0.3)}
            when = dice.choice({}, {"closed": self._draw_span(base)}, rates)
            drawn.append({"name": f"door-{number}", "polygon": self._draw_box(1.5 * base.roster[0].radius), **when})
        return drawn

    def _draw_closing(self, base: Scenario, closures: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Draw faults that close and open closures."""
        faults = []
        for closure in closures:
            for kind in ("close", "open"):
                if kind in self._kinds:
                    ((begin, end),) = self._draw_span(base)
                    faults.append({"kind": kind, "closure": closure["name"], "at": begin, "for": end - begin})
        return faults

    def _draw_zones(self, base: Scenario) -> list[dict[str, Any]]:
        if "zones" not in self._features:
            return []
        dice, step = self._dice, base.step
        largest = max(2.0 * spec.radius + spec.speed * step for spec in base.roster)
        rules: list[dict[str, Any]] = [
            {"keep_out": True},
            {"weight": dice.between(0.1, 10.0)},
            {"weight": 2.0, "weights": [[20.0 * step, 0.5], [40.0 * step, 5.0]]},
            {"speed": dice.between(0.2, 0.9) * max(spec.speed for spec in base.roster)},
        ]
        chosen = dice.shuffled(rules)[: dice.whole(1, 3)]
        if self._rule == "age":
            chosen[0] = {"age": dice.between(5.0, 60.0)}
        drawn = []
        for number, rule in enumerate(chosen):
            half = dice.between(0.5, 1.0) * largest if "keep_out" in rule else dice.between(1.0, 4.0) * largest
            is_timed = not rule.keys() & {"keep_out", "weights"}
            times: dict[str, Any] = {"times": self._draw_span(base)} if is_timed else {}
            polygon = self._draw_box(half)
            drawn.append({"name": f"zone-{number}", "polygon": polygon, **rule, **dice.choice({}, times)})
        return drawn

    def _draw_intruders(self, base: Scenario) -> list[dict[str, Any]]:
        if "intruders" not in self._features:
            return []
        spans = [self._draw_span(base)[0] for _ in range(self._dice.whole(1, 2))]
        return [{"place": self._draw_place(), "at": begin, "for": end - begin} for begin, end in spans]

    def _draw_graph(self) -> dict[str, Any]:
        """Draw a graph: some places, each joined with the nearest before it."""
        dice = self._dice
        places = [self._draw_place() for _ in range(dice.whole(4, 12))]
        edges = []
        for last in range(1, len(places)):
            lengths = [math.dist(places[last], earlier) for earlier in places[:last]]
            length, first = min(zip(lengths, range(last), strict=True))
            if length > 0.0:
                edges.append([first, last, length])
        graph = {"vertices": places, "edges": edges, "visit": 2.0 * self._terrain.point}
        patrolled = "ground" if self._rule == "age" else dice.choice("ground", "vertices")
        return {"graph": graph, "patrolled": patrolled}

    def _draw_acts(self, base: Scenario) -> list[dict[str, Any]]:
        """Draw when spare robots join, and acts on robots that, unlike a nemesis's, may come one on top of another."""
        dice, spares = self._dice, [spec.name for spec in base.roster if spec.spare]
        acts: list[dict[str, Any]] = [{"kind": "join", "who": name} for name in spares]
        if dice.share() < 0.3:
            kinds = [kind for kind in self._kinds if kind in PROCESS_KINDS]
            acts += [{"kind": dice.choice(*kinds), "who": dice.choice("one", "half")} for _ in kinds]
        return [{**act, "at": dice.between(0.0, 0.7 * base.duration)} for act in acts]

    def _draw_nemesis(self, base: Scenario) -> dict[str, Any] | None:
        kinds = [kind for kind in self._kinds if kind in DRAWN]
        interval_s = max((1.0 - QUIET) * base.duration / self._dice.whole(2, 14), base.step)
        return {"kinds": kinds, "quiet": QUIET * base.duration, "interval": interval_s}


def _half_of(names: Iterable[str], seed: int, salt: int) -> list[str]:
    """Return half of some names; the two seeds of a pair share them out."""
    shuffled = Draws(seed // 2, Purpose.CHAOS, salt).shuffled(list(names))
    return shuffled[seed % 2 :: 2]
