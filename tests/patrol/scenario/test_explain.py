from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput, NotPrepared
from patrol.scenario import Scenario, as_mapping, load_scenario, naming

YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}}
OPEN = {"builtin": "open"}
PAPER = {"policy": "potential-field"}
POST = {"vertices": [[1, 1]]}
AREA = [[1, 1], [2, 1], [2, 2]]


def problem(raw: dict[str, Any], overrides: dict[str, object] | None = None) -> str:
    with pytest.raises(BadInput) as caught:
        load_scenario(raw, overrides)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), -1, 0, True, "1", None, [1], 10**400])
@pytest.mark.parametrize(
    "field",
    [
        *("point", "step", "duration", "watchdog", "pace", "sensor.range", "sensor.angle", "sensor.quality"),
        *(f"robots.{name}" for name in ("speed", "radius", "turning_radius", "count")),
        *(f"patrol.options.{name}" for name in ("alpha", "beta", "length")),
        *(f"patrol.{name}" for name in ("goal_distance", "refine_side", "refine_reach")),
        "radio.forget_after",
    ],
)
def test_what_must_be_above_zero_is_a_number_above_zero(field: str, value: object) -> None:
    raw: Any = value
    for key in reversed(field.split(".")):
        raw = {key: raw}
    if "options" in raw.get("patrol", {}):
        raw["patrol"]["policy"] = "potential-field"
    message = problem({**YARDS, **raw})
    assert message.startswith(f"scenario: {field}")
    assert " = " in message
    assert "expected" in message


@pytest.mark.parametrize(
    "field",
    ["seed", "patrol.options.dilatation", "patrol.options.random_move", "patrol.options.tolerance", "radio.trail"],
)
def test_what_may_be_zero_is_never_negative(field: str) -> None:
    raw = {**YARDS, "patrol": {"policy": "potential-field"}}
    load_scenario(raw, {field: 0})
    for value in (-1, float("nan"), True, "'0'", None):
        assert problem(raw, {field: value}).startswith(f"override {field} = ")


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        ({"dilation": 1}, "dilation: unknown key; did you mean patrol.options.dilatation?"),
        ({"terain": {}}, "terain: unknown key; did you mean terrain?"),
        ({"patrol": {"dilation": 1}}, "patrol.dilation: unknown key; did you mean patrol.options.dilatation?"),
        ({"dilatation": 1}, "dilatation: unknown key; did you mean patrol.options.dilatation?"),
        ({"sensor": {"seed": 1}}, "sensor.seed: unknown key; did you mean seed at the top level?"),
        ({"robots": {"name": "x"}}, "robots.name: unknown key; did you mean name at the top level?"),
        ({"robots": [{}, {"sped": 1}]}, "robots.1.sped: unknown key; did you mean speed?"),
        ({"zones": [{"rect": 1, "mark": 1}]}, "zones.0.rect: unknown key; known are name, polygon, mask, keep_out"),
        ({"zones": [{"rect": 1, "one_way": 1}]}, "zones.0.one_way: one-way zones are gone; drop it"),
        ({"qqqqq": 1}, "qqqqq: unknown key; known are name, terrain, point"),
        ({7: 1}, "7: unknown key"),
        ({"terrain": {}}, "terrain: exactly one is needed: {builtin: NAME} or {map: FILE.yaml}"),
        ({"terrain": {"builtin": "open", "map": "a.yaml"}}, "terrain: exactly one is needed"),
        ({"terrain": None}, "terrain = null: expected keys and values (builtin, map, graph, patrolled,"),
        ({"terrain": {"builtin": "yard"}}, 'terrain.builtin = "yard": expected open, yards, clutter or site; did you'),
        ({"terrain": {"map": "a\nb"}}, "terrain.map"),
        ({"terrain": {**OPEN, "graph": 3}}, "terrain.graph = 3: expected keys and values (vertices,"),
        ({"terrain": {**OPEN, "graph": {**POST, "vist": 1}}}, "terrain.graph.vist: unknown key; did you mean visit?"),
        ({"terrain": {**OPEN, "graph": {"file": 3}}}, "terrain.graph: expected FILE.graph, {file:"),
        (
            {"terrain": {**OPEN, "graph": {**POST, "file": "a.graph"}}},
            "terrain.graph: expected FILE.graph, {file: FILE.graph, visit: M}, or vertices and edges without",
        ),
        ({"terrain": {**OPEN, "keep_out": [[[0, 0], [1, 1]]]}}, "terrain.keep_out.0"),
        ({"terrain": {**OPEN, "keep_out": [[[0, 0], [1, 1], [2]]]}}, "terrain.keep_out.0.2 = [2]"),
        ({"robots": 3}, "robots = 3: expected a group of equal robots, {count: 5, model: car, ...}, or a list"),
        ({"robots": []}, "robots = []: expected 1 or more robots"),
        ({"robots": [3]}, "robots.0 = 3: expected keys and values (model, speed"),
        ({"robots": {"count": 65_001}}, "robots.count = 65001: expected a whole number from 1 to 65000"),
        ({"robots": {"count": 3.0}}, "robots.count = 3.0: expected a whole number"),
        ({"robots": {"model": "bike"}}, 'robots.model = "bike": expected car, differential or holonomic'),
        ({"robots": [{}, {"speed": 0}]}, "robots.1.speed = 0: expected a number above 0"),
        ({"robots": {"starts": [[1, 2], [3]]}}, "robots.starts.1 = [3]: expected [x, y] in m or [x, y, heading]"),
        ({"robots": {"starts": [[1, float("nan")]]}}, "robots.starts.0"),
        ({"robots": {"starts": "here"}}, 'robots.starts = "here": expected random or a list of [x, y]'),
        ({"robots": {"count": 1, "starts": [[1, 2]] * 2}}, "robots.starts: 2 starts for 1 robots"),
        ({"robots": [{"start": [1]}]}, "robots.0.start = [1]: expected random, [x, y] in m"),
        ({"robots": [{"name": "a/b"}]}, 'robots.0.name = "a/b": expected text of at most 32 letters'),
        ({"robots": [{"name": "r2"}, {}]}, "robots.1.name: robot 1 has the name r2 too; rename one"),
        ({"name": "../x"}, 'name = "../x": expected text of at most 64 letters'),
        ({"sensor": {"angle": 361}}, "sensor.angle = 361: expected a number above 0 and at most 360"),
        ({"sensor": {"line_of_sight": 1}}, "sensor.line_of_sight = 1: expected true or false"),
        ({"sensor": {"quality": 1.5}}, "sensor.quality = 1.5: expected a number above 0 and at most 1, or a list"),
        ({"sensor": {"quality": []}}, "sensor.quality = []: expected 1 or more points"),
        ({"sensor": {"quality": [[1, 0.5], [2, 0]]}}, "sensor.quality.1 = [2, 0]: expected [distance in m,"),
        (
            {"sensor": {"quality": [[1, 1], [1, 1]]}},
            "sensor.quality = [[1, 1], [1, 1]]: expected distances that increase along the list",
        ),
        (
            {"patrol": {"policy": "my policy"}},
            'patrol.policy = "my policy": expected committed, potential-field, package.module',
        ),
        ({"patrol": {"options": 3}}, "patrol.options = 3: expected keys and values (separation, obstacle_radius"),
        ({"patrol": {"refine_side": 12}}, "patrol.refine_side = 12: the square must not reach behind the robot"),
        ({"patrol": 3}, "patrol = 3: expected keys and values (policy, policy_sha256, options, avoidance"),
        ({"radio": {"trail": 5}}, "radio.trail = 5: expected a whole number from 0 to 4"),
        ({"radio": {"trail": 1}, "robots": {"speed": 700}}, "robots.speed = 700: a trail holds steps below"),
        ({"faults": [{"kind": "kill"}]}, "faults.0.who: missing; give a robot's name, a list of names, one"),
        ({"faults": [{"kind": "kill", "who": "r1", "time": 30}]}, "faults.0.time: unknown key; did you mean at?"),
        ({"zones": [{"polygon": AREA, "weight": 3}]}, "zones.0.name: missing; give the zone's name"),
        ({"duration": 0.4}, "duration = 0.4: shorter than one step of 0.5 s"),
        ({"duration": 5e6}, "duration = 5e+06: too long: at most 4294967 s"),
        ({"step": 1e-7}, "duration = 5000: too long"),
        ({"step": 3}, "watchdog = 2: shorter than one step of 3 s"),
        ({"radio": {"forget_after": 0.4}}, "radio.forget_after = 0.4: shorter than one step"),
        ({"point": 11}, "sensor.range = 10: shorter than one point of 11 m"),
        ({"seed": 2**63}, "seed = 9223372036854775808: expected a whole number from 0 to 2^63 - 1"),
        ({"terrain": {"builtin": "open"}, "=ame": "hall"}, "=ame: unknown key; did you mean name?"),
    ],
)
def test_a_wrong_scenario_is_told_in_one_line(raw: dict[str, Any], expected: str) -> None:
    assert problem({**YARDS, **raw}).startswith(f"scenario: {expected}")


@pytest.mark.parametrize(
    ("policy", "options", "expected"),
    [
        (PAPER, {"paths": "region"}, ' = "region": expected wave, straight or regions; did you mean regions?'),
        (PAPER, {"fow": "f6"}, ' = "f6": expected f1, f2, f3, f4 or f5'),
        (PAPER, {"random_move": 1.1}, " = 1.1: expected a number from 0 to 1"),
        (PAPER, {"alpah": 2}, ": unknown key; did you mean alpha?"),
        (PAPER, {"claim_width": 0.5}, ": has no effect unless separation is claims; set that as well"),
        (PAPER, {"length": 500}, ": has no effect unless distance is g3 or g5; set that as well"),
        ({}, {"critical_areas": [AREA]}, ": has no effect unless separation is semaphores; set that as well"),
        ({}, {"dilatation": 2}, ": does nothing for the policy stochastic; leave it out, or set p"),
        (
            {},
            {"separation": ["claims", "repulsion"]},
            ": repulsion changes sums of forces, which only potential-field has; ch",
        ),
    ],
)
def test_a_wrong_option_is_told_in_one_line(policy: dict[str, str], options: dict[str, Any], expected: str) -> None:
    (field,) = options
    line = problem({**YARDS, "patrol": {**policy, "options": options}})
    assert line.startswith(f"scenario: patrol.options.{field}{expected}")


def test_a_missing_terrain_is_told_and_a_number_with_its_unit() -> None:
    missing = "scenario: terrain: missing; give {builtin: open | yards | clutter | site} or {map: FILE.yaml}"
    assert problem({}) == missing
    line = "scenario: sensor.range = -1: expected a number above 0 and at most 1e9 (m, range of view)"
    assert problem({**YARDS, "sensor": {"range": -1}}) == line


def test_further_problems_are_counted_and_unknown_keys_come_first() -> None:
    message = problem({**YARDS, "point": -1, "sensor": {"range": 0}, "patrol": {"x": 1}})
    assert message.startswith("scenario: patrol.x: unknown key;")
    assert message.endswith("(and 2 more problems)")


def test_a_list_that_holds_itself_is_refused() -> None:
    endless: list[Any] = []
    endless.append(endless)
    for field in ("terrain", "robots", "faults", "point"):
        problem({**YARDS, field: endless})


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
sections = st.sampled_from([*Scenario.model_fields])


@given(st.dictionaries(sections, plain, max_size=4))
def test_no_mapping_raises_anything_but_bad_input(raw: dict[str, Any]) -> None:
    try:
        scenario = load_scenario({**YARDS, **raw})
    except BadInput:
        return
    assert load_scenario(as_mapping(scenario)) == scenario


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("patrol.dilation", "1", "patrol.dilation: unknown key; did you mean patrol.options.dilatation?"),
        ("patrol.options.unpredictability", "-1", "patrol.options.unpredictability = -1: expected a number from"),
        ("sensor", "{range: -1}", "sensor.range = -1: expected"),
        ("patrol", "3", "patrol = 3: expected keys and values"),
        ("sensor.range", "[", "sensor.range: line 1, column 2"),
        ("sensor.range", "", "sensor.range = null: expected a number"),
        ("robots.0.speed", "2", "robots.0.speed: not a list, so there is no entry 0; leave .0 out"),
        ("point.x", "2", "point.x: 0.1 has no field x; leave .x out"),
        ("", "2", "'': is not a field"),
        ("patrol..alpha", "2", "'patrol..alpha': is not a field"),
        ("faults", "[1]", "faults.0: expected a fault such as {kind: kill, at: 60, who: one}"),
        ("terrain.map", "a.yaml", "terrain: exactly one is needed"),
    ],
)
def test_a_wrong_override_is_named(field: str, value: str, expected: str) -> None:
    assert problem({**YARDS, "point": 0.1}, {field: value}).startswith(f"override {expected}")


@pytest.mark.parametrize(
    ("field", "expected"),
    [
        ("robots.2.speed", "robots.2.speed: there is no entry 2; the list has entries 0 to 1"),
        ("robots.1.speed", "robots.1.speed = -2: expected a number above 0 and at most 1e9 (m/s, top speed)"),
        ("robots.speed", "robots.0.speed = -2: expected a number above 0 and at most 1e9"),
        ("robots.count", "robots.count: the scenario lists its 2 robots; add or remove entries there"),
        ("robots.wheels", "robots.wheels: this is a list of 2; give an index, 0 to 1"),
    ],
)
def test_a_wrong_override_of_a_list_is_named(field: str, expected: str) -> None:
    assert problem({**YARDS, "robots": [{}, {}]}, {field: "-2"}).startswith(f"override {expected}")


@pytest.mark.parametrize(
    ("source", "overridden", "text", "named"),
    [
        ("site.yaml", (), "zones.0: vault lies outside", True),
        ("site.yaml", ("robots.count",), "zones.0: vault lies outside", True),
        ("site.yaml", ("zones",), "zones.0: vault lies outside", False),
        ("site.yaml", ("robots.starts",), "robots: start (5, 5) of r1: overlaps", False),
        ("yards", (), "zones.0: vault lies outside", False),
        ("plan.yaml", (), "/maps/plan.yaml: image: missing", False),
    ],
)
def test_an_error_of_preparing_names_the_file_that_gave_the_field(
    source: str, overridden: tuple[str, ...], text: str, named: bool
) -> None:
    with pytest.raises(BadInput) as caught, naming(source, overridden):
        raise NotPrepared(text)
    assert str(caught.value) == (f"{source}: {text}" if named else text)


def test_other_errors_name_no_scenario() -> None:
    with pytest.raises(BadInput, match=r"^--out run: is not empty$"), naming("site.yaml"):
        raise BadInput("--out run: is not empty")
