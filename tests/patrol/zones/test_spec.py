import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from patrol.areas import holds_tick
from patrol.errors import BadInput
from patrol.scenario import dump_scenario, load_scenario, scenario_hash
from patrol.zones.spec import zones_in_force

SQUARE = [[10, 10], [20, 10], [20, 20], [10, 20]]
YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 1.0}


def zone(**fields: Any) -> dict[str, Any]:
    return {"name": "vault", "polygon": SQUARE} | fields


def masked(file: Path) -> dict[str, Any]:
    return YARDS | {"zones": [zone(polygon=None, mask=str(file), weight=2)]}


def write_mask(folder: Path, shades: list[list[int]], **says: Any) -> Path:
    """Write a mask whose pixels have the given shades, the upper row first."""
    Image.fromarray(np.array(shades, dtype=np.uint8)).save(folder / "mask.pgm")
    facts = {"image": "mask.pgm", "resolution": 0.5, "origin": [10.0, 10.0, 0.0], "negate": 0}
    facts |= {"occupied_thresh": 0.65, "free_thresh": 0.25} | says
    (folder / "mask.yaml").write_text(yaml.safe_dump(facts), encoding="utf-8")
    return folder / "mask.yaml"


def test_a_loaded_scenario_needs_no_mask_any_more(tmp_path: Path) -> None:
    file = write_mask(tmp_path, [[0, 255], [255, 255]])
    loaded = load_scenario(masked(file))
    file.unlink()
    again = load_scenario(yaml.safe_load(dump_scenario(loaded)))
    assert again == loaded
    mask = again.zones[0].mask
    assert mask is not None
    assert mask.marked().tolist() == [[False, False], [True, False]]  # the lowest row first


@pytest.mark.parametrize(
    ("mode", "thresholds", "marked"),
    [
        ("trinary", {}, [True, False, False, False]),
        ("scale", {"occupied_thresh": 1.0, "free_thresh": 0.0}, [True, True, True, False]),
        ("raw", {}, [False, True, False, False]),
    ],
)
def test_modes_of_a_mask(tmp_path: Path, mode: str, thresholds: dict[str, float], marked: list[bool]) -> None:
    file = write_mask(tmp_path, [[0, 100, 250, 255]], mode=mode, **thresholds)
    mask = load_scenario(masked(file)).zones[0].mask
    assert mask is not None
    assert mask.marked().tolist() == [marked]


def test_a_mask_in_mode_scale_is_marked_from_half_a_percent_on(tmp_path: Path) -> None:
    """Greys 254 and 253 are 0.39 % and 0.78 % occupied, and a value is rounded."""
    file = write_mask(tmp_path, [[254, 253]], mode="scale", occupied_thresh=1.0, free_thresh=0.0)
    mask = load_scenario(masked(file)).zones[0].mask
    assert mask is not None
    assert mask.marked().tolist() == [[False, True]]


@pytest.mark.parametrize("wrapped", [False, True])
def test_a_file_of_zones_and_masks_beside_it(tmp_path: Path, wrapped: bool) -> None:
    folder = tmp_path / "site"
    folder.mkdir()
    write_mask(folder, [[0, 0]])
    zones = [zone(weight=10), {"name": "stairs", "mask": "mask.yaml", "keep_out": True}]
    (folder / "zones.yaml").write_text(yaml.safe_dump({"zones": zones} if wrapped else zones), encoding="utf-8")
    loaded = load_scenario(YARDS | {"zones": "site/zones.yaml"}, base=tmp_path)
    assert [each.name for each in loaded.zones] == ["vault", "stairs"]
    assert loaded == load_scenario(
        YARDS | {"zones": [zone(weight=10), zones[1] | {"mask": "site/mask.yaml"}]}, base=tmp_path
    )


def test_hashes() -> None:
    plain = scenario_hash(load_scenario(YARDS))
    assert scenario_hash(load_scenario(YARDS | {"zones": []})) == plain
    hashes = {scenario_hash(load_scenario(YARDS | {"zones": [zone(weight=weight)]})) for weight in (2, 3)}
    assert len(hashes | {plain}) == 3


ONE_NEEDED = r"0: vault: exactly one is needed: keep_out: true, a weight, an age or a speed"


@pytest.mark.parametrize(
    ("zones", "message"),
    [
        ([zone(weight=2, weights=[[9, 0]])], r"0\.weights\.0\.1 = 0: expected a number from 0\.001 to 1000"),
        ([zone(weight=2, weights=[[9, 3], [9, 4]])], r"0\.weights: .*: each begins later than the one before"),
        ([zone(weight=2, weights=[[1e5, 3]])], r"0\.weights: .*3 times from 100000 s on.*the run ends"),
        ([zone(weight=2, weights=[[9.1, 3], [9.2, 4]])], r"0\.weights: .*3 times from 9\.1 s on.*the next one"),
        ([zone(speed=0.5, weights=[])], r"0\.weights: .*: take the place of weight, which is missing"),
        ([zone(age=9, weights=[[9, 3]])], r"0\.weights: .*: take the place of weight, which is missing"),
        ([zone(weight=0)], r"0\.weight = 0: expected a number from 0\.001 to 1000"),
        ([zone(weight=1e6)], r"0\.weight = 1000000\.0: expected a number from 0\.001 to 1000"),
        ([zone(polygon=SQUARE[:2], weight=2)], r"0\.polygon = .*: expected 3 or more corners"),
        ([zone(polygon=[[2, 2], [30, 2], [50, 2]], weight=2)], r"0\.polygon: vault: its corners lie on one line"),
        ([zone(one_way=90)], r"0\.one_way: one-way zones are gone; drop it, or keep robots out with keep_out"),
        ([zone(weight=2, age=60)], ONE_NEEDED),
        ([zone()], ONE_NEEDED),
        ([zone(weight=2, speed=0.5)], ONE_NEEDED),
        ([zone(speed=0)], r"0\.speed = 0: expected a number above 0 and at most 1e9"),
        ([zone(speed=4.4)], r"0\.speed = 4\.4: vault slows no robot, as the fastest drives 4\.4 m/s; give less, or"),
        ([zone(keep_out=True, times=[[0, 9]])], r"0\.times: vault: a keep-out always holds; drop them, or make"),
        ([zone(weight=2, times=[[9, 9]])], r"0\.times\.0: vault: ends at 9 s, not after its begin; correct it"),
        ([zone(weight=2, times=[[0, 9], [9, 12]])], r"0\.times\.1: vault: begins before the one before it is over"),
        ([zone(weight=2, times=[[-1, 9]])], r"0\.times\.0\.0 = -1: expected a number from 0 to 1e9"),
        ([zone(weight=2, times=[[9.1, 9.2]])], r"0\.times: vault: 9\.1 to 9\.2 s holds no tick of 0\.5 s; make it"),
        ([zone(keep_out=False)], r"0\.keep_out: vault: is true or left out; drop it"),
        ([{"name": "vault", "weight": 2}], r"0: vault: exactly one is needed: a polygon or a mask"),
        ([zone(weight=2), zone(weight=3)], r"1\.name: vault is the name of another zone too; rename one"),
        ([zone(name="elsewhere", weight=2)], r"0\.name: elsewhere is what figures call"),
        ("none.yaml", r".*none\.yaml: no such file"),
        ([{"name": "stairs", "mask": "none.yaml", "keep_out": True}], r"0\.mask: .*none\.yaml: no such file"),
    ],
)
def test_what_is_refused_in_one_line(zones: Any, message: str) -> None:
    with pytest.raises(BadInput, match=rf"zones(\.|: ){message}") as caught:
        load_scenario(YARDS | {"zones": zones})
    assert "\n" not in str(caught.value)


def test_a_few_later_weights_are_named() -> None:
    turns = [[60 * n, n] for n in range(1, 8)]
    few, many = load_scenario(
        YARDS | {"zones": [zone(weight=10, weights=turns[:2]), zone(name="cellar", weight=2, weights=turns[2:])]}
    ).zones
    assert few.labels == "vault x10, x1 from 60 s, x2 from 120 s"
    assert many.labels == "cellar x2, x3 from 180 s, x4 from 240 s, x5 from 300 s, x6 from 360 s, and 1 more"


def test_when_a_zone_is_in_force() -> None:
    zones = [zone(weight=2, times=[[1, 2.5], [4, 9]]), zone(name="ward", speed=0.5), zone(name="off", age=9, times=[])]
    loaded = load_scenario(YARDS | {"zones": zones}).zones
    ticks = [k for k in range(20) if "vault" in zones_in_force(loaded, 0.5 * k)]
    assert ticks == [2, 3, 4, *range(8, 18)]
    assert zones_in_force(loaded, 0.0) == {"ward"}
    assert [each.label for each in loaded] == ["vault x2", "ward 0.5 m/s", "off 9 s"]


@pytest.mark.parametrize(
    ("span", "step", "holds"),
    [
        ((1.1, 1.2), 0.1, True),
        ((1.11, 1.19), 0.1, False),
        ((0.0, 0.1), 0.5, True),
        ((0.6, 1.0), 0.5, False),
        ((11.9, 12.2), 0.7, False),
    ],
)
def test_times_between_two_ticks(span: tuple[float, float], step: float, holds: bool) -> None:
    assert holds_tick(span, step) == holds
    assert any(span[0] <= k * step < span[1] for k in range(100)) == holds


@pytest.mark.parametrize("step", [0.05, 0.1, 0.3, 0.5, 0.7])
def test_a_span_of_an_instant_holds_the_tick_it_begins_at(step: float) -> None:
    for k in range(200):
        tick = k * step
        before, after = math.nextafter(tick, -math.inf), math.nextafter(tick, math.inf)
        assert holds_tick((tick, after), step)
        assert holds_tick((before, after), step)
        assert not holds_tick((before, tick), step)
        assert not holds_tick((after, tick + step / 2), step)


def test_a_mask_without_a_mark_and_cells_of_another_number_are_refused(tmp_path: Path) -> None:
    file = write_mask(tmp_path, [[255, 255]])
    with pytest.raises(BadInput, match=r"zones\.0\.mask: .*mask\.yaml: marks no cell; correct the image"):
        load_scenario(masked(file))
    file = write_mask(tmp_path, [[0] * 40] * 40)
    raw = yaml.safe_load(dump_scenario(load_scenario(masked(file))))
    raw["zones"][0]["mask"]["rows"] = 41
    with pytest.raises(
        BadInput, match=r"zones\.0\.mask\.cells: are not 41 x 40 cells; name the mask's YAML file again"
    ):
        load_scenario(raw)


def test_an_occupancy_of_100_in_mode_raw_is_the_last_that_is_known(tmp_path: Path) -> None:
    mask = load_scenario(masked(write_mask(tmp_path, [[1, 99, 100, 101]], mode="raw"))).zones[0].mask
    assert mask is not None
    assert mask.marked().tolist() == [[True, True, True, False]]
