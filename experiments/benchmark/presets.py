"""Conditions of published numbers: `m2bench`, `m2bench-jitter` and `magec`, on the graph of cumberland with six robots.

The numbers are those that the authors' repositories keep: result files of M2Bench (SpikeW726/M2Bench at 83a8238; Wang
et al., arXiv 2605.09633), and curves in a notebook (src/patrol_algorithms_magec/data-analysis.ipynb in
NU-IDEAS-Lab/patrolling_sim at 308bc28; MAGEC, arXiv 2403.13093; AHPA, arXiv 2304.01386), read off. The map and the
graph are files of patrolling_sim.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from experiments.benchmark.matrix import Matrix, NamedSettings, terrain_choice
from experiments.benchmark.results import CellResult, ShownMetric
from monitor.tables.table import Table
from patrol.errors import BadInput
from patrol.graph import VISIT_M, read_graph
from patrol.scenario.sections import VERTICES

VERTEX_COUNT = 40
"""Vertices of the graph of cumberland."""

SOURCE = "maps/cumberland of the public repository github.com/davidbsp/patrolling_sim"


@dataclass(frozen=True, slots=True)
class Published:
    """Published numbers of a patrol."""

    system: str  # what its authors call it
    policy: str | None  # ours of that name; None for none
    condition: str  # its name
    values: tuple[str, ...]  # in the order of the preset's measures; "-" where there is none


@dataclass(frozen=True, slots=True)
class Preset:
    """The conditions of published numbers, and the numbers."""

    title: str  # whose numbers they are
    duration_s: float  # simulated
    conditions: tuple[str, ...]  # their names
    body: Mapping[str, object]  # settings of the robots, by dotted field
    visit_m: float  # distance within which a robot visits a vertex
    point_m: float  # side of one grid point unless given
    sees_visits: bool  # True if only vertices are patrolled, and a robot sees one only where it visits it
    starts: tuple[int, ...]  # vertices on which the robots start
    measures: tuple[ShownMetric, ...]  # what is compared
    published: tuple[Published, ...]
    differs: tuple[str, ...]  # in what our runs differ from theirs, a line each

    @property
    def team(self) -> int:
        """Number of robots."""
        return 6


def _m2bench_row(system: str, policy: str | None, *values: str) -> Published:
    return Published(system, policy, "none", values)


SEES_FROM_AFAR = (
    "`committed` and `potential-field` see a vertex from afar and need not visit it, so their visits say little here; "
    "compare them by MFoW."
)

M2BENCH_DIFFERS = """\
Idleness of vertices: WI is the worst of the whole run, AGI the mean over vertices and time, IGI the mean at the end, \
IWI the worst at the end.
Theirs are points that move along edges, whose lengths are those of the graph's file, and visit a vertex when they are \
on it. Ours are bodies of 0.1 m on the map that drive round obstacles and each other, and visit a vertex within 0.4 m.
Nothing but the vertices is patrolled in our runs (`terrain.patrolled: vertices`), and the sensor's range is the \
distance of a visit less the diagonal of a grid point (`sensor.range`), so that a robot which sees a vertex visits it.
Ours know of each other what positions say; theirs share all state.
Ours start on vertices 0, 8, 16, 24, 32 and 39, as their learned policy does; for their other results no starts are \
recorded.
An asterisk marks a variant that is not the original, by the word of their own repository.
""".splitlines()

JITTER_DIFFERS = """\
WI is the worst idleness of a vertex: of the whole run with ours, after the first 50 s with theirs.
Theirs draw the time of each leg between two vertices, at most P % more or less than by its length, and the policy is \
told it beforehand. Ours draw the speed every 5 s, about the length of a leg, and robots see only how far they got.
""".splitlines()

MAGEC_DIFFERS = """\
Mean idleness over vertices: its plateau (ours: the mean of the second half), and at the end.
Theirs are read off plots of three runs each, in Flatland with Nav2's planner DWB; ours are bodies of 0.2 m in \
fogwatch's world.
Ours start on the vertices at or next to the places of their configuration. As there, the first robot dies at 300 s, \
the second at 1100 s, and their bodies are carried off.
With losses, MAGEC's robots observe vertices within 40 m only; our policies know no such radius.
Theirs are told of a death, unless the message is lost; ours notice that a robot is silent (`radio.forget_after`).
""".splitlines()

_M2BENCH = Preset(
    title="M2Bench's stored results",
    duration_s=500.0,
    conditions=("none",),
    body={"robots.model": "holonomic", "robots.speed": 1.0, "robots.radius": 0.1},
    visit_m=VISIT_M,
    point_m=0.1,
    sees_visits=True,
    starts=(0, 8, 16, 24, 32, 39),
    measures=(
        ShownMetric("nodes_worst_s", "WI (s)"),
        ShownMetric("nodes_idleness_mean_s", "AGI (s)", 1),
        ShownMetric("nodes_idleness_end_s", "IGI (s)", 1),
        ShownMetric("nodes_worst_end_s", "IWI (s)"),
    ),
    published=(
        _m2bench_row("TWLO (learned; after 50 s)", None, "95.85", "-", "-", "-"),
        _m2bench_row("AHPA*", "ahpa", "131.4", "27.3", "25.6", "81.4"),
        _m2bench_row("BAPS", None, "135.7", "27.1", "26.1", "117.5"),
        _m2bench_row("DTASSI*", "dtap", "192.8", "40.7", "44.4", "127.8"),
        _m2bench_row("SEBS", "sebs", "199.4", "43.7", "49.7", "130.7"),
        _m2bench_row("GBS", "gbs", "207.0", "46.2", "57.3", "176.7"),
        _m2bench_row("CC", None, "209.3", "43.4", "51.5", "167.5"),
        _m2bench_row("CR", "cr", "231.0", "53.9", "86.2", "219.2"),
        _m2bench_row("CBLS*", "cbls", "233.5", "49.8", "73.6", "208.2"),
        _m2bench_row("DTAG", "dtag", "266.6", "64.5", "100.4", "266.6"),
        _m2bench_row("HCR", "hcr", "298.8", "49.6", "52.6", "243.9"),
        _m2bench_row("ER", "er", "335.6", "68.1", "91.8", "272.3"),
        _m2bench_row("HPCC", "hpcc", "371.6", "99.5", "155.3", "358.2"),
        _m2bench_row("random", "random", "475.0", "74.7", "103.1", "457.8"),
    ),
    differs=tuple(M2BENCH_DIFFERS),
)

_TWLO_UNDER_JITTER = {
    "none": "95.9",
    "jitter-5": "98.9",
    "jitter-10": "100.2",
    "jitter-15": "103.9",
    "jitter-20": "108.6",
    "jitter-25": "111.5",
}
"""Means of 100 episodes in their evaluators/jitter/masup_cumberland.csv, s."""

PRESETS: Mapping[str, Preset] = {
    "m2bench": _M2BENCH,
    "m2bench-jitter": replace(
        _M2BENCH,
        title="M2Bench's sweep of travel times",
        conditions=tuple(_TWLO_UNDER_JITTER),
        measures=_M2BENCH.measures[:1],
        published=tuple(
            Published("TWLO (learned; after 50 s)", None, condition, (worst,))
            for condition, worst in _TWLO_UNDER_JITTER.items()
        ),
        differs=(*JITTER_DIFFERS, *M2BENCH_DIFFERS[1:6]),
    ),
    "magec": Preset(
        title="MAGEC's notebook",
        duration_s=1800.0,
        conditions=("none", "loss-50", "loss-90+deaths"),
        body={"robots.model": "differential", "robots.speed": 0.52, "robots.radius": 0.2},
        visit_m=0.25,
        point_m=0.25,
        sees_visits=False,
        starts=(24, 34, 30, 0, 9, 13),
        measures=(ShownMetric("nodes_idleness_late_s", "plateau (s)"), ShownMetric("nodes_idleness_end_s", "end (s)")),
        published=(
            *(
                Published(system, policy, condition, (values, "-"))
                for condition, plateaus in (
                    ("none", ("75-80", "65-75", "125-150", "70-80")),
                    ("loss-50", ("75-80", "75-85", "120-175", "70-85")),
                )
                for (system, policy), values in zip(
                    (("AHPA", "ahpa"), ("SEBS", "sebs"), ("CBLS", "cbls"), ("MAGEC (learned)", None)),
                    plateaus,
                    strict=True,
                )
            ),
            Published("AHPA", "ahpa", "loss-90+deaths", ("-", "610, growing")),
            Published("SEBS", "sebs", "loss-90+deaths", ("-", "165")),
            Published("CBLS", "cbls", "loss-90+deaths", ("-", "235")),
            Published("MAGEC (learned)", None, "loss-90+deaths", ("-", "115")),
        ),
        differs=(*MAGEC_DIFFERS, SEES_FROM_AFAR),
    ),
}


def preset_matrix(
    name: str,
    policies: tuple[NamedSettings, ...],
    seeds: tuple[int, ...],
    map_file: Path | None,
    graph_file: Path | None,
    settings: Mapping[str, object],
) -> Matrix:
    """Return the runs of a preset, on the map and graph of cumberland.

    A file that is None is refused with BadInput, as one is that is not of cumberland. `settings`, by dotted field,
    replace those of the preset.
    """
    preset = PRESETS[name]
    if map_file is None or graph_file is None:
        raise BadInput(
            f"--preset {name}: needs --map cumberland.yaml and --graph cumberland.graph; get both, and cumberland.pgm, "
            f"from {SOURCE}"
        )
    for option, file in (("--map", map_file), ("--graph", graph_file)):
        if not file.is_file():
            raise BadInput(f"{option} {file}: no such file; get it from {SOURCE}")
    places = read_graph(graph_file)["vertices"]
    if len(places) != VERTEX_COUNT:
        has = f"has {len(places)} vertices, cumberland {VERTEX_COUNT}"
        raise BadInput(f"--graph {graph_file}: {has}; get it from {SOURCE}")
    graph: object = str(graph_file)
    if preset.visit_m != VISIT_M:
        graph = {"file": graph, "visit": preset.visit_m}
    starts = [list(places[vertex]) for vertex in preset.starts]
    shared = {
        "point": preset.point_m,
        **preset.body,
        "robots.starts": starts,
        **_sight_settings(preset, settings),
        **settings,
    }
    terrain = terrain_choice("cumberland", str(map_file), graph)
    return Matrix(policies, (terrain,), (preset.team,), preset.conditions, seeds, preset.duration_s, shared)


def _sight_settings(preset: Preset, settings: Mapping[str, object]) -> dict[str, object]:
    """Return the settings with which seeing a vertex is visiting it, if the preset has them.

    Sight is between the centres of points, and robot and vertex may each be half a point's diagonal off theirs.
    """
    if not preset.sees_visits:
        return {}
    point_m = settings.get("point", preset.point_m)
    if not isinstance(point_m, float) or not 0.0 < point_m <= preset.point_m:
        raise BadInput(f"--point {point_m}: visits within {preset.visit_m:g} m need at most {preset.point_m:g}")
    return {"terrain.patrolled": VERTICES, "sensor.range": round(preset.visit_m - math.sqrt(2.0) * point_m, 6)}


def beside_published(preset: Preset, cells: Sequence[CellResult]) -> Table:
    """Return the table of published numbers beside ours: first the rows that have published ones."""
    heads = ["theirs", "condition", "ours"]
    heads += [f"{measure.title} {whose}" for measure in preset.measures for whose in ("theirs", "ours")]
    by_place = {(result.cell.policy.name, result.cell.condition): result for result in cells}
    rows = []
    for printed in preset.published:
        result = by_place.pop((printed.policy or "", printed.condition), None)
        rows.append(
            [
                printed.system,
                printed.condition,
                "-" if printed.policy is None else printed.policy,
                *_paired_texts(preset, result, printed.values),
            ]
        )
    nothing = ("-",) * len(preset.measures)
    rows += [
        ["-", condition, name, *_paired_texts(preset, result, nothing)]
        for (name, condition), result in by_place.items()
    ]
    return Table(heads, rows, range(3, len(heads)))


def _paired_texts(preset: Preset, result: CellResult | None, values: Sequence[str]) -> list[str]:
    """Return published numbers and ours, in turns."""
    row = []
    for measure, value in zip(preset.measures, values, strict=True):
        row += [value, measure.text(None if result is None else result.row)]
    return row
