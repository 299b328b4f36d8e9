"""Benchmarks by name, as presets.yaml has them.

Most are the conditions of published numbers, on the graph of cumberland, with the numbers beside ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from pathlib import Path

from pydantic import TypeAdapter

from experiments.benchmark.matrix import Matrix, NamedSettings, places_of
from experiments.sweeps.cases import CaseRow
from experiments.sweeps.stats import with_interval
from monitor.tables.table import Table
from patrol.errors import BadInput, did_you_mean
from patrol.files.yaml_text import parse_yaml
from patrol.graph import read_graph

VERTEX_COUNT = 40
"""Vertices of the graph of cumberland."""

SOURCE = "maps/cumberland of the public repository github.com/davidbsp/patrolling_sim"


@dataclass(frozen=True, slots=True)
class Preset:
    """The conditions of published numbers, and the numbers; or conditions alone."""

    title: str  # whose numbers they are, or what is compared
    conditions: tuple[str, ...]  # their names
    settings: Mapping[str, object]  # of all runs, by dotted field, with team and duration
    measures: Mapping[str, str]  # what is compared: the titles of metrics
    policies: str | None = None  # unless others are asked for; None for all built-in ones
    terrains: str | None = None  # likewise
    # settings of terrains, by dotted field: of those "built-in" and of "maps"
    grounds: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    starts: tuple[int, ...] = ()  # vertices on which the robots start
    visit: float = 0.0  # distance within which a robot visits a vertex, m
    # what its authors call a patrol, ours of that name, the condition, and the values; "-" where there is none
    published: tuple[tuple[str | None, ...], ...] = ()
    differs: tuple[str, ...] = ()  # in what our runs differ from theirs

    def matrix(
        self,
        policies: tuple[NamedSettings, ...],
        terrains: tuple[NamedSettings, ...],
        seeds: tuple[int, ...],
        settings: Mapping[str, object],
        conditions: tuple[str, ...] | None = None,
    ) -> Matrix:
        """Return the preset's runs; `settings`, by dotted field, and `conditions` hold over its own."""
        shared = {**self.settings, **(self._on_graph(terrains) if self.published else {}), **settings}
        team, duration_s = int(str(shared.pop("robots.count"))), float(str(shared.pop("duration")))
        terrains = tuple(
            replace(terrain, settings={**terrain.settings, **self.ground_settings(terrain)}) for terrain in terrains
        )
        return Matrix(policies, terrains, (team,), conditions or self.conditions, seeds, duration_s, shared)

    def ground_settings(self, terrain: NamedSettings) -> Mapping[str, object]:
        """Return the settings that depend on the terrain, by dotted field."""
        return self.grounds.get("built-in" if "terrain.builtin" in terrain.settings else "maps", {})

    def _on_graph(self, terrains: tuple[NamedSettings, ...]) -> Mapping[str, object]:
        """Return the settings of runs on the graph of cumberland, which must be the only terrain."""
        graph = Path(str(terrains[0].settings.get("terrain.graph", "")))
        if len(terrains) > 1 or not graph.is_file():
            raise BadInput(f"--preset: needs --terrains cumberland.graph+cumberland.yaml; get the files from {SOURCE}")
        places = read_graph(graph)["vertices"]
        if len(places) != VERTEX_COUNT:
            has = f"has {len(places)} vertices, cumberland {VERTEX_COUNT}"
            raise BadInput(f"--terrains {graph}: {has}; get it from {SOURCE}")
        starts = [list(places[vertex]) for vertex in self.starts]
        return {"robots.starts": starts, "terrain.graph": {"file": str(graph), "visit": self.visit}}

    def beside_ours(self, rows: Sequence[CaseRow]) -> Table:
        """Return the table of published numbers beside ours: first the rows that have published ones."""
        ours = {(places_of(row)["policy"], places_of(row)["condition"]): row for row in rows}
        lines = [(line, ours.pop((str(line[1]), str(line[2])), None)) for line in self.published]
        nothing = ["-"] * len(self.measures)
        lines += [((None, policy, condition, *nothing), row) for (policy, condition), row in ours.items()]
        heads = ["theirs", "condition", "ours"]
        heads += [f"{title} {whose}" for title in self.measures.values() for whose in ("theirs", "ours")]
        cells = []
        for (system, policy, condition, *values), row in lines:
            metrics = {} if row is None else row.metrics
            means = [with_interval(metrics.get(metric), sign=" ± ") for metric in self.measures]
            pairs = [text for pair in zip(values, means, strict=True) for text in pair]
            cells.append([system or "-", condition, policy or "-", *pairs])
        return Table(heads, cells, range(3, len(heads)))


@cache
def presets() -> Mapping[str, Preset]:
    """Return the presets by name, read once."""
    text = files("experiments.benchmark").joinpath("presets.yaml").read_text(encoding="utf-8")
    return TypeAdapter(dict[str, Preset]).validate_python(parse_yaml(text, "presets.yaml"))


def preset_named(name: str) -> Preset:
    """Return a preset."""
    if name not in presets():
        raise BadInput(f"--preset {name}: no such preset; {did_you_mean(name, list(presets()))}")
    return presets()[name]
