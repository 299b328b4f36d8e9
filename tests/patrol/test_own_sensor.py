import hashlib
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.classes.static_check import check_without_running
from patrol.errors import BadInput
from patrol.ground.footprint import SensorSetup, View
from patrol.ground.sensors import Disc, footprint_of
from patrol.ground.terrain import Terrain
from patrol.own_sensor import CheckedSensor, SensorFailed, allow_sensor, make_footprint, sensor_named
from patrol.pose import Pose
from patrol.scenario import Scenario, dump_scenario, load_scenario, same_but_for_files, scenario_hash
from patrol.scenario.load import keep_scenario
from tests.patrol.sensors import records

__all__ = ["records"]

ELLIPSE = Path(__file__).parents[2] / "examples" / "elliptic_sensor.py"
GROUND = Terrain("t", np.ones((40, 40), dtype=np.bool_), 0.5)
MIDDLE = Pose(10.25, 10.25, 0.0)


def scenario_with(**sensor: Any) -> Scenario:
    papers = {"policy": "potential-field"}
    return load_scenario({"terrain": {"builtin": "open"}, "point": 1.0, "sensor": sensor, "patrol": papers})


def own(path: Path = ELLIPSE, name: str = "Ellipse", **settings: Any) -> Scenario:
    return scenario_with(kind=f"{path}:{name}", **settings)


def refused(**sensor: Any) -> str:
    with pytest.raises(BadInput) as bad:
        scenario_with(**sensor)
    return str(bad.value)


def test_a_section_of_0_2_means_what_it_meant() -> None:
    """Its hash is as before there were other fields than these four."""
    assert scenario_hash(scenario_with()) == "9b9852195a70415dd60de167d8553cfadac133f347d1e0fa2d04141f749dd6f6"
    told = {"range": 8, "angle": 90, "line_of_sight": False, "quality": [[1, 1], [8, 0.5]]}
    assert scenario_hash(scenario_with(**told)) == "b028355589299f0327e4da9abe8d54c44464c81cf937cd7683d8aff422b5796e"


def test_a_disc_is_a_sector_all_round_and_another_kind_drops_the_settings_before() -> None:
    assert scenario_hash(scenario_with(kind="disc")) == scenario_hash(scenario_with())
    assert scenario_hash(scenario_with(kind="sector", angle=90)) == scenario_hash(scenario_with(angle=90))
    mapping = {"terrain": {"builtin": "open"}, "sensor": {"kind": f"{ELLIPSE}:Ellipse", "options": {"across": 2}}}
    assert load_scenario(mapping, {"sensor.kind": "disc"}).sensor.options is None


@pytest.mark.parametrize(
    ("sensor", "says"),
    [
        ({"kind": "disc", "angle": 90}, "sensor.angle = 90: a disc looks all round; set kind to sector, or drop"),
        ({"options": {"across": 2}}, "sensor.options: are those of a sensor of one's own, and kind is sector; drop"),
        ({"kind": "./x.py:X", "angle": 90}, "sensor.angle: is a setting of the kinds sector and disc; drop it, or"),
        ({"kind": "a.b:X", "quality": 0.5}, "sensor.quality: is a setting of the kinds sector and disc; drop it, or"),
        ({"kind": "a.b:X", "kind_sha256": "0" * 64}, "sensor.kind_sha256: only a sensor that is a file has a hash"),
        ({"kind": "two words"}, 'sensor.kind = "two words": expected sector, disc, package.module:Class, ./file.py'),
    ],
)
def test_settings_without_effect_are_refused(sensor: dict[str, Any], says: str) -> None:
    assert says in refused(**sensor)


def test_a_sensors_file_enters_by_its_content(tmp_path: Path) -> None:
    copy = tmp_path / "other.py"
    shutil.copy(ELLIPSE, copy)
    here, there = own(options={"across": 2}), own(copy, options={"across": 2})
    assert here.sensor.kind_sha256 == hashlib.sha256(ELLIPSE.read_bytes()).hexdigest()
    assert scenario_hash(here) == scenario_hash(there)
    assert same_but_for_files(here, there)
    assert scenario_hash(own(options={"across": 3})) != scenario_hash(here)
    copy.write_text(copy.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert scenario_hash(own(copy, options={"across": 2})) != scenario_hash(here)


def test_a_run_folder_keeps_the_file(tmp_path: Path) -> None:
    kept = keep_scenario(own(options={"across": 2}), tmp_path)
    assert (tmp_path / "sensor" / ELLIPSE.name).read_bytes() == ELLIPSE.read_bytes()
    again = load_scenario(kept)
    assert scenario_hash(again) == scenario_hash(own(options={"across": 2}))
    kept.write_text(dump_scenario(again), encoding="utf-8")
    assert load_scenario(kept) == again


def test_only_a_user_who_runs_a_sensor_lets_other_commands_run_it(records: Path) -> None:
    spec = own().sensor
    with pytest.raises(BadInput, match="this user has not run a scenario with it here; read it, and if you trust it"):
        make_footprint(spec, GROUND, 4)
    allow_sensor(spec, record=True)
    assert [file.name for file in records.iterdir()] == [spec.kind_sha256]
    assert make_footprint(spec, GROUND, 4).visible(MIDDLE).shows(20, 20)


def test_the_record_of_a_command_serves_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = own().sensor
    allow_sensor(spec, record=True)
    monkeypatch.setattr("patrol.own_sensor._allowed", set())
    assert make_footprint(spec, GROUND, 4).visible(MIDDLE).shows(20, 20)
    monkeypatch.setattr("os.geteuid", lambda: 4_000_000)  # the record is another user's
    with pytest.raises(BadInput, match="is a program"):
        make_footprint(spec, GROUND, 4)


def test_a_file_that_claims_the_hash_of_an_allowed_one_is_refused(tmp_path: Path) -> None:
    allow_sensor(own().sensor)
    other = tmp_path / "other.py"
    other.write_text("raise SystemExit('ran')\n", encoding="utf-8")
    claims = own(other, kind_sha256=own().sensor.kind_sha256).sensor
    with pytest.raises(BadInput, match="is not the file that this scenario was resolved with"):
        make_footprint(claims, GROUND, 4)


def test_a_scenario_that_was_not_opened_by_its_user_has_no_hash() -> None:
    told = load_scenario(
        {"terrain": {"builtin": "open"}, "sensor": {"kind": f"{ELLIPSE}:Ellipse"}}, opens_classes=False
    )
    with pytest.raises(BadInput, match=r"has no sensor\.kind_sha256, so the file is not run; run it first"):
        make_footprint(told.sensor, GROUND, 4)


def test_an_installed_class_is_allowed_by_its_name() -> None:
    spec = scenario_with(kind="os:system").sensor
    with pytest.raises(BadInput, match="is a program"):
        make_footprint(spec, GROUND, 4)
    with pytest.raises(BadInput, match="os:system: is not a class with a method visible"):
        allow_sensor(spec)
    installed = scenario_with(kind="examples.elliptic_sensor:Ellipse").sensor
    allow_sensor(installed)
    assert make_footprint(installed, GROUND, 4).visible(MIDDLE).shows(20, 20)


def test_a_built_in_sensor_leaves_no_record(records: Path) -> None:
    allow_sensor(scenario_with().sensor)
    assert not records.exists()


def test_a_check_runs_nothing_of_it(tmp_path: Path) -> None:
    file = tmp_path / "sensor.py"
    file.write_text("open(__file__ + '.ran', 'w')\nclass Blind:\n    pass\n", encoding="utf-8")
    with pytest.raises(BadInput, match="is not a class with a method visible"):
        check_without_running(sensor_named(own(file, "Blind").sensor))
    check_without_running(sensor_named(own().sensor))
    check_without_running(sensor_named(scenario_with().sensor))
    assert not list(tmp_path.glob("*.ran"))


def test_options_are_checked() -> None:
    for options, says in (
        ({"acros": 2}, "sensor.options.acros = 2: unknown key"),
        ({"across": -1}, "sensor.options.across = -1: Input should be greater than 0"),
    ):
        with pytest.raises(BadInput, match=says):
            allow_sensor(own(options=options).sensor)


SETUP = SensorSetup(GROUND, 3.0)


class Good:
    """Sees its own point."""

    all_round: Any = False
    leaves_age: Any = False

    def __init__(self, setup: SensorSetup) -> None:
        self.setup = setup

    def visible(self, pose: Pose) -> Any:
        return self.changed(Disc(self.setup).visible(pose))

    def changed(self, view: View) -> Any:
        return view


def changing(change: Any, **flags: Any) -> type[Good]:
    return type("Changed", (Good,), {"changed": lambda _, view: change(view), **flags})


def far(view: View) -> View:
    view.mask[0, 0] = 1
    return view


def two(view: View) -> View:
    view.mask[6, 6] = 2
    return view


def blind(view: View) -> View:
    view.mask[:] = 0
    return view


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (changing(lambda _: None), "returned NoneType; return patrol.ground.footprint.View"),
        (changing(lambda view: View(view.row0 + 1, view.col0, view.mask)), r"returned a window at \(15, 14\); let it"),
        (changing(lambda view: View(view.row0, view.col0, view.mask != 0)), "bool of shape .* as mask; return uint8"),
        (changing(lambda view: View(view.row0, view.col0, view.mask[1:])), r"return uint8 of shape \(13, 13\)"),
        (changing(lambda view: View(view.row0, view.col0, view.mask.tolist())), "returned list as mask"),
        (changing(two), "returned a mask that holds 2"),
        (changing(far), "farther than the range of 3 m"),
        (changing(blind), "a view without the robot's own point"),
        (changing(lambda view: View(view.row0, view.col0, view.mask, view.mask * 0.5)), "its leaves_age is False"),
        (
            changing(lambda view: View(view.row0, view.col0, view.mask, view.mask), leaves_age=True),
            "returned uint8 of shape .* as quality",
        ),
        (
            changing(lambda view: View(view.row0, view.col0, view.mask, view.mask * np.nan), leaves_age=True),
            "returned the quality nan; give more than 0",
        ),
        (changing(lambda _: 1 / 0), r"raised ZeroDivisionError: division by zero \(test_own_sensor.py:"),
    ],
)
def test_a_view_that_cannot_be_used_is_named(made: type[Good], says: str) -> None:
    sensor = CheckedSensor(made, SETUP, "sensor.kind = x:X")
    with pytest.raises(SensorFailed, match=says) as failed:
        sensor.visible(MIDDLE)
    assert str(failed.value).startswith("sensor.kind = x:X: ")
    assert "\n" not in str(failed.value)


def test_points_outside_the_terrain_are_refused() -> None:
    def beyond(view: View) -> View:
        view.mask[6, 5] = 1
        return view

    corner = Pose(0.25, 0.25, 0.0)
    CheckedSensor(Good, SETUP, "x").visible(corner)
    with pytest.raises(SensorFailed, match="a point outside the terrain"):
        CheckedSensor(changing(beyond), SETUP, "x").visible(corner)


def test_a_class_that_lacks_what_a_sensor_has_is_named() -> None:
    with pytest.raises(SensorFailed, match="all_round is None; give the class all_round = True or False"):
        CheckedSensor(changing(None, all_round=None), SETUP, "x")
    with pytest.raises(SensorFailed, match="cannot be made TypeError: "):
        CheckedSensor(type("NoSetup", (), {}), SETUP, "x")


def test_a_view_is_a_copy_that_cannot_be_changed() -> None:
    """A sensor that writes into its own window again changes no view that is kept."""
    window = np.zeros((13, 13), dtype=np.uint8)

    def reused(view: View) -> View:
        window[:] = view.mask
        return View(view.row0, view.col0, window)

    sensor = CheckedSensor(changing(reused), SETUP, "x")
    first = sensor.visible(MIDDLE)
    sensor.visible(Pose(0.25, 0.25, 0.0))
    assert np.array_equal(first.mask, Disc(SETUP).visible(MIDDLE).mask)


def test_the_ellipse_sees_far_ahead_and_little_to_the_sides() -> None:
    spec = own(range=6.0, options={"across": 2.0}).sensor
    allow_sensor(spec)
    ellipse, disc = make_footprint(spec, GROUND, 4), footprint_of(GROUND, 6.0)
    view = ellipse.visible(MIDDLE)
    assert view.shows(20, 32)
    assert view.shows(24, 20)
    assert not view.shows(25, 20)
    turned = ellipse.visible(Pose(10.25, 10.25, np.pi / 2))
    assert np.array_equal(turned.mask, view.mask.T)
    assert not (view.mask & ~disc.visible(MIDDLE).mask).any()
    assert not view.mask.flags.writeable
