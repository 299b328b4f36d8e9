"""The verdict's checks of keep-outs, slow zones and zones' times."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from patrol.journal import Event
from patrol.journal.records import IN_FORCE, OUT_OF_FORCE
from tests.worldsim.checks.judged import Result, checks, failures, move
from tests.worldsim.conftest import Lab
from worldsim.run_record import MemoryJournal

DISC = {"model": "holonomic", "radius": 0.4}
RECTANGLE = [[16.0, 10.0], [18.0, 10.0], [18.0, 13.0], [16.0, 13.0]]
WHOLE = [[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [0.0, 15.0]]
Place = tuple[float, float]


@pytest.fixture(params=["polygon", "mask"])
def shape(request: pytest.FixtureRequest, tmp_path: Path) -> dict[str, Any]:
    """The rectangle as a polygon, and as the black pixels of a mask, 1 m each."""
    if request.param == "polygon":
        return {"polygon": RECTANGLE}
    shades = np.full((15, 20), 255, dtype=np.uint8)
    shades[2:5, 16:18] = 0
    Image.fromarray(shades).save(tmp_path / "mask.pgm")
    facts = {"image": "mask.pgm", "resolution": 1.0, "origin": [0.0, 0.0, 0.0], "negate": 0}
    facts |= {"occupied_thresh": 0.65, "free_thresh": 0.25}
    (tmp_path / "mask.yaml").write_text(yaml.safe_dump(facts), encoding="utf-8")
    return {"mask": str(tmp_path / "mask.yaml")}


def run(lab: Lab, *zones: dict[str, Any], duration: float = 6.0, **more: Any) -> Result:
    """A run of one robot that stays far from the rectangle."""
    faults, closures = list(more.pop("faults", ())), list(more.pop("closures", ()))
    site = {"zones": list(zones), "faults": faults, "closures": closures}
    world = lab.world([{**DISC, **more}], [(3.0, 3.0, 0.0)], None, duration=duration, **site)
    return world, lab.run(world)


def put(journal: MemoryJournal, k: int, *places: Place) -> None:
    """Put the only robot at places from tick k on, one a tick; it stays at the last."""
    for tick in range(k, len(journal.records)):
        x, y = places[min(tick - k, len(places) - 1)]
        move(journal, tick, 1, x=x, y=y)


@pytest.mark.parametrize(("x", "caught"), [(16.1, True), (17.9, True), (15.9, False), (18.1, False)])
def test_a_centre_in_a_keep_out_is_caught(lab: Lab, shape: dict[str, Any], x: float, caught: bool) -> None:
    result = run(lab, {"name": "stairs", "keep_out": True, **shape})
    assert "keep-outs" in checks(result)
    move(result[1], 3, 1, x=x, y=11.5)
    detail = failures(result).get("keep-outs", "")
    assert detail.startswith(f"r1 is in stairs at tick 3, at ({x:.3f}, 11.500)") if caught else not detail


# --- slow zones ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("x", "way_m", "caught"),
    [
        (16.1, 0.2, True),
        (16.1, 0.15, False),
        (16.1, 0.151, True),
        (17.9, 1.5, True),
        (15.9, 1.5, False),
        (18.1, -1.5, False),
    ],
)
def test_a_robot_that_gets_too_far_in_a_step_is_caught(
    lab: Lab, shape: dict[str, Any], x: float, way_m: float, caught: bool
) -> None:
    result = run(lab, {"name": "ward", "speed": 0.3, **shape}, speed=4.0)
    assert "slow zones" not in failures(result)
    put(result[1], 5, (x, 11.5), (x + way_m, 11.5))
    detail = failures(result).get("slow zones", "")
    told = f"r1 drives {way_m / 0.5:.3f} m/s in ward, which allows 0.3 m/s, at tick 5, at ({x:.3f}, 11.500)"
    assert detail.startswith(told) if caught else not detail


@pytest.mark.parametrize("order", [1, -1])
def test_the_lowest_of_the_limits_of_zones_that_overlap_counts(lab: Lab, order: int) -> None:
    zones = [{"name": f"ward{speed}", "polygon": RECTANGLE, "speed": speed} for speed in (0.3, 2.0)][::order]
    result = run(lab, *zones, speed=4.0)
    put(result[1], 5, (16.1, 11.5), (16.4, 11.5))
    assert "in ward0.3, which allows 0.3 m/s" in failures(result)["slow zones"]


@pytest.mark.parametrize(("k", "caught"), [(3, False), (4, True), (7, True), (8, False)])
def test_only_while_the_zone_is_in_force(lab: Lab, k: int, caught: bool) -> None:
    result = run(lab, {"name": "ward", "polygon": RECTANGLE, "speed": 0.3, "times": [[2.0, 4.0]]}, speed=4.0)
    put(result[1], k, (16.5, 11.5), (17.5, 11.5))
    assert ("slow zones" in failures(result)) == caught


def test_robots_of_all_models_that_drive_at_random_are_slow_there(lab: Lab) -> None:
    """Each of them is faster elsewhere."""
    world, journal = lab.driven(60, zones=[{"name": "ward", "polygon": WHOLE, "speed": 0.5, "times": [[10.0, 20.0]]}])
    assert failures((world, journal)) == {}
    assert checks((world, journal))["slow zones"].detail == "80 steps in 1 slow zones, none too fast"
    fastest = {True: 0.0, False: 0.0}
    for k, record in enumerate(journal.ticks):
        for row, spec in zip(record.robots, world.scenario.roster, strict=True):
            speed = abs(row.c0) if spec.model != "holonomic" else (row.c0**2 + row.c1**2) ** 0.5
            fastest[20 <= k < 40] = max(fastest[20 <= k < 40], speed)
    assert fastest[True] == pytest.approx(0.5)
    assert fastest[False] > 2.0


def test_under_uneven_motion_the_command_counts(lab: Lab) -> None:
    zone = {"name": "ward", "polygon": WHOLE, "speed": 0.5}
    world, journal = lab.driven(60, zones=[zone], faults=[{"kind": "motion", "who": "all", "speed": 0.3}])
    assert failures((world, journal)) == {}
    move(journal, 9, 1, c0=1.0)
    says = "r1 drives 1.000 m/s in ward, which allows 0.5 m/s, at tick"
    assert failures((world, journal))["slow zones"].startswith(says)


# --- the times of zones ----------------------------------------------------------------------------------------------

NIGHT = {"name": "night", "polygon": RECTANGLE, "speed": 0.3, "times": [[0, 2], [4, 6]]}
SHIFT = {"name": "shift", "polygon": RECTANGLE, "weight": 2, "times": [[4, 5.6], [5.9, 6.4], [8, 99]]}
"""No tick lies between its first two times."""
VAULT = {"name": "vault", "polygon": RECTANGLE, "weight": 4}
TOLD = [
    (4, OUT_OF_FORCE, "night"),
    (8, IN_FORCE, "night"),
    (8, IN_FORCE, "shift"),
    (12, OUT_OF_FORCE, "night"),
    (13, OUT_OF_FORCE, "shift"),
    (16, IN_FORCE, "shift"),
]


def of_zones(journal: MemoryJournal) -> list[tuple[int, str, str]]:
    return [(event.k, event.kind, event.detail) for event in journal.events if event.kind in (IN_FORCE, OUT_OF_FORCE)]


def retell(journal: MemoryJournal, *events: Event) -> None:
    journal.events = tuple(sorted(events, key=lambda event: event.k))


def test_a_zone_that_begins_or_ends_is_an_event(lab: Lab) -> None:
    result = run(lab, NIGHT, SHIFT, VAULT, duration=10.0)
    assert of_zones(result[1]) == TOLD
    assert failures(result) == {}
    without = run(lab, VAULT, duration=10.0)
    assert of_zones(without[1]) == []
    assert "zone times" not in checks(without)


@pytest.mark.parametrize(
    ("removed", "added", "message"),
    [
        (2, (), "shift is in force from tick 8 on, and the journal has no event of it"),
        (5, ((15, IN_FORCE, "shift"),), "the journal has shift in force from tick 15 on, when nothing changes"),
        (None, ((2, IN_FORCE, "vault"),), "the journal has vault in force from tick 2 on, when nothing changes"),
        (None, (TOLD[1],), "the journal has night in force from tick 8 on, when nothing changes"),
    ],
)
def test_other_events_are_caught(
    lab: Lab, removed: int | None, added: tuple[tuple[int, str, str], ...], message: str
) -> None:
    result = run(lab, NIGHT, SHIFT, VAULT, duration=10.0)
    gone = None if removed is None else TOLD[removed]
    kept = [event for event in result[1].events if (event.k, event.kind, event.detail) != gone]
    retell(result[1], *kept, *(Event(k, kind, None, name) for k, kind, name in added))
    assert failures(result)["zone times"] == message


# --- closures --------------------------------------------------------------------------------------------------------
