"""Sweep files: what is to be run, and what is wrong with them."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from experiments.sweeps.plan import Plan, read_plan
from patrol.errors import BadInput
from patrol.scenario import as_mapping

ROBOTS, PATROL = {"count": 2, "model": "holonomic"}, {"policy": "potential-field"}
BASE = {"terrain": {"builtin": "open"}, "point": 1, "duration": 20, "robots": ROBOTS, "patrol": PATROL}


def plan(folder: Path, told: int | None = None, **says: Any) -> Plan:
    file = folder / "trial.yaml"
    file.write_text(yaml.safe_dump({"base": BASE, **says}, sort_keys=False))
    return read_plan(file, told)


def names(found: Plan) -> list[str]:
    return [case.name for case in found.cases]


def test_a_grid_is_every_combination_with_every_seed(tmp_path: Path) -> None:
    found = plan(tmp_path, grid={"patrol.goal_distance": [6, 8], "robots.count": [1, 2, 3]}, seeds=2)
    assert found.name == "trial"
    assert names(found)[:4] == [f"goal_distance={d} count={n}" for d, n in ((6, 1), (6, 2), (6, 3), (8, 1))]
    assert len(found.runs) == 12
    assert len({run.key for run in found.runs}) == 12
    last = found.runs[-1].scenario
    assert (last.patrol.goal_distance, len(last.roster), last.seed) == (8.0, 3, 2)


def test_cases_go_over_the_grid(tmp_path: Path) -> None:
    near = {"name": "near", "set": {"sensor.range": 5, "patrol.options.fow": "f2"}}
    cases = [{"name": "far", "set": {"sensor.range": 20}}, near]
    found = plan(tmp_path, cases=cases, grid={"patrol.options.direction": ["mode", "vector"]}, seeds=[4, 9])
    assert names(found) == [f"{name} direction={by}" for name in ("far", "near") for by in ("mode", "vector")]
    assert found.seeds == (4, 9)
    runs = found.runs_of("near direction=vector")
    assert [as_mapping(run.scenario)["patrol"]["options"]["fow"] for run in runs] == ["f2"] * 2


def test_fields_that_end_alike_keep_their_whole_names(tmp_path: Path) -> None:
    found = plan(tmp_path, grid={"robots.speed": [1], "robots.radius": [0.5], "terrain.keep_out": [[]]})
    assert names(found) == ["speed=1 radius=0.5 keep_out=[]"]
    robots = [{"model": "car"}, {"model": "car"}]
    found = plan(tmp_path, base={**BASE, "robots": robots}, grid={"robots.0.speed": [1], "robots.1.speed": [2]})
    assert names(found) == ["robots.0.speed=1 robots.1.speed=2"]


def test_cases_are_compared_with_the_ones_that_differ_in_one_thing(tmp_path: Path) -> None:
    grid = {"patrol.options.dilatation": [0, 2, 5], "robots.count": [1, 2]}
    found = plan(tmp_path, grid=grid, against={"patrol.options.dilatation": 0})
    partners = {case.name: other.name if (other := found.partner(case)) else None for case in found.cases}
    pairs = [(d, n) for d in (0, 2, 5) for n in (1, 2)]
    assert partners == {f"dilatation={d} count={n}": f"dilatation=0 count={n}" if d else None for d, n in pairs}


def test_the_base_as_it_is_is_compared_by_what_it_means(tmp_path: Path) -> None:
    cases = [{"name": "default", "set": {}}, {"name": "two", "set": {"patrol.options.dilatation": 2}}]
    base = {**BASE, "patrol": {"policy": "potential-field", "options": {"dilatation": 0}}}
    found = plan(tmp_path, base=base, cases=cases, against={"patrol.options.dilatation": 0})
    assert found.partners == {"two": "default"}


def test_values_of_a_grid_may_have_labels_and_against_may_name_one(tmp_path: Path) -> None:
    loss = [{"kind": "loss", "rate": 0.5}]
    faults = [{"label": "no fault", "value": []}, {"label": "half lost", "value": loss}]
    found = plan(tmp_path, grid={"robots.count": [1, 2], "faults": faults}, against={"faults": "no fault"})
    assert names(found) == [f"count={n} {label}" for n in (1, 2) for label in ("no fault", "half lost")]
    assert found.cases[1].settings == {"robots.count": 1, "faults": loss}
    assert [(label.title, label.text) for label in found.cases[1].labels] == [("count", "1"), ("faults", "half lost")]
    assert found.partners == {f"count={n} half lost": f"count={n} no fault" for n in (1, 2)}


def test_cases_may_be_compared_with_a_named_one_on_the_same_grid_values(tmp_path: Path) -> None:
    cases = [{"name": name, "set": {"patrol.options.fow": name}} for name in ("f1", "f2", "f3")]
    found = plan(tmp_path, cases=cases, grid={"robots.count": [1, 2]}, against={"case": "f1"})
    assert found.partners == {f"{name} count={n}": f"f1 count={n}" for n in (1, 2) for name in ("f2", "f3")}
    alone = plan(tmp_path, grid={"robots.count": [1, 2, 3]}, against={"case": "count=2"})
    assert alone.partners == {"count=1": "count=2", "count=3": "count=2"}


def test_a_case_without_a_partner_is_named(tmp_path: Path) -> None:
    cases = [
        {"name": "plain", "set": {"patrol.options.dilatation": 0}},
        {"name": "wide", "set": {"patrol.options.dilatation": 2}},
        {"name": "far", "set": {"patrol.options.dilatation": 2, "sensor.range": 20}},
    ]
    found = plan(tmp_path, cases=cases, against={"patrol.options.dilatation": 0})
    assert (found.partners, found.unpaired) == ({"wide": "plain"}, ("far",))


def test_a_base_that_is_not_there_is_named_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"trial.yaml: line \d: base = nowhere.yaml: no such file"):
        plan(tmp_path, base="nowhere.yaml")
    with pytest.raises(BadInput, match=r"base: terrain.map = .*nowhere.yaml: no such file"):
        plan(tmp_path, base={"terrain": {"map": "nowhere.yaml"}})


def test_without_grid_and_cases_there_is_the_base_alone(tmp_path: Path) -> None:
    found = plan(tmp_path, base={**BASE, "seed": 12})
    assert names(found) == ["base"]
    assert [run.seed for run in found.runs] == [12]
    assert [run.seed for run in plan(tmp_path, seeds=3).runs] == [1, 2, 3]


def test_the_base_may_be_a_file_with_paths_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "key.txt").write_text("secret enough")
    (tmp_path / "there" / "base.yaml").write_text(yaml.safe_dump({**BASE, "radio": {"key": "key.txt"}}))
    found = plan(tmp_path, base="there/base.yaml", seeds=1)
    assert found.runs[0].scenario.name == "base"
    assert found.runs[0].scenario.radio.key == str(tmp_path / "there" / "key.txt")


def test_the_key_is_what_a_run_means(tmp_path: Path) -> None:
    one = plan(tmp_path, cases=[{"name": "a", "set": {"patrol.options.sectors": 8}}], seeds=2)
    same = plan(tmp_path, cases=[{"name": "b", "set": {"patrol.options.sectors": 8}}], seeds=[2, 1])
    other = plan(tmp_path, cases=[{"name": "a", "set": {"patrol.options.sectors": 9}}], seeds=2)
    keys, same_keys, other_keys = ({run.key for run in found.runs} for found in (one, same, other))
    assert keys == same_keys
    assert not keys & other_keys


FOW, POINT_2 = {"patrol.options.fow": "f1"}, {"name": "a", "set": {"point": 2}}


@pytest.mark.parametrize(
    ("says", "problem"),
    [
        ({"grid": {"patrol.dilation": [1]}}, "case dilation=1: override patrol.dilation: unknown key; did you mean"),
        ({"grid": {"patrol.options.fow": ["f1", "f9"]}}, 'case fow=f9: override patrol.options.fow = "f9": expected'),
        ({"grid": {"patrol.options.fow": "f1"}}, 'grid.patrol.options.fow = "f1": expected a list'),
        ({"grid": {"patrol.options.fow": []}}, "grid.patrol.options.fow = []: expected a list"),
        ({"grid": {"patrol.options.fow": ["f1", "f1"]}}, "case fow=f1: occurs 2 times"),
        ({"grid": {"seed": [1, 2]}}, "case seed=1: sets seed; give the seeds under 'seeds:'"),
        ({"grid": [1]}, "grid = [1]: expected"),
        ({"grid": {f"patrol.{name}": list(range(100)) for name in ("alpha", "beta", "length")}}, "1000000 cases"),
        ({"cases": {}}, "cases = {}: expected a list"),
        ({"cases": [{"set": {}}]}, 'cases.0 = {"set": {}}: expected'),
        ({"cases": [{"name": "a", "sets": {}}]}, "cases.0: sets: unknown key; did you mean set?"),
        ({"cases": [{"name": "a", "set": [1]}]}, "cases.0.set = [1]: expected"),
        ({"cases": [POINT_2], "grid": {"point": [1]}}, "point: is set by case a and by"),
        ({"seeds": 0}, "seeds = 0: expected a whole number from 1"),
        ({"seeds": "many"}, 'seeds = "many": expected a count'),
        ({"seeds": [1, 1]}, "seeds: 1 occurs twice"),
        ({"seeds": [-1]}, "seeds = [-1]: expected a count"),
        ({"seeds": True}, "seeds = true: expected a count"),
        ({"against": FOW}, 'trial.yaml: against = {"patrol.options.fow": "f1"}: no two cases differ only in that'),
        (
            {"grid": {"faults": [{"label": "quiet", "value": []}]}, "against": {"faults": "quite"}},
            'trial.yaml: against = {"faults": "quite"}: no case has this faults; did you mean quiet?',
        ),
        ({"cases": [POINT_2], "against": {"point": 9}}, "no case has this point; known are 2"),
        (
            {"cases": [{"name": "a"}], "against": {"patrol.dilation": 0}},
            "override patrol.dilation: unknown key; did you mean patrol.options.dilatation",
        ),
        (
            {"grid": {"patrol.policy": [{"lable": "own", "value": "partition"}]}},
            "trial.yaml: grid.patrol.policy.0: lable: unknown key; did you mean label?",
        ),
        ({"against": ["f1"]}, 'against = ["f1"]: expected {FIELD: VALUE'),
        ({"cases": [{"name": "one"}], "against": {"case": "onee"}}, "no such case; did you mean one?"),
        ({"cases": [POINT_2], "against": {"case": "a", "point": 1}}, "give either case: NAME or fields, not both"),
        ({"grid": {"faults": [{"label": "none"}]}}, 'grid.faults.0 = {"label": "none"}: expected {label: NAME, value:'),
        ({"sedes": 3}, "sedes: unknown key; did you mean seeds?"),
        ({"name": 3}, "name = 3: expected text"),
        ({"base": 3}, "base = 3: expected a scenario's keys"),
        ({"base": {**BASE, "duraton": 3}}, "duraton: unknown key; did you mean duration"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(tmp_path: Path, says: dict[str, Any], problem: str) -> None:
    with pytest.raises(BadInput) as caught:
        plan(tmp_path, **says)
    assert problem in str(caught.value)
    assert "trial.yaml" in str(caught.value)


@pytest.mark.parametrize(("text", "problem"), [("", "no sweep"), ("[1]", "no sweep"), ("base: {", "correct the YAML")])
def test_a_file_that_is_no_sweep_and_a_count_of_no_seeds_are_refused(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "odd.yaml").write_text(text)
    with pytest.raises(BadInput, match=problem):
        read_plan(tmp_path / "odd.yaml")
    with pytest.raises(BadInput, match=r"^seeds = 0: expected"):
        plan(tmp_path, told=0)


def test_the_example_is_a_sweep() -> None:
    found = read_plan(Path(__file__).resolve().parents[3] / "examples" / "sweeps" / "dilatation.yaml")
    assert len(found.runs) == 36
    assert sum(found.partner(case) is not None for case in found.cases) == 9
