"""The runs of the benchmark: conditions are the faults that they say, and texts give the cells."""

import re
import shlex
from pathlib import Path

import pytest

from experiments.benchmark.conditions import ALL, check_condition, condition_of
from experiments.benchmark.matrix import (
    Matrix,
    NamedSettings,
    places_of,
    read_conditions,
    read_policies,
    read_teams,
    read_terrains,
    run_command,
)
from patrol.errors import BadInput
from patrol.scenario import load_scenario, parse_overrides
from worldsim.faults import Timeline


def matrix(**more: object) -> Matrix:
    given = {
        "policies": read_policies("committed,sebs:g2=50"),
        "terrains": read_terrains("open"),
        "teams": (2, 4),
        "conditions": ("none", "loss-50", "deaths"),
        "seeds": (1, 2),
        "duration_s": 600.0,
        "settings": {"point": 2.0, "robots.model": "holonomic"},
    }
    return Matrix(**{**given, **more})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("none", []),
        ("loss-50", [{"kind": "loss", "rate": 0.5}]),
        ("jitter-20", [{"kind": "motion", "who": "all", "jitter": {"size": 0.2, "every": 5.0}}]),
        ("loss-100", [{"kind": "loss", "rate": 1.0}]),
        ("silence", [{"kind": "silence", "who": "all"}]),
        ("spoof", [{"kind": "spoof", "as": "r1", "payload": "random"}]),
        (
            "loss-90+deaths",
            [
                {"kind": "loss", "rate": 0.9},
                {"kind": "kill", "who": "r1", "at": 300.0, "wreck": "removed"},
                {"kind": "kill", "who": "r2", "at": 1100.0, "wreck": "removed"},
            ],
        ),
    ],
)
def test_a_condition_is_its_faults(name: str, faults: list[dict[str, object]]) -> None:
    check_condition(name)
    assert condition_of(name, 5000.0).faults == faults
    assert condition_of(name, 5000.0).add_to({"robots.count": 4}).get("faults", []) == faults


def test_a_condition_may_change_the_sensor() -> None:
    added = condition_of("sector-90+noise-20+loss-4", 600.0).add_to({"robots.count": 4, "sensor.angle": 360})
    assert added["sensor.angle"] == 90
    assert added["faults"] == [{"kind": "drift", "who": "all", "noise": 0.2}, {"kind": "loss", "rate": 0.04}]


def test_jumps_are_as_frequent_in_any_run() -> None:
    first, *_, last = condition_of("jumps", 1200.0).faults
    assert first == {"kind": "drift", "who": "all", "at": 60.0, "for": 5.0, "bias": [0.0, 1.0]}
    assert (last["at"], last["bias"]) == (1140.0, [0.0, -1.0])
    assert not condition_of("jumps", 60.0).faults


@pytest.mark.parametrize("name", ALL)
def test_a_scenario_under_each_condition_is_valid(name: str) -> None:
    one = matrix(policies=read_policies("stochastic"), teams=(4,), conditions=(name,), seeds=(1,))
    (run,), (case,) = one.plan().runs, one.plan().cases
    again = shlex.split(run_command(case, 1))
    overrides = parse_overrides([word for word, before in zip(again[1:], again, strict=False) if before == "--set"])
    assert load_scenario({"terrain": {"builtin": again[2]}}, overrides).roster == run.scenario.roster
    assert len(run.scenario.faults) == len(condition_of(name, 600.0).faults)
    assert len(run.scenario.roster) == (26 if name == "robots-26" else 4)


@pytest.mark.parametrize(
    ("name", "speeds", "models"),
    [
        ("none", [2.0] * 4, "hhhh"),
        ("slower-5", [1.9, 2.0, 2.0, 2.0], "hhhh"),
        ("speeds", [1.0, 1.5, 2.0, 2.5], "hhhh"),
        ("bodies", [2.0] * 4, "hdch"),
        ("slower-50+bodies+robots-2", [1.0, 2.0], "hd"),
        ("loss-4+speeds+slower-10", [0.9, 1.5, 2.0, 2.5], "hhhh"),
    ],
)
def test_robots_need_not_be_alike(name: str, speeds: list[float], models: str) -> None:
    settings = {"robots.speed": "2", "robots.radius": 0.3, "robots.model": "holonomic", "point": 2.0}
    (run,) = (
        matrix(policies=read_policies("cr"), teams=(4,), conditions=(name,), seeds=(1,), settings=settings).plan().runs
    )
    assert [spec.speed for spec in run.scenario.roster] == speeds
    assert "".join(spec.model[0] for spec in run.scenario.roster) == models
    assert {spec.radius for spec in run.scenario.roster} == {0.3}


def test_a_condition_that_says_how_many_robots_is_tried_once() -> None:
    plan = matrix(policies=read_policies("cr"), conditions=("none", "robots-3")).plan()
    assert [(places_of(case)["team"], places_of(case)["condition"]) for case in plan.cases] == [
        ("2", "none"),
        ("3", "robots-3"),
        ("4", "none"),
    ]
    for conditions in ("robots-2+deaths", "robots-1+loss-5"):
        with pytest.raises(BadInput, match=r"needs [23] robots or more; give a larger team or drop"):
            matrix(conditions=(conditions,)).plan()


def test_a_speed_that_is_no_number_is_refused() -> None:
    with pytest.raises(BadInput, match=r"--set robots\.speed=fast: expected a number of m/s"):
        matrix(conditions=("speeds",), settings={"robots.speed": "fast"}).plan()


def test_robots_die_within_a_shorter_run() -> None:
    assert [fault["at"] for fault in condition_of("deaths", 600.0).faults] == [100.0, 366.667]
    (fault,) = condition_of("one-death", 1200.0).faults
    assert (fault["who"], fault["at"], fault["wreck"]) == ("r2", 400.0, "removed")
    one = matrix(policies=(NamedSettings("committed", {}),), teams=(4,), conditions=("deaths",), seeds=(1,))
    (run,) = one.plan().runs
    timeline = Timeline(run.scenario)
    assert run.scenario.ticks == 1200
    assert [bool(timeline.acts(k)) for k in (199, 200, 734)] == [False, True, True]


@pytest.mark.parametrize(
    "name",
    [
        "loss",
        "loss-0",
        "loss-101",
        "loss-5.5",
        "jitter-100",
        "death",
        "none+deaths",
        "deaths+deaths",
        "robots-3+robots-4",
        "",
    ],
)
def test_what_is_no_condition_is_refused(name: str) -> None:
    with pytest.raises(BadInput, match="--conditions"):
        check_condition(name)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("loss-300", "loss-300: expected loss-1 to loss-100, in whole %"),
        ("deaths+jitter-100", "jitter-100: expected jitter-1 to jitter-99, in whole %"),
        ("slower-100", "slower-100: expected slower-1 to slower-99, in whole %"),
        ("delay-61", "delay-61: expected delay-1 to delay-60, in whole s"),
        ("sector-361", "sector-361: expected sector-1 to sector-360, in whole degrees"),
        ("range-0", "range-0: expected range-1 to range-1000, in whole m"),
        ("robots-9999999", "robots-9999999: expected robots-1 to robots-65000, in whole robots"),
        ("burst", "burst: no such condition; did you mean bursts?"),
        ("death", "death: no such condition; did you mean deaths?"),
    ],
)
def test_a_refused_condition_says_what_there_is(name: str, says: str) -> None:
    for most in ("loss-100", "loss-1", "jitter-99"):
        check_condition(most)
    with pytest.raises(BadInput, match=re.escape(f"--conditions {name}: {says}")):
        check_condition(name)


def test_cells_are_all_combinations_that_have_enough_robots() -> None:
    plan = matrix().plan()
    places = [places_of(case) for case in plan.cases]
    tried = {(int(place["team"]), place["condition"]) for place in places}
    assert tried == {(2, "none"), (2, "loss-50"), (4, "none"), (4, "loss-50"), (4, "deaths")}
    assert len(places) == 10
    assert [condition_of(name, 600.0).smallest_team for name in ("none", "spoof", "loss-90+deaths")] == [1, 2, 3]
    assert all(run.games for run in plan.runs)
    assert len({run.key for run in plan.runs}) == 20
    for run, place in zip(plan.runs, [place for place in places for _ in (1, 2)], strict=True):
        assert run.case.startswith(f"{place['policy']} on {place['terrain']}, {place['team']} robots, ")
        assert len(run.scenario.roster) == int(place["team"])
        assert run.scenario.duration == 600.0
        assert len(run.scenario.faults) == {"none": 0, "loss-50": 1, "deaths": 2}[place["condition"]]
    with pytest.raises(BadInput, match=r"\A--teams 1,2: deaths needs 3 robots or more; give a larger team or drop"):
        matrix(teams=(1, 2)).plan()


def test_policies_may_have_options_and_be_classes() -> None:
    found = read_policies("committed, sebs:g2=50:edge_min=2,./mine.py:Mine:near=4")
    assert [policy.name for policy in found] == ["committed", "sebs:g2=50:edge_min=2", "./mine.py:Mine:near=4"]
    assert found[1].settings == {"patrol.policy": "sebs", "patrol.options.g2": "50", "patrol.options.edge_min": "2"}
    assert found[2].settings == {"patrol.policy": "./mine.py:Mine", "patrol.options.near": "4"}


def test_terrains_are_built_in_or_maps_and_may_have_a_graph() -> None:
    found = read_terrains("open,maps/plan.yaml,a/here.graph+a/here.yaml,b/here.yaml,few.graph+yards")
    names = [terrain.name for terrain in found]
    assert names == ["open", "plan", "a/here.graph+a/here.yaml", "b/here.yaml", "few.graph+yards"]
    assert found[1].settings == {"terrain.map": "maps/plan.yaml"}
    assert found[2].settings == {"terrain.map": "a/here.yaml", "terrain.graph": "a/here.graph"}
    assert found[4].settings == {"terrain.builtin": "yards", "terrain.graph": "few.graph"}


@pytest.mark.parametrize(
    ("read", "text", "says"),
    [
        (read_policies, "sebs,sebs", "--policies: sebs occurs 2 times; name it once"),
        (read_policies, "sebs,", "'sebs,': expected names with commas between, such as stochastic,even-tour"),
        (read_policies, "sebs:=3", "--policies sebs:=3: expected NAME or NAME:OPTION=VALUE"),
        (read_policies, "sebs:", "--policies sebs:: expected NAME or NAME:OPTION=VALUE"),
        (read_policies, "g2=3", "--policies g2=3: expected NAME or NAME:OPTION=VALUE"),
        (read_terrains, "opem", "--terrains opem: no such built-in terrain, and no map's YAML file; did you mean open"),
        (read_terrains, "plan.pgm", "or give MAP.yaml or FILE.graph"),
        (read_terrains, "a.graph", "--terrains a.graph: expected a terrain, or a graph and a terrain"),
        (read_terrains, "open+yards", "--terrains open+yards: expected a terrain, or a graph and a terrain"),
        (read_teams, "4,0", "--teams 4,0: 0: expected a number of robots from 1 to"),
        (read_teams, "four", "--teams four: four: expected a number of robots"),
        (read_conditions, "none,deths", "--conditions deths: deths: no such condition; did you mean deaths"),
    ],
)
def test_what_makes_no_sense_is_one_line(read: object, text: str, says: str) -> None:
    with pytest.raises(BadInput, match=r"\A[^\n]+\Z") as error:
        read(text)  # type: ignore[operator]
    assert says in str(error.value).replace('"', "'")


def test_a_map_that_is_missing_is_said(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file"):
        matrix(terrains=read_terrains(str(tmp_path / "gone.yaml")), conditions=("none",)).plan()
