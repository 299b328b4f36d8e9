"""Runs on a map with another origin: robots and world do the same there, only elsewhere."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fogwatch.inprocess import run_in_process
from patrol.journal.records import TickRecord
from patrol.scenario import load_scenario
from tests.cells import write_cells

ORIGINS = ((0.0, 0.0), (-64.0, 32.0))
BODY = {"model": "holonomic", "radius": 0.3, "speed": 1.0}
BATTERY = {"capacity": 1.0, "idle": 10.0, "drive": 30.0, "charge": 200.0, "start": 0.35}


def box(left: float, low: float, right: float, high: float, at: tuple[float, float]) -> list[list[float]]:
    corners = [(left, low), (right, low), (right, high), (left, high)]
    return [[x + at[0], y + at[1]] for x, y in corners]


def settings(kind: str, at: tuple[float, float]) -> dict[str, Any]:
    """Return what a scenario has besides its map, by what is tried."""
    place = [at[0] + 16.0, at[1] + 3.0]
    found: dict[str, dict[str, Any]] = {
        "stochastic": {},
        "tour": {"patrol": {"policy": "committed"}, "robots": {**BODY, "count": 3, "model": "differential"}},
        "paper": {"patrol": {"policy": "potential-field"}},
        "straight": {"patrol": {"policy": "potential-field", "options": {"paths": "straight"}}},
        "cars": {"robots": {**BODY, "count": 2, "model": "car", "turning_radius": 0.8}, "faults": [
            {"kind": "kill", "who": "r1", "at": 20}
        ]},
        "claims": {"patrol": {"policy": "agent.policies.commitment:Commitment", "options": {"separation": "claims"}}},
        "sector": {"sensor": {"range": 4.0, "kind": "sector", "angle": 120}},
        "intruder": {"intruders": [{"place": place, "at": 10}]},
        "closures": {
            "patrol": {"policy": "committed"},
            "closures": [{"name": "door", "polygon": box(10.5, 4.0, 11.0, 7.0, at), "closed": [[15, 40]]}],
        },
        "zones": {
            "zones": [
                {"name": "east", "polygon": box(21.0, 0.0, 33.0, 11.0, at), "weight": 3.0},
                {"name": "slow", "polygon": box(0.0, 0.0, 5.0, 11.0, at), "speed": 0.3},
                {"name": "out", "polygon": box(12.0, 1.0, 20.0, 5.0, at), "speed": 0.5},
            ]
        },
        "docks": {"robots": {**BODY, "count": 2, "battery": BATTERY}, "docks": [{"place": place}]},
        "walls": {"radio": {"model": "path-loss", "options": {"wall": 10.0, "reference": 70.0}}},
    }  # fmt: skip
    return found[kind]


def run(folder: Path, kind: str, at: tuple[float, float]) -> tuple[list[TickRecord], bool]:
    occupied = np.zeros((22, 64), dtype=np.bool_)
    occupied[[0, -1]] = occupied[:, [0, 21, 42, -1]] = True
    occupied[9:13, [21, 42]] = False
    folder.mkdir()
    terrain = write_cells(folder, "rooms", occupied)
    says = terrain.read_text(encoding="utf-8")
    terrain.write_text(says.replace("[0, 0, 0]", f"[{at[0]:g}, {at[1]:g}, 0]"), encoding="utf-8")
    starts = [[at[0] + x, at[1] + 5.0] for x in (3.0, 6.0, 15.0)]
    given = {"terrain": {"map": str(terrain)}, "point": 0.5, "duration": 45.0, "sensor": {"range": 4.0}}
    scenario = {"robots": {**BODY, "count": 3}, **given, **settings(kind, at)}
    scenario["robots"] = {**scenario["robots"], "starts": starts[: scenario["robots"]["count"]]}
    ticks: list[TickRecord] = []
    outcome = run_in_process(load_scenario(scenario), progress=ticks.append)
    return ticks, outcome.verdict.valid


@pytest.mark.parametrize(
    "kind",
    [
        *("stochastic", "tour", "paper", "straight", "cars", "claims", "sector", "intruder", "closures", "zones"),
        *("docks", "walls"),
    ],
)
def test_a_run_on_a_map_elsewhere_is_the_same_run(kind: str, tmp_path: Path) -> None:
    (first, is_valid), (second, is_valid_too) = (
        run(tmp_path / str(number), kind, at) for number, at in enumerate(ORIGINS)
    )
    assert is_valid
    assert is_valid_too
    for here, there in zip(first, second, strict=True):
        assert (here.mfow, here.seen, list(here.dropped)) == (there.mfow, there.seen, list(there.dropped)), here.k
        for robot, other in zip(here.robots, there.robots, strict=True):
            assert (robot.state, robot.status, robot.bumped) == (other.state, other.status, other.bumped), here.k
            moved = robot.x + ORIGINS[1][0], robot.y + ORIGINS[1][1]
            assert (other.x, other.y) == pytest.approx(moved, abs=1e-6), here.k
