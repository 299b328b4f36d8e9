"""The verdict's checks of keep-outs, slow zones, zones' times and closures."""

from __future__ import annotations

from dataclasses import replace
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

BOX = {"name": "box", "polygon": [[14.0, 10.0], [16.0, 10.0], [16.0, 12.0], [14.0, 12.0]]}
AT_TIMES = {"closed": [[2, 6]]}
"""It closes at tick 4 and opens at tick 12."""
AT_RANDOM = {"closes": 0.5, "opens": 0.5}


def closing(lab: Lab, when: dict[str, Any] = AT_TIMES, faults: Any = ()) -> Result:
    return run(lab, duration=10.0, closures=[{**BOX, **when}], faults=faults)


@pytest.mark.parametrize("when", [AT_TIMES, AT_RANDOM, {}], ids=["times", "rates", "never"])
def test_a_run_as_asked_passes(lab: Lab, when: dict[str, Any]) -> None:
    faults = [
        {"kind": "close", "closure": "box", "at": 1, "for": 2},
        {"kind": "open", "closure": "box", "at": 2},
        {"kind": "close", "closure": "box", "at": 5, "for": 3},
    ]
    for some in ([], faults):
        result = closing(lab, when, some)
        assert "closures" in checks(result)
        assert failures(result) == {}


@pytest.mark.parametrize(("x", "caught"), [(14.5, True), (13.7, True), (13.5, False)])
def test_a_body_in_a_closed_closure_is_caught(lab: Lab, x: float, caught: bool) -> None:
    result = closing(lab)
    move(result[1], 8, 1, x=x, y=11.0)
    problems = failures(result)
    assert ("closures" in problems) == ("bodies apart" in problems) == caught
    if caught:
        assert problems["closures"].startswith(f"r1 is in box at tick 8, which is closed, at ({x:.3f}, 11.000)")


@pytest.mark.parametrize(
    ("events", "message"),
    [
        ((), "box is open at tick 4, when it is to be closed and nobody is in it"),
        (((6, "closed"), (12, "opened")), "box is open at tick 4, when it is to be closed and nobody is in it"),
        (((3, "closed"), (12, "opened")), "box is closed at tick 3, when it is to be open"),
        (((4, "closed"),), "box is closed at tick 12, when it is to be open"),
        (((4, "closed"), (8, "opened")), "box is open at tick 8, when it is to be closed and nobody is in it"),
    ],
)
def test_closings_at_other_times_are_caught(lab: Lab, events: tuple[tuple[int, str], ...], message: str) -> None:
    result = closing(lab)
    retell(result[1], *(Event(k, kind, None, "box") for k, kind in events))
    assert failures(result)["closures"] == message


@pytest.mark.parametrize(
    ("k", "kind", "detail", "message"),
    [
        (4, "closed", "box", "before tick 4 the journal has closed and closed of box, and should have closed"),
        (9, "closed", "box", "before tick 9 the journal has closed of box, and should have nothing"),
        (14, "stays open", "box", "before tick 14 the journal has stays open of box, and should have nothing"),
        (2, "waiting", "box waits to close: r1 in it", "before tick 2 the journal has waiting of box"),
    ],
)
def test_events_that_change_nothing_are_caught(lab: Lab, k: int, kind: str, detail: str, message: str) -> None:
    result = closing(lab)
    retell(result[1], *result[1].events, Event(k, kind, None, detail))
    assert failures(result)["closures"].startswith(message)


def test_the_robots_that_a_closure_waits_for_are_those_in_it(lab: Lab) -> None:
    """One robot is in the box, one so near that a closed point could reach it, and one far away."""
    starts = [(15.0, 11.0, 0.0), (13.2, 11.0, 0.0), (3.0, 3.0, 0.0)]
    world = lab.world([{**DISC, "speed": 0.001}] * 3, starts, duration=4.0, closures=[{**BOX, "closed": [[1, 9]]}])
    journal = lab.run(world)
    waiting = Event(2, "waiting", 1, "box waits to close: r1 in it")
    assert journal.events == (waiting,)
    assert failures((world, journal)) == {}
    details = [{"detail": f"box waits to close: {names} in it"} for names in ("", "r3", "r1, r3", "r2")]
    for forged in ({"robot": 2}, *details):
        journal.events = (replace(waiting, **forged),)  # type: ignore[arg-type]
        assert list(failures((world, journal))) == ["closures"]


@pytest.mark.parametrize(
    ("kind", "own", "by_itself", "message"),
    [
        ("open", AT_TIMES, [(4, "closed"), (12, "opened")], "box is closed at tick 8, when it is to be open"),
        ("close", {}, [], "box is open at tick 8, when it is to be closed and nobody is in it"),
    ],
)
def test_a_closure_that_obeys_no_fault_is_caught(lab: Lab, kind: str, own: Any, by_itself: Any, message: str) -> None:
    result = closing(lab, own, [{"kind": kind, "closure": "box", "at": 4, "for": 1}])
    others = [event for event in result[1].events if event.detail != "box"]
    retell(result[1], *others, *(Event(k, kind, None, "box") for k, kind in by_itself))
    assert failures(result)["closures"] == message
