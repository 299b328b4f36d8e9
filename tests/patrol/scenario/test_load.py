import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from patrol.errors import BadInput
from patrol.pose import Pose, wrap
from patrol.scenario import (
    Scenario,
    as_mapping,
    dump_scenario,
    load_scenario,
    open_scenario,
    parse_overrides,
    scenario_hash,
    scenario_schema,
    with_spares,
)

YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}}
DESIGNED = """
name: yards-five
terrain: {builtin: yards}        # or {map: path/to/map.yaml}, relative to this file
point: 0.1                       # m, side of one point of the grid
step: 0.5                        # s per tick
duration: 5000                   # simulated s
seed: 7
pace: lockstep                   # lockstep | realtime | a factor of real time
robots: {count: 5, model: car, speed: 4.4, radius: 1.0, turning_radius: 3.5}
sensor: {range: 10, angle: 360, line_of_sight: true, quality: 1.0}
patrol:
  policy: stochastic
  options: {separation: claims, unpredictability: 1}
  avoidance: goal-refinement
radio: {trail: 0, key: null, forget_after: 10}
faults: []
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def write_map(folder: Path, origin: str = "[0, 0, 0]", pixels: bytes = b"\xff" * 16) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "hall.pgm").write_bytes(b"P5 4 4 255\n" + pixels)
    keys = f"resolution: 0.5\norigin: {origin}\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    return write(folder / "hall.yaml", f"image: hall.pgm\n{keys}")


def test_the_defaults_are_those_of_the_designed_file(tmp_path: Path) -> None:
    designed = load_scenario(write(tmp_path / "five.yaml", DESIGNED))
    assert load_scenario({**YARDS, "name": "yards-five"}) == designed
    assert designed.ticks == 10_000
    assert designed.factor is None
    assert [spec.name for spec in designed.roster] == ["r1", "r2", "r3", "r4", "r5"]


def test_the_name_comes_from_the_file_or_the_terrain(tmp_path: Path) -> None:
    assert load_scenario(write(tmp_path / "two yards!.yaml", "terrain: {builtin: yards}")).name == "two-yards"
    assert load_scenario(write(tmp_path / "(ä).yaml", "terrain: {builtin: yards}")).name == "scenario"
    assert load_scenario(YARDS).name == "yards"
    assert load_scenario({"terrain": {"map": "maps/hall.yaml"}}).name == "hall"


def test_a_copy_with_other_robots_has_its_own_roster() -> None:
    two, three = (load_scenario({**YARDS, "robots": {"count": count}}) for count in (2, 3))
    assert (len(two.roster), len(three.roster)) == (2, 3)
    assert two.roster is two.roster, "it is made once"
    copied = two.model_copy(update={"robots": three.robots})
    assert copied.roster == three.roster
    assert copied == two.model_copy(update={"robots": three.robots})
    assert "roster" not in copied.model_dump()


def test_a_group_or_a_list_makes_a_roster() -> None:
    robots = {"count": 3, "model": "holonomic", "speed": 1, "starts": [[1, 2], [3, 4, 7]]}
    roster = load_scenario({**YARDS, "robots": robots}).roster
    assert [spec.number for spec in roster] == [1, 2, 3]
    assert [spec.start for spec in roster] == [Pose(1, 2, 0), Pose(3, 4, wrap(7)), None]
    assert {(spec.model, spec.speed, spec.radius) for spec in roster} == {("holonomic", 1.0, 1.0)}
    listed = [{"name": "scout", "radius": 0.3, "start": [5, 6]}, {"model": "holonomic"}, {"start": "random"}]
    roster = load_scenario({**YARDS, "robots": listed}).roster
    bodies = [(spec.name, spec.radius, spec.model) for spec in roster]
    assert bodies == [("scout", 0.3, "car"), ("r2", 1.0, "holonomic"), ("r3", 1.0, "car")]
    assert [spec.start for spec in roster] == [Pose(5, 6, 0), None, None]


def test_spare_robots_come_last_and_change_nothing_that_is_there_without_them() -> None:
    plain = load_scenario({**YARDS, "robots": {"count": 3}})
    spared = with_spares(plain, 2)
    assert [spec.name for spec in spared.roster] == ["r1", "r2", "r3", "r4", "r5"]
    assert spared.spares == {4, 5}
    assert spared.roster[:3] == plain.roster
    assert "spare" not in as_mapping(plain)["robots"]
    assert load_scenario(as_mapping(spared)) == spared
    assert scenario_hash(with_spares(plain, 0)) == scenario_hash(plain) != scenario_hash(spared)
    listed = load_scenario({**YARDS, "robots": [{}, {"name": "extra", "spare": True}]})
    assert listed.spares == {2}
    with pytest.raises(BadInput, match=r"^--spare 1: scenario lists its robots; mark those that are to join as spare"):
        with_spares(load_scenario({**YARDS, "name": "scenario", "robots": [{}]}), 1)


@pytest.mark.parametrize(
    ("robots", "problem"),
    [
        ({"count": 64_999, "spare": 2}, "there may be 65000 robots in all; give at most 1"),
        ([{"spare": True}], "all robots are spare, so none patrols; leave spare out for one"),
        ({"spare": -1}, "expected a whole number from 0 to 65000"),
        ({"count": 1, "spare": 1, "starts": [[1, 1], [2, 2], [3, 3]]}, "3 starts for 2 robots"),
        ({"count": 2, "spare": 2}, "there are 2 robots; give at most 2"),
    ],
)
def test_spare_robots_that_cannot_be_or_be_meant(robots: Any, problem: str) -> None:
    fault = {"kind": "kill", "at": 1, "who": {"count": 3}}
    with pytest.raises(BadInput, match=problem):
        load_scenario({**YARDS, "robots": robots, "faults": [fault]})


def test_a_robot_must_not_leap_over_what_it_should_see() -> None:
    """Discs of sight that do not touch leave ground between them unseen."""
    load_scenario({**YARDS, "step": 0.5, "robots": {"speed": 40}, "sensor": {"range": 10}})
    leaping = r"robots\.speed = 40\.2: a stride of 20\.1 m leaps over ground .* of 10 m never sees; give at most 40,"
    with pytest.raises(BadInput, match=leaping):
        load_scenario({**YARDS, "step": 0.5, "robots": {"speed": 40.2}, "sensor": {"range": 10}})
    with pytest.raises(BadInput, match=r"robots\.1\.speed = 4\.4: a stride of 6\.6 m .* give at most 4, a shorter"):
        load_scenario({**YARDS, "step": 1.5, "robots": [{"speed": 1}, {"speed": 4.4}], "sensor": {"range": 3}})


def test_paths_are_relative_to_the_file_and_absolute_once_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "a.yaml", "terrain: {map: maps/hall.yaml}\nradio: {key: fleet.key}")
    monkeypatch.chdir(tmp_path.parent)
    scenario = load_scenario(Path(tmp_path.name) / path.name)
    assert scenario.terrain.map == str(tmp_path / "maps/hall.yaml")
    assert scenario.radio.key == str(tmp_path / "fleet.key")
    monkeypatch.chdir(tmp_path)
    assert load_scenario({"terrain": {"map": "maps/hall.yaml"}}).terrain.map == scenario.terrain.map


@pytest.mark.parametrize(("pace", "factor"), [("lockstep", None), ("realtime", 1.0), (2, 2.0), (0.5, 0.5)])
def test_a_pace_is_lockstep_or_a_factor(pace: object, factor: float | None) -> None:
    assert load_scenario({**YARDS, "pace": pace}).factor == factor


def test_neither_a_scenario_nor_the_mapping_that_was_read_changes() -> None:
    scenario = load_scenario(YARDS)
    with pytest.raises(ValidationError):
        scenario.seed = 3  # type: ignore[misc]
    assert load_scenario(as_mapping(scenario)) == scenario
    assert hash(scenario) == hash(load_scenario(YARDS))
    raw = {"terrain": {"builtin": "yards"}, "robots": [{"speed": 1}]}
    before = json.dumps(raw)
    load_scenario(raw, {"robots.0.speed": "2", "patrol.goal_distance": 3})
    assert json.dumps(raw) == before


def test_overrides_are_yaml_and_replace_single_fields() -> None:
    given = {"patrol.contact_memory": "0", "sensor.range": "12", "robots.count": "3", "radio.forget_after": 7.5}
    raw = {**YARDS, "robots": {"count": 5, "speed": 2}, "sensor": {"range": 20}}
    scenario = load_scenario(raw, {**given, "pace": "realtime"})
    assert (scenario.patrol.contact_memory, scenario.sensor.range, scenario.pace) == (0.0, 12.0, "realtime")
    assert [spec.speed for spec in scenario.roster] == [2.0, 2.0, 2.0]
    assert scenario.radio.forget_after == 7.5
    given = {"robots.starts": "[[1, 2], [3, 4, 0]]", "sensor": "{range: 5, line_of_sight: false}"}
    scenario = load_scenario(YARDS, {**given, "patrol.goal_distance": "4e0"})
    assert [spec.start for spec in scenario.roster][:2] == [Pose(1, 2, 0), Pose(3, 4, 0)]
    assert (scenario.sensor.range, scenario.sensor.line_of_sight, scenario.patrol.goal_distance) == (5.0, False, 4.0)


def test_overrides_reach_one_entry_of_a_list_or_all() -> None:
    raw = {**YARDS, "robots": [{"name": "a"}, {"name": "b"}]}
    assert [spec.speed for spec in load_scenario(raw, {"robots.0.speed": "2"}).roster] == [2.0, 4.4]
    assert [spec.speed for spec in load_scenario(raw, {"robots.speed": "2"}).roster] == [2.0, 2.0]
    assert [spec.name for spec in load_scenario(raw, {"robots.1": "{name: c}"}).roster] == ["a", "c"]
    later = load_scenario(raw, {"robots.speed": "2", "robots.1.speed": "3"})
    assert [spec.speed for spec in later.roster] == [2.0, 3.0]


def test_settings_of_the_command_line_become_overrides() -> None:
    settings = ["a.b=1", "c = x=y", "d=", "a.b=2"]
    assert list(parse_overrides(settings).items()) == [("c", " x=y"), ("d", ""), ("a.b", "2")]
    for wrong in ("a.b", "=1", ""):
        with pytest.raises(BadInput, match="expected FIELD=VALUE"):
            parse_overrides([wrong])


def test_a_builtin_a_map_and_a_scenario_can_be_opened(tmp_path: Path) -> None:
    assert open_scenario("yards", {"seed": "3"}) == load_scenario({**YARDS, "seed": 3})
    hall = write_map(tmp_path)
    assert open_scenario(str(hall)).terrain.map == str(hall)
    assert open_scenario(str(hall)).name == "hall"
    path = write(tmp_path / "mine.yaml", "terrain: {map: hall.yaml}")
    assert open_scenario(str(path)).terrain.map == str(hall)


def test_what_cannot_be_opened_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"yrads: no such scenario or map file.*did you mean yards\?"):
        open_scenario("yrads")
    with pytest.raises(BadInput, match="is an image; give the map's YAML"):
        open_scenario(str(tmp_path / "hall.pbm"))
    with pytest.raises(BadInput, match="is a folder"):
        open_scenario(str(tmp_path))
    file = write(tmp_path / "many.yaml", "base: {terrain: {builtin: open}}\ngrid: {seed: [1, 2]}\n")
    with pytest.raises(BadInput, match=f"{file}: is a sweep of many runs; make them with: fogwatch sweep {file}"):
        open_scenario(str(file))


def test_a_map_that_is_not_there_is_named_with_the_line_that_names_it(tmp_path: Path) -> None:
    path = write(tmp_path / "mine.yaml", "duration: 20\nterrain: {map: hall.yaml}")
    named = r"mine.yaml: line 2: terrain.map = .*hall.yaml: no such file; a path is relative"
    with pytest.raises(BadInput, match=named):
        open_scenario(str(path))
    with pytest.raises(BadInput, match=r"^override: terrain.map = .*other.yaml: no such file"):
        open_scenario(str(path), {"terrain.map": "other.yaml"})


@pytest.mark.parametrize(("angle", "degrees"), [(6.28, 360), (3.1416, 180), (1.57, 90)])
def test_an_angle_in_radians_is_refused(angle: float, degrees: int) -> None:
    with pytest.raises(BadInput, match=f"sensor.angle = .*: is {degrees} degrees in radians.*; give {degrees}, or"):
        load_scenario({**YARDS, "sensor": {"angle": angle}})
    assert load_scenario({**YARDS, "sensor": {"angle": round(angle, 1)}}).sensor.angle == round(angle, 1)


LONG = {
    **YARDS,
    "name": "1e3",
    "pace": 2,
    "robots": [{"name": "on", "start": [1, 2.5]}, {"name": "007", "radius": 0.3, "model": "holonomic"}],
    "sensor": {"quality": [[1, 1], [10, 0.25]]},
    "radio": {"key": "keys/a fleet: #1 'ä'.key"},
}
LONG["terrain"] = {"builtin": "site", "keep_out": [[[0, 0], [1.5, 0], [0, 1e-7]]]}


@pytest.mark.parametrize("raw", [YARDS, LONG, {"terrain": {"map": "~/maps/a b.yaml"}, "robots": {"starts": [[1, 2]]}}])
def test_a_dump_loads_back_equal(raw: dict[str, Any], tmp_path: Path) -> None:
    scenario = load_scenario(raw)
    assert load_scenario(yaml.safe_load(dump_scenario(scenario))) == scenario, "any YAML reader reads the same"
    for n, text in enumerate((dump_scenario(scenario), json.dumps(as_mapping(scenario)))):
        assert load_scenario(write(tmp_path / f"{n}.yaml", text)) == scenario
    assert dump_scenario(load_scenario(tmp_path / "0.yaml")) == dump_scenario(scenario)


@pytest.mark.parametrize("strange", ["\u202e", "\u200b", "\x85", "\x9b2J", "\u2028", "\ufeff"])
def test_a_dump_shows_no_character_that_a_terminal_acts_on(strange: str, tmp_path: Path) -> None:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "radio": {"key": f"/caf\xe9/{strange}fleet.key"}})
    dump = dump_scenario(scenario)
    assert all(line.isprintable() for line in dump.split("\n"))
    assert load_scenario(write(tmp_path / "dump.yaml", dump)) == scenario
    plain = load_scenario({"terrain": {"builtin": "open"}, "radio": {"key": "/caf\xe9/fleet.key"}})
    assert "/caf\xe9/fleet.key" in dump_scenario(plain)


def test_a_dump_has_one_field_a_line_with_its_unit() -> None:
    lines = dump_scenario(load_scenario(LONG, {"patrol.policy": "potential-field"})).splitlines()
    assert "point: 0.1                       # m, side of one point of the grid" in lines
    spreads = "m, how far staleness spreads; 0: not at all; auto: 5 radii"
    assert f"    dilatation: auto             # {spreads}; here 5 for on, 1.5 for 007" in lines
    robot = "  - {model: car, speed: 4.4, radius: 1.0, turning_radius: 3.5, name: 'on', "
    assert any(line.startswith(robot) for line in lines)


def test_the_schema_knows_every_field_and_its_unit() -> None:
    schema = scenario_schema()
    assert set(schema["properties"]) == set(Scenario.model_fields)
    assert schema["required"] == ["terrain"]
    assert schema["additionalProperties"] is False
    for definition in [schema, *schema["$defs"].values()]:
        assert all(field.get("description") for field in definition["properties"].values())
    json.dumps(schema, allow_nan=False)


def test_the_hash_is_of_the_meaning(tmp_path: Path) -> None:
    reference = scenario_hash(load_scenario(write(tmp_path / "five.yaml", DESIGNED)))
    backwards = "\n".join(reversed(["seed: 7", "point: 0.10", "terrain:\n  builtin: yards", "name: other"]))
    assert scenario_hash(load_scenario(write(tmp_path / "other.yaml", backwards))) == reference
    assert scenario_hash(load_scenario({**YARDS, "robots": [{}] * 5})) == reference
    assert scenario_hash(load_scenario({**YARDS, "robots": [{"name": f"r{n}"} for n in range(1, 6)]})) == reference


@pytest.mark.parametrize(
    "field",
    [
        *("seed=8", "point=0.2", "pace=realtime", "robots.count=4", "robots.starts=[[1,2]]", "radio.key=a"),
        "patrol.options.unpredictability=0",
    ],
)
def test_the_hash_changes_with_the_meaning(field: str) -> None:
    assert scenario_hash(load_scenario(YARDS, parse_overrides([field]))) != scenario_hash(load_scenario(YARDS))


def test_a_map_enters_the_hash_by_its_content(tmp_path: Path) -> None:
    def digest(**other: Any) -> str:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        return scenario_hash(open_scenario(str(write_map(folder, **other))))

    reference = digest()
    assert digest() == reference
    assert digest(origin="[0.0, 0.0, 0]") == reference
    assert digest(origin="[1, 0, 0]") != reference
    assert digest(pixels=b"\x00" + b"\xff" * 15) != reference


def test_without_its_map_a_scenario_has_no_hash(tmp_path: Path) -> None:
    hall = write_map(tmp_path)
    scenario = open_scenario(str(hall))
    (tmp_path / "hall.pgm").unlink()
    with pytest.raises(BadInput, match=r"hall\.yaml: image = .*hall\.pgm: cannot be read"):
        scenario_hash(scenario)
    hall.unlink()
    with pytest.raises(BadInput, match=r"hall\.yaml: no such file"):
        scenario_hash(scenario)


@pytest.mark.processes
def test_the_hash_is_the_same_in_another_process() -> None:
    code = "from patrol.scenario import *; print(scenario_hash(load_scenario({'terrain': {'builtin': 'yards'}})))"
    env = {**os.environ, "PYTHONHASHSEED": "12345"}
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert told.stdout.strip() == scenario_hash(load_scenario(YARDS))


@pytest.mark.parametrize(
    "options",
    [
        {"claim_width": 0.5, "separation": "none"},
        {"claim_width": 0.5, "separation": ["semaphores", "claims"]},
        {"length": 500.0, "distance": "g5"},
        {"obstacle_radius": 5.0, "fuzzy_distance": 5.5, "critical_width": 8.0},
    ],
)
def test_a_setting_stands_beside_its_switch_or_among_lengths(options: dict[str, Any]) -> None:
    """A run folder's file states every setting, so one without effect is accepted beside its switch."""
    patrol = {"policy": "potential-field", "options": options}
    scenario = load_scenario({"terrain": {"builtin": "open"}, "patrol": patrol})
    assert load_scenario(as_mapping(scenario)) == scenario
