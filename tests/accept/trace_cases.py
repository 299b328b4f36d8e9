"""The runs whose trace hashes a change must not move, and the tool that writes them down.

    python tests/accept/trace_cases.py FILE.json                        # run every case and write the hashes
    python tests/accept/trace_cases.py --check FILE.json                # run every case and name those that moved
    python tests/accept/trace_cases.py --check --only "site car" FILE.json    # those whose name contains a text

Each terrain is patrolled by the paper's policy with two bodies under every variant, at 1 m points, and by the tour
and by the default patrol with three bodies under a few, at 0.5 m points, for 200 simulated seconds. A hash holds on
x86-64 processors with AVX2 and FMA, with one Python, C library and lock file.
"""

import argparse
import hashlib
import json
import platform
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

TERRAINS = ("open", "yards", "clutter", "site")
BODIES = ("holonomic", "car")
LENGTHS: Mapping[str, float] = {
    "patrol.options.dilatation": 5,
    "patrol.options.obstacle_radius": 5,
    "patrol.options.critical_width": 8,
    "patrol.options.fuzzy_distance": 5.5,
    "patrol.goal_distance": 5.5,
    "patrol.refine_side": 2,
    "patrol.refine_reach": 10,
    "patrol.surround_distance": 8,
}
"""The paper's, whatever the body."""
BASE: Mapping[str, Any] = {
    "point": 1.0,
    "duration": 200,
    "robots.count": 4,
    "patrol.options.random_move": 0.1,
    "patrol.policy": "potential-field",
    "patrol.manoeuvres": False,
    "patrol.options.separation": "none",
    **LENGTHS,
}
SMALL: Mapping[str, Any] = {"robots.radius": 0.3, "robots.speed": 1, "robots.turning_radius": 1}
AUTO: Mapping[str, Any] = {**dict.fromkeys(LENGTHS, "auto"), "point": 0.5, **SMALL}
"""Lengths that follow a small body."""

FAULTS: tuple[Mapping[str, Any], ...] = (
    {"kind": "loss", "at": 5, "for": 40, "rate": 0.4, "mean_burst": 4},
    {"kind": "delay", "at": 20, "for": 40, "delay": {"exponential": 0.6}},
    {"kind": "partition", "at": 50, "for": 10, "groups": "halves"},
    {"kind": "kill", "at": 20, "who": "r2"},
    {"kind": "restart", "at": 45, "who": "r2"},
    {"kind": "pause", "at": 30, "for": 10, "who": "r3"},
    {"kind": "silence", "at": 65, "for": 10, "who": "half", "direction": "out"},
    {"kind": "spoof", "at": 55, "for": 10, "by": "stranger", "as": "r4", "payload": {"offset": [15, 0]}},
    {"kind": "drift", "at": 10, "for": 50, "who": "r1", "growth": [0.02, 0.01]},
    {"kind": "clock", "at": 30, "for": 30, "who": "r4", "offset": 3},
    {"kind": "duplicate", "at": 60, "for": 20, "rate": 0.3},
)

VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "default": {},
    "faults": {"faults": FAULTS},
    "straight": {"patrol.options.paths": "straight"},
    "straight-vector": {"patrol.options.paths": "straight", "patrol.options.direction": "vector"},
    "regions": {"patrol.options.paths": "regions"},
    "vector": {"patrol.options.direction": "vector"},
    "vector-claims": {"patrol.options.direction": "vector", "patrol.options.separation": "claims"},
    "fuzzy": {"patrol.avoidance": "none", "patrol.options.fuzzy": True},
    "no-avoidance": {"patrol.avoidance": "none"},
    "no-dilatation": {"patrol.options.dilatation": 0},
    "claims": {"patrol.options.separation": "claims"},
    "claims-faults": {"patrol.options.separation": "claims", "faults": FAULTS},
    "artificial-obstacles": {"patrol.options.separation": "artificial-obstacles"},
    "semaphores": {"patrol.options.separation": "semaphores"},
    "repulsion": {"patrol.options.separation": "repulsion"},
    "claims-obstacles": {"patrol.options.separation": ["claims", "artificial-obstacles"]},
    "every-separation": {"patrol.options.separation": ["claims", "artificial-obstacles", "semaphores", "repulsion"]},
    "no-give-way": {"patrol.give_way": False},
    "f1-g1": {"patrol.options.fow": "f1", "patrol.options.distance": "g1"},
    "f5-g5": {"patrol.options.fow": "f5", "patrol.options.distance": "g5"},
    "f4-g3-regions-claims": {
        "patrol.options.fow": "f4",
        "patrol.options.distance": "g3",
        "patrol.options.paths": "regions",
        "patrol.options.separation": "claims",
    },
    "sixteen-sectors": {"patrol.options.sectors": 16},
    "no-random-move": {"patrol.options.random_move": 0},
    "blind-angle": {"sensor.angle": 120, "sensor.range": 14},
    "through-walls": {"sensor.line_of_sight": False},
    "quality": {"sensor.quality": [[4, 1.0], [10, 0.5]]},
    "trail": {"radio.trail": 2, "faults": FAULTS[:2]},
    "silent-peers": {"radio.forget_after": 3, "faults": FAULTS[3:4]},
    "spare": {"robots.spare": 1, "faults": [{"kind": "join", "at": 20, "who": "r5"}]},
    "small": {"robots.radius": 0.4, "robots.speed": 1.5, "patrol.options.dilatation": 2},
    "auto": AUTO,
    "auto-claims-area": {**AUTO, "patrol.options.separation": "claims", "patrol.options.reach": "area"},
    "surround": {"intruders": "somewhere"},
    "surround-faults": {"intruders": "somewhere", "faults": FAULTS[:5]},
}

TARGETS: Mapping[str, Any] = {"point": 0.5, "duration": 200, "robots.count": 4, "patrol.policy": "committed"}
"""The tour, with nothing else set."""

CHARGING: Mapping[str, Any] = {
    "robots.battery": {"capacity": 1.0, "idle": 10, "drive": 20, "charge": 150},
    "docks": "here and there",
}
"""Small batteries, which last two minutes, and two docks at which to charge them in half a minute."""

TARGETS_BODIES = ("holonomic", "differential", "car")

TARGETS_VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "committed": {},
    "committed-alone": {"patrol.options.separation": "none"},
    "committed-separations": {"patrol.options.separation": ["claims", "artificial-obstacles", "semaphores"]},
    "committed-faults": {"faults": FAULTS},
    "committed-blind-angle": {"sensor.angle": 120, "sensor.range": 14},
    "committed-quality": {"sensor.quality": [[4, 1.0], [10, 0.5]]},
    "committed-small": SMALL,
    "stochastic": {"patrol.policy": "stochastic"},
    "stochastic-faults": {"patrol.policy": "stochastic", "faults": FAULTS},
    "stochastic-small": {"patrol.policy": "stochastic", **SMALL},
    "stochastic-charging": {"patrol.policy": "stochastic", **SMALL, **CHARGING},
}

CROWD: Mapping[str, Any] = {"point": 1.0, "duration": 80, "robots.count": 16}
BLOCKS = ((10, 30), (60, 40), (15, 60), (30, 10), (40, 50), (70, 20), (24, 24))
CLOSURES = tuple(
    {
        "name": f"block{number}",
        "polygon": [(x, y), (x + 4, y), (x + 4, y + 4), (x, y + 4)],
        "closes": 0.05,
        "opens": 0.02,
    }
    for number, (x, y) in enumerate(BLOCKS)
)
YARDS: Mapping[str, Mapping[str, Any]] = {
    "crowd-late": {**CROWD, "faults": [{"kind": "delay", "at": 5, "for": 70, "delay": {"exponential": 0.6}}]},
    "closures": {"point": 0.5, "duration": 80, "robots.count": 6, "closures": CLOSURES},
    "closures-paper": {
        "point": 0.5,
        "duration": 80,
        "robots.count": 6,
        "closures": CLOSURES,
        "patrol.policy": "potential-field",
    },
}
"""Robots that are heard late, and ground that closes and opens again."""

PLACES = {"open": [45, 40], "yards": [40, 22], "clutter": [50, 50], "site": [230, 127]}
"""Places of an intruder and of docks, m, on passable ground of each terrain."""


def cases() -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and overrides of every run."""
    for terrain in TERRAINS:
        for body in BODIES:
            for variant, settings in VARIANTS.items():
                chosen = {**BASE, "robots.model": body, **settings}
                if "intruders" in chosen:
                    chosen["intruders"] = [{"place": PLACES[terrain], "at": 10, "for": 60}]
                yield f"{terrain} {body} {variant}", {"terrain": terrain, **chosen}
        for body in TARGETS_BODIES:
            for variant, settings in TARGETS_VARIANTS.items():
                chosen = {**TARGETS, "robots.model": body, **settings}
                if "docks" in chosen:
                    if terrain == "site":  # the way to a dock takes longer than the run
                        continue
                    x, y = PLACES[terrain]
                    chosen["docks"] = [{"place": [x, y + above]} for above in (0, 4)]
                yield f"{terrain} {body} {variant}", {"terrain": terrain, **chosen}
    for body in TARGETS_BODIES:
        for variant, settings in YARDS.items():
            yield f"yards {body} {variant}", {"terrain": "yards", "robots.model": body, **settings}


def trace_of(case: tuple[str, dict[str, Any]]) -> tuple[str, str]:
    """Run one case in this process; its name and trace hash, or the error that it ended with."""
    from fogwatch.inprocess import run_in_process
    from patrol.scenario import open_scenario

    name, settings = case
    terrain = settings.pop("terrain")
    try:
        outcome = run_in_process(open_scenario(terrain, settings), verify_fog=False)
    except Exception as error:  # noqa: BLE001 - a case that cannot run is an entry of the list as well
        return name, f"{type(error).__name__}: {error}"[:200]
    assert outcome.journal.end is not None
    return name, outcome.journal.end.trace_hash + ("" if outcome.verdict.outcome == "valid" else " (not valid)")


def traces(only: str = "") -> dict[str, str]:
    """Run the cases whose name contains a text, on two processes; trace hashes by name."""
    with ProcessPoolExecutor(2) as pool:
        return dict(pool.map(trace_of, (case for case in cases() if only in case[0])))


def made_on() -> dict[str, str]:
    """Return all else that a trace hash depends on: Python, the C library and the locked libraries."""
    root = Path(__file__).parents[2]
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "libc": " ".join(platform.libc_ver()),
        "lock": hashlib.sha256((root / "requirements.lock").read_bytes()).hexdigest(),
    }


def main() -> int:
    """Write or check a file of hashes."""
    parser = argparse.ArgumentParser(description="Run patrols, and write down or check their trace hashes.")
    parser.add_argument("file", type=Path, metavar="FILE.json")
    parser.add_argument("--check", action="store_true", help="compare with the file, and name the cases that moved")
    parser.add_argument("--only", default="", metavar="TEXT", help="with --check: cases whose name contains this")
    asked = parser.parse_args()
    if asked.only and not asked.check:
        parser.error("--only needs --check: a file holds all cases")
    found = traces(asked.only)
    if not asked.check:
        says = {"made_on": made_on(), "hashes": found}
        asked.file.write_text(json.dumps(says, indent=1) + "\n", encoding="utf-8")
        return 0
    expected = json.loads(asked.file.read_text(encoding="utf-8"))["hashes"]
    moved = [name for name in found if found[name] != expected.get(name)]
    for name in moved:
        print(f"moved: {name}: {expected.get(name)} -> {found[name]}")
    print(f"{len(found)} cases, {len(moved)} moved")
    return 1 if moved or not found else 0


if __name__ == "__main__":
    sys.exit(main())
