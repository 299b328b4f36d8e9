"""The cells of the benchmark: each policy on each terrain, in each team, under each condition. A sweep runs them.

Policies and terrains are given as texts::

    stochastic,even-tour,stochastic:unpredictability=2,./mine.py:Mine:near=4
    open,plan.yaml,cumberland.graph+cumberland.yaml
"""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from experiments.benchmark.conditions import check_condition, faults_of, least_team
from experiments.sweeps.plan import Base, Case, Plan, make_plan
from patrol.errors import BadInput, did_you_mean, quoted
from patrol.scenario import BUILTINS, MAX_ROBOTS
from patrol.scenario.step import PAPER_STEP

CALLED = "the benchmark"

OPTIONS_OF_RUN = {
    "robots.count": "--robots",
    "robots.model": "--model",
    "robots.radius": "--radius",
    "robots.speed": "--speed",
    "robots.turning_radius": "--turning-radius",
    "sensor.range": "--sensor-range",
    "duration": "--duration",
    "point": "--point",
}
"""Options of `fogwatch run` by the fields that they set; others are set with ``--set``."""


@dataclass(frozen=True, slots=True)
class NamedSettings:
    """A policy or a terrain."""

    name: str  # in tables
    settings: Mapping[str, object]  # of the scenario, by dotted field


@dataclass(frozen=True, slots=True)
class Matrix:
    """The choices that the benchmark varies, and the settings that all its runs share."""

    policies: tuple[NamedSettings, ...]
    terrains: tuple[NamedSettings, ...]
    teams: tuple[int, ...]  # numbers of robots
    conditions: tuple[str, ...]  # names (`experiments.benchmark.conditions`)
    seeds: tuple[int, ...]  # each cell is run with all of them
    duration_s: float  # simulated time of each run
    # what else each run sets in the scenario, by dotted field
    settings: Mapping[str, object] = field(default_factory=dict)

    @property
    def cells(self) -> list[BenchmarkCell]:
        """The cells, policy by policy on each terrain; without conditions that need more robots than a team has."""
        return [
            BenchmarkCell(policy, terrain, team, condition, self)
            for team in self.teams
            for condition in self.conditions
            if team >= least_team(condition)
            for terrain in self.terrains
            for policy in self.policies
        ]


@dataclass(frozen=True, slots=True)
class BenchmarkCell:
    """A policy on a terrain, in a team, under a condition."""

    policy: NamedSettings
    terrain: NamedSettings
    team: int  # number of robots
    condition: str  # its name
    matrix: Matrix  # what it is a cell of

    @property
    def name(self) -> str:
        """The name of its case in the sweep."""
        return f"{self.policy.name} on {self.terrain.name}, {robots_text(self.team)}, {self.condition}"

    @property
    def labels(self) -> dict[str, object]:
        """Its coordinates, by the names of their columns."""
        return {
            "policy": self.policy.name,
            "terrain": self.terrain.name,
            "team": self.team,
            "condition": self.condition,
        }

    @property
    def settings(self) -> dict[str, object]:
        """The settings of its scenario, by dotted field."""
        faults = faults_of(self.condition, self.matrix.duration_s)
        return {
            **self.terrain.settings,
            **self.matrix.settings,
            "duration": self.matrix.duration_s,
            "robots.count": self.team,
            **self.policy.settings,
            **({"faults": faults} if faults else {}),
        }

    def command(self, seed: int) -> str:
        """Return the command line that makes one of its runs again."""
        settings = self.settings
        words = ["fogwatch", "run", str(settings.pop("terrain.builtin", None) or settings.pop("terrain.map"))]
        for name, value in settings.items():
            text = value if isinstance(value, str) else json.dumps(value)
            option = OPTIONS_OF_RUN.get(name)
            words += [option, text] if option else ["--set", f"{name}={text}"]
        return shlex.join([*words, "--set", f"step={PAPER_STEP:g}", "--seed", str(seed), "--in-process"])


def robots_text(team: int) -> str:
    """Return a number of robots in words, such as "1 robot"."""
    return f"{team} robot{'s' if team > 1 else ''}"


def plan_of(matrix: Matrix) -> Plan:
    """Return the plan of all runs, with intruder games."""
    for condition in matrix.conditions:
        if max(matrix.teams) < (needed := least_team(condition)):
            teams = ",".join(map(str, matrix.teams))
            raise BadInput(
                f"--teams {teams}: {condition} needs {needed} robots or more; give a larger team or drop the condition"
            )
    cases = [Case(cell.name, cell.settings) for cell in matrix.cells]
    base = Base({"name": "benchmark", "step": PAPER_STEP}, Path.cwd(), CALLED)  # published figures have this step
    plan = make_plan("benchmark", base, cases, matrix.seeds)
    return replace(plan, runs=tuple(replace(run, games=True) for run in plan.runs))


def read_policies(text: str) -> tuple[NamedSettings, ...]:
    """Read policies, NAME or NAME:OPTION=VALUE:OPTION=VALUE, with commas between.

    Names and options that do not exist are found only when the plan is made.
    """
    policies = []
    for name in _read_list(text, "--policies", "stochastic,even-tour"):
        words = name.split(":")
        options = [word for word in words if "=" in word]
        policy = ":".join(word for word in words if "=" not in word)
        settings: dict[str, object] = {"patrol.policy": policy}
        if not policy or policy.endswith(":"):
            raise BadInput(f"--policies {name}: expected NAME or NAME:OPTION=VALUE, as in sebs:g2=50")
        for option in options:
            key, _, value = option.partition("=")
            if not key or not value:
                raise BadInput(f"--policies {name}: {option}: expected OPTION=VALUE, as in sebs:g2=50")
            settings[f"patrol.options.{key}"] = value
        policies.append(NamedSettings(name, settings))
    return tuple(policies)


def read_terrains(text: str) -> tuple[NamedSettings, ...]:
    """Read a list of terrains, with commas between.

    They are built-in ones and maps (MAP.yaml), and either with a graph (FILE.graph+MAP.yaml).
    """
    terrains = []
    for choice in _read_list(text, "--terrains", "open,yards,plan.yaml"):
        parts = choice.split("+")
        graphs = [part for part in parts if part.endswith(".graph")]
        grounds = [part for part in parts if part not in graphs]
        if len(graphs) > 1 or len(grounds) != 1:
            raise BadInput(f"--terrains {choice}: expected a terrain, or a graph and a terrain: FILE.graph+MAP.yaml")
        terrains.append(terrain_choice(choice, grounds[0], graphs[0] if graphs else None))
    stems = [_file_stem(terrain) for terrain in terrains]
    return tuple(
        replace(terrain, name=stem) if stems.count(stem) == 1 else terrain
        for terrain, stem in zip(terrains, stems, strict=True)
    )


def terrain_choice(name: str, ground: str, graph: object = None) -> NamedSettings:
    """Return a terrain: a built-in one or a map's YAML file, with a graph as in a scenario.

    `name` is its name in tables.
    """
    if ground in BUILTINS:
        settings: dict[str, object] = {"terrain.builtin": ground}
    elif ground.endswith((".yaml", ".yml")):
        settings = {"terrain.map": ground}
    else:
        hint = f"{did_you_mean(ground, BUILTINS)}, or give MAP.yaml or FILE.graph+MAP.yaml"
        raise BadInput(f"--terrains {ground}: no such built-in terrain, and no map's YAML file; {hint}")
    return NamedSettings(name, settings if graph is None else {**settings, "terrain.graph": graph})


def read_teams(text: str) -> tuple[int, ...]:
    """Read a list of numbers of robots."""
    words = _read_list(text, "--teams", "1,2,4,6,8,12")
    for word in words:
        if not (word.isascii() and word.isdecimal() and 1 <= int(word[:9]) <= MAX_ROBOTS):
            raise BadInput(f"--teams {text}: {word}: expected a number of robots from 1 to {MAX_ROBOTS}")
    return tuple(int(word) for word in words)


def read_conditions(text: str) -> tuple[str, ...]:
    """Read a list of conditions."""
    names = _read_list(text, "--conditions", "none,loss-50")
    for name in names:
        check_condition(name)
    return tuple(names)


def _read_list(text: str, option: str, example: str) -> Sequence[str]:
    words = [word.strip() for word in text.split(",")]
    for word, count in Counter(words).items():
        if not word or not word.isprintable():
            raise BadInput(f"{option} {quoted(text)}: expected names with commas between, such as {example}")
        if count > 1:
            raise BadInput(f"{option}: {word} occurs {count} times; name it once")
    return words


def _file_stem(terrain: NamedSettings) -> str:
    file = terrain.settings.get("terrain.map")
    return terrain.name if file is None else Path(str(file)).stem
