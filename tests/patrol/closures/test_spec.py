from pathlib import Path
from typing import Any

import pytest
import yaml

from patrol.errors import BadInput
from patrol.prepare import prepare
from patrol.scenario import dump_scenario, load_scenario, scenario_hash

SQUARE = [[10, 10], [20, 10], [20, 20], [10, 20]]
YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 1.0}


def closure(**fields: Any) -> dict[str, Any]:
    return {"name": "gate", "polygon": SQUARE, "closed": [[10, 20]]} | fields


def by_rates(**fields: Any) -> dict[str, Any]:
    return {"name": "door", "polygon": SQUARE, "closes": 0.1, "opens": 0.2} | fields


@pytest.mark.parametrize("wrapped", [False, True])
def test_a_file_of_closures(tmp_path: Path, wrapped: bool) -> None:
    closures = [closure(), by_rates()]
    text = yaml.safe_dump({"closures": closures} if wrapped else closures)
    (tmp_path / "doors.yaml").write_text(text, encoding="utf-8")
    loaded = load_scenario(YARDS | {"closures": "doors.yaml"}, base=tmp_path)
    assert loaded == load_scenario(YARDS | {"closures": closures})
    assert load_scenario(yaml.safe_load(dump_scenario(loaded))) == loaded


def test_hashes() -> None:
    plain = scenario_hash(load_scenario(YARDS))
    assert scenario_hash(load_scenario(YARDS | {"closures": []})) == plain
    spans: tuple[list[list[float]], ...] = ([[10, 20]], [[10, 30]])
    hashes = {scenario_hash(load_scenario(YARDS | {"closures": [closure(closed=span)]})) for span in spans}
    forgets = {"closures": [closure()], "patrol": {"blocked_memory": 30}}
    assert len(hashes | {plain, scenario_hash(load_scenario(YARDS | forgets))}) == 4


@pytest.mark.parametrize(
    ("closures", "message"),
    [
        ([closure(closes=0.1, opens=0.1)], r"0\.closed: gate: closes by rates already; drop closed, or closes"),
        ([by_rates(opens=None)], r"0\.opens: door: is missing beside the other rate"),
        ([by_rates(closes=0)], r"0\.closes = 0: expected a number above 0"),
        ([closure(closed=[])], r"0\.closed = \[\]: expected 1 or more spans"),
        ([closure(closed=[[20, 10]])], r"0\.closed\.0: gate: ends at 10 s, not after its begin"),
        ([closure(closed=[[10, 30], [20, 40]])], r"0\.closed\.1: gate: begins before the one before it"),
        ([closure(polygon=[[2, 2], [9, 2], [30, 2]])], r"0\.polygon: gate: its corners lie on one line"),
        ([closure(), by_rates(name="gate")], r"1\.name: gate is the name of another closure too"),
        ("none.yaml", r".*none\.yaml: no such file"),
    ],
)
def test_what_is_refused_in_one_line(closures: Any, message: str) -> None:
    with pytest.raises(BadInput, match=rf"closures(\.|: ){message}") as caught:
        load_scenario(YARDS | {"closures": closures})
    assert "\n" not in str(caught.value)


def test_paths_over_regions_are_refused() -> None:
    regions = {"policy": "potential-field", "options": {"paths": "regions"}}
    with pytest.raises(BadInput, match=r"patrol\.options\.paths: regions knows the map and no closures"):
        load_scenario(YARDS | {"patrol": regions, "closures": [closure()]})


def test_random_starts_lie_outside_of_closures() -> None:
    half = closure(polygon=[[0, 0], [60, 0], [60, 88], [0, 88]])
    prepared = prepare(load_scenario(YARDS | {"robots": {"count": 6, "radius": 0.4}, "closures": [half]}))
    assert all(start.x >= 60.4 for start in prepared.starts)


def test_closures_off_the_ground_and_on_starts_or_docks_are_refused() -> None:
    robots: dict[str, Any] = {"count": 1, "model": "holonomic", "radius": 0.4, "starts": [[15, 15]]}
    with pytest.raises(BadInput, match=r"closures\.0\.polygon: gate lies on the start of r1 at \(15, 15\); move it"):
        prepare(load_scenario(YARDS | {"robots": robots, "closures": [closure()]}))
    far = closure(polygon=[[200, 0], [210, 0], [210, 5]])
    off = r"closures\.0\.polygon: gate holds no passable ground of yards, which spans x 0 to 100"
    with pytest.raises(BadInput, match=off):
        prepare(load_scenario(YARDS | {"closures": [far]}))
    robots |= {"starts": [[30, 15]], "battery": {"capacity": 6.0, "idle": 10.0, "charge": 130.0}}
    with pytest.raises(BadInput, match=r"closures\.0\.polygon: gate lies on docks\.0; move one of them"):
        prepare(load_scenario(YARDS | {"robots": robots, "closures": [closure()], "docks": [{"place": [12.5, 12.5]}]}))


@pytest.mark.parametrize(("radius", "fits"), [(0.4, True), (1.2, False)])
def test_a_dock_needs_room_for_the_widest_body_that_charges(radius: float, fits: bool) -> None:
    """The gate ends 0.5 m from the middle of the dock."""
    battery = {"capacity": 6.0, "idle": 10.0, "charge": 130.0}
    robots = [
        {"model": "holonomic", "radius": width, "battery": battery, "start": [30, 15 + 10 * number]}
        for number, width in enumerate((0.4, radius))
    ]
    gate = closure(polygon=[[13, 10], [14, 10], [14, 15], [13, 15]])
    says = YARDS | {"robots": robots, "closures": [gate], "docks": [{"place": [12.5, 12.5]}]}
    if fits:
        prepare(load_scenario(says))
    else:
        with pytest.raises(BadInput, match=r"closures\.0\.polygon: gate lies on docks\.0; move one of them"):
            prepare(load_scenario(says))
