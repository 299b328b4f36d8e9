"""The cases of the benchmark: each policy on each terrain, in each team, under each condition. A sweep runs them.

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

from experiments.benchmark.conditions import check_condition, condition_of
from experiments.sweeps.cases import CaseRow
from experiments.sweeps.figures import POLICY
from experiments.sweeps.plan import Base, Case, Label, Plan, make_plan
from fogwatch.terminal.live_table import robots_text
from patrol.errors import BadInput, did_you_mean, quoted
from patrol.scenario import BUILTINS, MAX_ROBOTS
from patrol.scenario.step import PAPER_STEP


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
    seeds: tuple[int, ...]  # each case is run with all of them
    duration_s: float  # simulated time of each run
    # what else each run sets in the scenario, by dotted field
    settings: Mapping[str, object] = field(default_factory=dict)

    def plan(self) -> Plan:
        """Return the plan of all runs, with intruder games; conditions that need a larger team are left out."""
        cells: dict[tuple[int, str], None] = {}  # once each: robots-N is the same for teams of every size
        for team in self.teams:
            for name in self.conditions:
                condition = condition_of(name, self.duration_s)
                robots = condition.robots or team
                if robots >= condition.smallest_team:
                    cells[robots, name] = None
                elif robots >= (condition.robots or max(self.teams)):
                    teams, needed = ",".join(map(str, self.teams)), condition.smallest_team
                    remedy = "give a larger team or drop the condition"
                    raise BadInput(f"--teams {teams}: {name} needs {needed} robots or more; {remedy}")
        cases = [
            self._case(policy, terrain, team, condition)
            for team, condition in cells
            for terrain in self.terrains
            for policy in self.policies
        ]
        base = Base({"name": "benchmark", "step": PAPER_STEP}, Path.cwd(), "the benchmark")  # as published figures
        plan = make_plan("benchmark", base, cases, self.seeds)
        return replace(plan, runs=tuple(replace(run, games=True) for run in plan.runs))

    def _case(self, policy: NamedSettings, terrain: NamedSettings, team: int, condition: str) -> Case:
        settings = {
            **terrain.settings,
            **self.settings,
            "duration": self.duration_s,
            "robots.count": team,
            **policy.settings,
        }
        changed = condition_of(condition, self.duration_s).add_to(settings)
        labels = (
            Label(POLICY, "policy", policy.name, given=True),
            Label("terrain", "terrain", terrain.name, given=True),
            Label("robots.count", "team", str(team), given=False),
            Label("faults", "condition", condition, given=True),
        )
        return Case(f"{policy.name} on {terrain.name}, {robots_text(team)}, {condition}", changed, labels)


def places_of(case: Case | CaseRow) -> dict[str, str]:
    """Return a case's policy, terrain, team and condition, by these words."""
    return {label.title: label.text for label in case.labels}


def run_command(case: Case | CaseRow, seed: int) -> str:
    """Return the command line that makes a run of a case again."""
    settings = dict(case.settings)
    words = ["fogwatch", "run", str(settings.pop("terrain.builtin", None) or settings.pop("terrain.map"))]
    for name, value in {**settings, "step": PAPER_STEP}.items():
        words += ["--set", f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    return shlex.join([*words, "--seed", str(seed), "--in-process"])


def read_policies(text: str) -> tuple[NamedSettings, ...]:
    """Read policies, NAME or NAME:OPTION=VALUE:OPTION=VALUE, with commas between.

    Names and options that do not exist are found only when the plan is made.
    """
    policies = []
    for name in _read_list(text, "--policies", "stochastic,even-tour"):
        words = name.split(":")
        options = [word.partition("=") for word in words if "=" in word]
        policy = ":".join(word for word in words if "=" not in word)
        if not policy or policy.endswith(":") or not all(key and value for key, _, value in options):
            raise BadInput(f"--policies {name}: expected NAME or NAME:OPTION=VALUE, as in sebs:g2=50")
        settings = {f"patrol.options.{key}": value for key, _, value in options}
        policies.append(NamedSettings(name, {POLICY: policy, **settings}))
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
        ground = grounds[0]
        if ground not in BUILTINS and not ground.endswith((".yaml", ".yml")):
            hint = f"{did_you_mean(ground, BUILTINS)}, or give MAP.yaml or FILE.graph+MAP.yaml"
            raise BadInput(f"--terrains {ground}: no such built-in terrain, and no map's YAML file; {hint}")
        settings = {"terrain.builtin" if ground in BUILTINS else "terrain.map": ground}
        terrains.append(NamedSettings(choice, {**settings, **({"terrain.graph": graphs[0]} if graphs else {})}))
    stems = [Path(str(terrain.settings.get("terrain.map", terrain.name))).stem for terrain in terrains]
    return tuple(
        replace(terrain, name=stem) if stems.count(stem) == 1 and "terrain.map" in terrain.settings else terrain
        for terrain, stem in zip(terrains, stems, strict=True)
    )


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
