"""The cases whose figures are pinned: small runs that together use most features, and what is asked of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

RUN = "--in-process --no-picture --no-recording"
MATRIX = "--conditions none,loss-50 --teams 2,4 --seeds 2 --duration 60 --point 2"
SMALL = "--radius 0.25 --speed 1 --sensor-range 3 --point 0.25"


@dataclass(frozen=True)
class Case:
    """Files by name, and the commands that are run beside them."""

    files: Mapping[str, Any]
    commands: tuple[str, ...]


def box(x0: float, y0: float, x1: float, y1: float) -> list[list[float]]:
    """Return the corners of a rectangle."""
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


OFFICE = "maps/office.yaml"
MAP = {"map": OFFICE}

MIXED: dict[str, Any] = {
    "terrain": MAP,
    "point": 0.25,
    "step": 0.5,
    "duration": 130,
    "seed": 3,
    "robots": [
        {
            "name": "anna",
            "model": "differential",
            "radius": 0.25,
            "speed": 1.0,
            "battery": {"capacity": 1.3, "idle": 10, "drive": 20, "charge": 150},
        },
        {
            "name": "bert",
            "model": "holonomic",
            "radius": 0.25,
            "speed": 1.2,
            "battery": {"capacity": 0.9, "idle": 8, "drive": 15, "charge": 120},
        },
        {"name": "carl", "model": "car", "radius": 0.25, "speed": 0.9, "turning_radius": 0.5},
        {"name": "dora", "model": "holonomic", "radius": 0.2, "speed": 1.0},
        {"name": "emil", "model": "holonomic", "radius": 0.2, "speed": 1.1, "spare": True},
    ],
    "docks": [{"place": [1, 7]}, {"place": [23, 7]}],
    "sensor": {"range": 5, "angle": 240, "quality": [[2.5, 1.0], [5, 0.5]]},
    "zones": [
        {"name": "safe", "polygon": box(16.2, 8.2, 23.8, 13.8), "weight": 3, "weights": [[60, 5]]},
        {"name": "archive", "polygon": box(0.2, 0.2, 5.8, 5.8), "weight": 2, "times": [[40, 100]]},
        {"name": "workshop", "polygon": box(8.2, 8.2, 15.8, 13.8), "speed": 0.4},
        {"name": "desk", "polygon": box(12.2, 0.2, 14, 1.8), "keep_out": True},
    ],
    "closures": [
        {"name": "meeting", "polygon": box(19.5, 7.9, 20.6, 8.1), "closed": [[30, 60], [90, 200]]},
        {"name": "kitchen", "polygon": box(11.9, 2, 12.1, 3.1), "closes": 0.02, "opens": 0.05},
        {"name": "crate", "polygon": box(8, 6.2, 9, 7)},
    ],
    "intruders": [{"place": [20, 11], "at": 20, "for": 30}, {"place": [3, 3], "at": 70}],
    "faults": [
        {"kind": "loss", "at": 5, "for": 40, "rate": 0.4, "mean_burst": 4},
        {"kind": "delay", "at": 20, "for": 40, "delay": {"exponential": 0.6}},
        {"kind": "partition", "at": 50, "for": 10, "groups": "halves"},
        {"kind": "kill", "at": 60, "who": "bert"},
        {"kind": "restart", "at": 80, "who": "bert"},
        {"kind": "restart", "at": 105, "who": "carl"},
        {"kind": "restart", "at": 120, "who": "carl"},
        {"kind": "pause", "at": 30, "for": 10, "who": "carl"},
        {"kind": "join", "at": 70, "who": "emil"},
        {"kind": "leave", "at": 100, "who": "dora"},
        {"kind": "join", "at": 115, "who": "dora"},
        {"kind": "silence", "at": 65, "for": 10, "who": "half", "direction": "out"},
        {"kind": "spoof", "at": 55, "for": 10, "by": "stranger", "as": "dora", "payload": {"offset": [1, 0]}},
        {"kind": "drift", "at": 10, "for": 50, "who": "anna", "growth": [0.002, 0.001]},
        {"kind": "clock", "at": 30, "for": 30, "who": "dora", "offset": 3},
        {"kind": "duplicate", "at": 60, "for": 20, "rate": 0.3},
        {"kind": "close", "closure": "crate", "at": 60, "for": 40},
    ],
}
"""Robots of all bodies in an office with zones, closures, docks and intruders, where much goes wrong."""

TOUR: dict[str, Any] = {
    "terrain": MAP,
    "point": 0.25,
    "step": 0.5,
    "duration": 240,
    "seed": 2,
    "robots": {"count": 3, "model": "holonomic", "radius": 0.25, "speed": 2.0},
    "sensor": {"range": 8},
    "patrol": {"policy": "committed"},
    "zones": [{"name": "lobby", "polygon": box(0.2, 6.2, 7.8, 7.8), "age": 20}],
    "radio": {
        "trail": 3,
        "trail_every": 2,
        "budget": {"bits_per_s": 700, "overhead": 8},
        "adaptive": {"error": 1, "silence": 4},
        "model": "path-loss",
        "options": {"exponent": 3.5, "wall": 9, "shadowing": 4, "redraw": 60},
    },
    "faults": [
        {"kind": "range", "at": 40, "for": 30, "reach": 9, "through_walls": False},
        {"kind": "bandwidth", "at": 80, "for": 30, "bytes_per_s": 20},
        {"kind": "reorder", "at": 120, "for": 30, "rate": 0.4, "hold": 1.5},
        {"kind": "motion", "at": 160, "for": 20, "who": "r1", "speed": 0.1},
    ],
}
"""A tour with a zone that is visited more often, on a slow and weak radio."""

GRAPH: dict[str, Any] = {
    "terrain": {
        **MAP,
        "graph": {
            "vertices": [[3, 3], [3, 7], [10, 7], [10, 11], [20, 11], [20, 7], [16, 3]],
            "edges": [[0, 1, 4], [1, 2, 7], [2, 3, 4], [2, 5, 10], [4, 5, 4], [5, 6, 6]],
        },
    },
    "point": 0.25,
    "step": 0.5,
    "duration": 120,
    "seed": 5,
    "robots": {"count": 3, "model": "holonomic", "radius": 0.25, "speed": 2.0},
    "patrol": {"policy": "sebs"},
    "faults": [{"kind": "kill", "at": 90, "who": "r2", "wreck": "removed"}],
}
"""A patrol of the literature on seven vertices, of which a robot is killed."""

FORCES: dict[str, Any] = {
    **GRAPH,
    "patrol": {"policy": "potential-field", "options": {"paths": "regions"}},
    "robots": {"count": 3, "model": "car", "radius": 0.25, "speed": 1.5, "turning_radius": 0.5},
    "faults": [],
}
"""The same with the paper's policy, on regions."""

YARDS: dict[str, Any] = {
    "terrain": {"builtin": "yards"},
    "point": 1.0,
    "duration": 510,
    "seed": 4,
    "robots": {"count": 4, "model": "differential", "speed": 3.0, "radius": 0.5, "spare": 1},
    "patrol": {"options": {"separation": ["claims", "artificial-obstacles"]}},
    "zones": [{"name": "lane", "polygon": box(40, 40, 60, 44), "speed": 1.5}],
    "faults": [
        {"kind": "kill", "at": 60, "who": "r2"},
        {"kind": "restart", "at": 100, "who": "r2"},
        {"kind": "loss", "at": 60, "for": 60, "rate": 0.7},
    ],
}
"""A fleet that loses a robot for a while, on the default patrol; it is judged how it recovers."""

SWEEP: dict[str, Any] = {
    "base": {**FORCES, "duration": 60, "robots": {"count": 2, "model": "holonomic", "radius": 0.25}},
    "grid": {
        "patrol.policy": [{"label": "default", "value": "stochastic"}, {"label": "tour", "value": "committed"}],
        "robots.speed": [1.0, 1.5, 2.0],
    },
    "seeds": [4, 7, 8],
    "against": {"patrol.policy": "default"},
}
SWEEP["base"].pop("patrol")

QUICK: Mapping[str, Case] = {
    "ground": Case(
        {"office.yaml": MIXED},
        (
            f"map check {OFFICE} --radius 0.25 --point 0.25 --zones office.yaml --closures office.yaml --robots 3",
            "map check maps/office.yaml --radius 0.45 --point 0.25 --range 4 --start 10,7",
            "map regions maps/office.yaml --point 0.25 --radius 0.25",
            f"plan maps/office.yaml --robots 3 --model differential {SMALL} --quick --out plan",
            "scenario check office.yaml",
        ),
    ),
    "graph": Case(
        {"graph.yaml": GRAPH, "forces.yaml": FORCES},
        (
            f"run graph.yaml --out sebs {RUN} --no-report",
            f"run forces.yaml --out forces {RUN} --no-report",
            "export sebs --format csv",
            "compare sebs forces",
            "intruder sebs --attacks 25",
        ),
    ),
    "mixed": Case(
        {"office.yaml": MIXED},
        (f"run office.yaml --out run {RUN}", "judge run", "export run --format csv", "intruder run --attacks 25,50"),
    ),
}
"""What the quick suite runs, by name."""

REST: Mapping[str, Case] = {
    "tour": Case(
        {"tour.yaml": TOUR},
        (f"run tour.yaml --out run {RUN}", "judge run", "export run --format csv", "intruder run --attacks 10,25"),
    ),
    "recovery": Case(
        {"yards.yaml": YARDS},
        (
            f"run yards.yaml --out run {RUN} --recovery",
            "judge run",
            "intruder run --attacks 50 --within 100 --entries doors --attempts 40 --depth 15",
        ),
    ),
    "sweep": Case({"sweep.yaml": SWEEP}, ("sweep sweep.yaml --out sweep --workers 1",)),
    "benchmark": Case(
        {}, (f"benchmark --policies stochastic,committed,cr --terrains open {MATRIX} --out benchmark --workers 1",)
    ),
    "plan": Case(
        {
            "zones.yaml": {
                **TOUR,
                "robots": {"count": 2, "model": "holonomic", "radius": 0.25},
                "radio": {},
                "faults": [],
            }
        },
        (
            f"plan maps/office.yaml --age 120 --model differential {SMALL} --seeds 2 --duration 120 --out plan",
            "plan zones.yaml --robots 2-4 --patrol tour --seeds 1 --duration 120 --out zones",
        ),
    ),
}
"""What the rest of the suite runs, by name."""

CASES: Mapping[str, Case] = {**QUICK, **REST}
