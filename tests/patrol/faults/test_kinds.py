from pathlib import Path
from typing import Any, get_args

import pytest

from patrol.errors import BadInput
from patrol.faults.kinds import FRAME_KINDS, INSTANT, KINDS, PROCESS_KINDS, ActsOn, OneFault, Spoof, Wait
from patrol.faults.targets import TargetField, meant
from patrol.scenario import as_mapping, dump_scenario, load_scenario, parse_overrides, scenario_hash, scenario_schema

GATE = {"name": "gate", "polygon": [[50, 0], [51, 0], [51, 20], [50, 20]]}
YARDS: dict[str, Any] = {
    "terrain": {"builtin": "yards"},
    "robots": {"count": 5},
    "duration": 100,
    "closures": [GATE, {**GATE, "name": "door"}],
}
EVERY_KIND: list[dict[str, Any]] = [
    {"kind": "kill", "who": "one", "at": 10, "wreck": "removed"},
    {"kind": "restart", "who": "r1", "at": 20},
    {"kind": "pause", "who": "minority", "for": 5},
    {"kind": "resume", "who": ["r2", "r1"]},
    {"kind": "join", "who": {"count": 2}, "at": 3},
    {"kind": "leave", "who": {"fraction": 0.3}, "id": "goodbye"},
    {"kind": "loss", "from": "one", "to": "half", "rate": 0.2, "mean_burst": 8},
    {"kind": "delay", "delay": {"normal": [1, 2]}},
    {"kind": "duplicate", "rate": 0.1, "delay": {"constant": 1}},
    {"kind": "reorder", "rate": 0.1},
    {"kind": "partition", "groups": "halves"},
    {"kind": "partition", "groups": [["r1"], ["r2", "r3"]], "direction": "one-way"},
    {"kind": "silence", "who": "all", "direction": "in"},
    {"kind": "range", "reach": 20, "through_walls": False},
    {"kind": "bandwidth", "bytes_per_s": 20},
    {"kind": "spoof", "as": "r3", "by": "r1", "payload": {"offset": [5, 0]}},
    {"kind": "spoof", "payload": "freeze", "for": 3},
    {"kind": "drift", "who": "r1", "jump": {"every": 5, "size": 1}},
    {"kind": "clock", "who": "r1", "rate": 0.01},
    {"kind": "motion", "who": "all", "speed": 0.2, "jitter": {"size": 0.1, "every": 9}, "slip": {"rate": 0.1}},
    {"kind": "close", "closure": "gate", "at": 5},
    {"kind": "open", "closure": "door", "for": 20},
]


def problem(*faults: Any, overrides: dict[str, object] | None = None) -> str:
    with pytest.raises(BadInput) as caught:
        load_scenario({**YARDS, "faults": list(faults)}, overrides)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_fault_after_the_end_is_refused_with_the_duration_that_all_faults_need() -> None:
    at = {"who": "one", "kind": "kill"}, {"who": "one", "kind": "restart"}
    faults = [{**at[0], "at": 20}, {**at[0], "at": 60}, {**at[1], "at": 90}]
    assert problem(*faults, overrides={"duration": 50}).endswith(
        "faults.1.at = 60: the run ends at 50 s, so it would never happen; give an earlier time or a duration above "
        "90, or leave the kill out"
    )
    load_scenario({**YARDS, "faults": faults}, {"duration": 90.5})


def test_every_kind_can_be_said_and_survives_writing(tmp_path: Path) -> None:
    assert {fault["kind"] for fault in EVERY_KIND} == set(KINDS)
    scenario = load_scenario({**YARDS, "faults": EVERY_KIND})
    assert [fault.id for fault in scenario.faults[4:7]] == ["f5", "goodbye", "f7"], "by place unless given"
    assert load_scenario(as_mapping(scenario)) == scenario
    written = tmp_path / "scenario.yaml"
    written.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(written, {"name": scenario.name}) == scenario
    assert scenario_hash(load_scenario(written)) == scenario_hash(scenario)


def test_every_kind_is_in_all_the_lists() -> None:
    chosen = get_args(get_args(OneFault)[0])
    tags = [tag.tag for annotated in chosen for tag in annotated.__metadata__]
    assert tags == [f"={kind}" for kind in KINDS]
    assert [get_args(annotated)[0] for annotated in chosen] == list(KINDS.values())
    assert set(INSTANT) == {"kill", "restart", "resume", "join", "leave"}
    assert set(PROCESS_KINDS) == {*INSTANT, "pause"}
    assert set(KINDS) - {*PROCESS_KINDS, *FRAME_KINDS} == {"drift", "clock", "motion", "close", "open"}
    assert all(fault.acts_on in get_args(ActsOn) for fault in KINDS.values())


def test_faults_change_the_hash() -> None:
    hashes = {scenario_hash(load_scenario({**YARDS, "faults": faults})) for faults in ([], EVERY_KIND[:1], EVERY_KIND)}
    assert len(hashes) == 3


def test_a_wait_tells_its_shape() -> None:
    assert (Wait(constant=1.0).shape, Wait(constant=1.0).values) == ("constant", (1.0,))
    assert (Wait(normal=(1.0, 2.0)).shape, Wait(normal=(1.0, 2.0)).values) == ("normal", (1.0, 2.0))


def test_the_schema_knows_every_kind() -> None:
    schema = scenario_schema()
    listed = schema["properties"]["faults"]["items"]["oneOf"]
    kinds = [schema["$defs"][entry["$ref"].rpartition("/")[2]]["properties"]["kind"]["const"] for entry in listed]
    assert kinds == list(KINDS)
    assert "for" in schema["$defs"]["Pause"]["properties"]
    assert {"from", "to"} <= set(schema["$defs"]["Loss"]["properties"])


def test_faults_can_be_given_as_an_override() -> None:
    settings = parse_overrides(["faults=[{kind: silence, at: 5, who: half, for: 10}, {kind: kill, who: r2}]"])
    scenario = load_scenario(YARDS, settings)
    assert [fault.kind for fault in scenario.faults] == ["silence", "kill"]
    changed = load_scenario(as_mapping(scenario), {"faults.0.at": 7})
    assert changed.faults[0].at == 7.0


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (3, ": expected a fault such as {kind: kill, at: 60, who: one}"),
        ({}, "kind: missing; give one of kill, restart"),
        ({"kind": None}, "kind: missing; give one of kill, restart"),
        ({"kind": "losss"}, "kind: losss is not a kind of fault; did you mean loss?"),
        ({"kind": "xyzzy"}, "kind: xyzzy is not a kind of fault; known are kill, restart"),
        ({"kind": ["kill"]}, "kind: ['kill'] is not a kind of fault"),
        ({"kind": "close"}, "closure: missing; give "),
        ({"kind": "open", "closure": "gat"}, "closure: there is no closure gat; did you mean gate?"),
        ({"kind": "kill"}, "who: missing; give a robot's name, a list of names, one"),
        ({"kind": "kill", "who": "one", "for": 3}, "for: a kill happens at once; leave 'for' out"),
        ({"kind": "kill", "who": "one", "wreck": "goes"}, 'wreck = "goes": expected stays or removed'),
        ({"kind": "kill", "who": "one", "at": -1}, "at = -1: expected a number from 0 to 1e9 (s, when it"),
        ({"kind": "kill", "who": "one", "at": 100}, "at = 100: the run ends at 100 s, so it would never"),
        ({"kind": "kill", "who": "one", "at": 99.8}, "at = 99.8: the run ends at 100 s"),
        ({"kind": "kill", "who": "r9"}, "who: there is no robot r9; robots are r1, r2, r3, r4, r5"),
        ({"kind": "kill", "who": "r12"}, "who: there is no robot r12; did you mean r2?"),
        ({"kind": "kill", "who": ["r1", "r9"]}, "who.1: there is no robot r9"),
        ({"kind": "kill", "who": ["r1", "one"]}, "who.1: there is no robot one"),
        ({"kind": "kill", "who": ["r1", "r1"]}, "who.1: r1 is in the list twice"),
        ({"kind": "kill", "who": []}, "who = []: expected 1 or more names"),
        ({"kind": "kill", "who": 3}, "who = 3: expected a robot's name, a list of names"),
        ({"kind": "kill", "who": {}}, "who: exactly one is needed: {count: N} or {fraction: SHARE}"),
        ({"kind": "kill", "who": {"count": 1, "fraction": 0.5}}, "who: exactly one is needed"),
        ({"kind": "kill", "who": {"cont": 1}}, "who.cont: unknown key; did you mean count?"),
        ({"kind": "kill", "who": {"count": 0}}, "who.count = 0: expected a whole number from 1"),
        ({"kind": "kill", "who": {"count": 6}}, "who.count = 6: there are 5 robots; give at most 5"),
        ({"kind": "kill", "who": {"fraction": 2}}, "who.fraction = 2: expected a number above 0 and at most"),
        ({"kind": "kill", "who": "one", "id": "a b"}, 'id = "a b": expected text of at most 64 letters'),
        ({"kind": "pause", "who": "one", "for": 0}, "for = 0: expected a number above 0 and at most 1e9 (s, d"),
        ({"kind": "close", "who": "r1"}, "who: unknown key; known are kind, id, at, for, closure"),
        ({"kind": "loss", "rat": 1}, "rat: unknown key; did you mean rate?"),
        ({"kind": "loss", "rate": 1.5}, "rate = 1.5: expected a number from 0 to 1 (share of the frames)"),
        ({"kind": "loss", "rate": "1"}, 'rate = "1": expected a number from 0 to 1'),
        ({"kind": "loss", "rate": 0.1, "mean_burst": 0.5}, "mean_burst = 0.5: expected a number from 1 to"),
        (
            {"kind": "loss", "rate": 0.9, "mean_burst": 8},
            "rate = 0.9: bursts of 8 on average cannot lose more than 0.8889 of the frames",
        ),
        ({"kind": "loss", "rate": 1, "mean_burst": 1e9}, "rate = 1: bursts of 1e+09 on average cannot"),
        ({"kind": "loss", "rate": 0.1, "from": "r1", "to": ["r1"]}, "to: r1 hears nothing from itself"),
        ({"kind": "loss", "rate": 0.1, "to": "r7"}, "to: there is no robot r7"),
        ({"kind": "loss", "rate": 0.1, "from": {"count": 7}}, "from.count = 7: there are 5 robots"),
        ({"kind": "delay", "delay": 3}, "delay = 3: expected keys and values (constant, uniform, normal, exp"),
        ({"kind": "delay", "delay": {}}, "delay: exactly one is needed: {constant: S}"),
        ({"kind": "delay", "delay": {"constant": -1}}, "delay.constant = -1: expected a number from 0"),
        ({"kind": "delay", "delay": {"uniform": [2, 1]}}, "delay.uniform: the least value comes first; swap"),
        ({"kind": "delay", "delay": {"normal": [2]}}, "delay.normal = [2]: expected [mean, standard dev"),
        ({"kind": "delay", "delay": {"unifrom": 1}}, "delay.unifrom: unknown key; did you mean uniform?"),
        ({"kind": "reorder", "rate": 0.1, "hold": 0}, "hold = 0: expected a number above 0"),
        ({"kind": "partition", "groups": []}, "groups = []: expected 1 or more groups"),
        ({"kind": "partition", "groups": [[]]}, "groups.0 = []: expected 1 or more names in a group"),
        ({"kind": "partition", "groups": "thirds"}, 'groups = "thirds": expected halves, one (against the'),
        ({"kind": "partition", "groups": [["r1"], ["r2", "r1"]]}, "groups.1.1: r1 is in group 0 too; a robot"),
        ({"kind": "partition", "groups": [["r1", "r1"]]}, "groups.0.1: r1 is listed twice; a robot is in one group"),
        ({"kind": "partition", "groups": [["r8"]]}, "groups.0.0: there is no robot r8"),
        (
            {"kind": "partition", "groups": [["r1", "r2", "r3", "r4", "r5"]]},
            "groups: one group holds all robots, so nobody is cut off",
        ),
        ({"kind": "range", "reach": 0}, "reach = 0: expected a number above 0"),
        ({"kind": "bandwidth"}, "bytes_per_s: missing; give bytes/s that each of them can send"),
        ({"kind": "spoof", "payload": "x"}, 'payload = "x": expected {offset: [DX, DY]}, freeze, {replay: S}'),
        ({"kind": "spoof", "payload": {}}, "payload: exactly one is needed: {offset: [DX, DY]}, {replay: S}"),
        ({"kind": "spoof", "payload": {"replay": 0}}, "payload.replay = 0: expected a number above 0"),
        ({"kind": "spoof", "payload": "freeze", "by": "r6"}, "by: there is no robot r6"),
        ({"kind": "spoof", "payload": "freeze", "as": ["r6"]}, "as.0: there is no robot r6"),
        ({"kind": "drift", "who": "r1", "bias": [1]}, "bias = [1]: expected [x, y] in m"),
        ({"kind": "drift", "who": "r1", "jump": {"every": 1}}, "jump.size: missing; give m, of each jump"),
        ({"kind": "clock", "who": "r1", "rate": -1}, "rate = -1: expected a number above -1 and at most 1"),
        ({"kind": "motion", "who": "r1", "slip": {"rate": 0}}, ": it changes nothing; give speed, turning"),
        ({"kind": "motion", "who": "r1", "veer": 2}, "veer = 2: expected a number from 0 to 1 (rad per m"),
        ({"kind": "motion", "who": "r1", "jitter": {"size": 1}}, "jitter.size = 1: expected a number from 0"),
        ({"kind": "motion", "who": "r1", "slip": {"rat": 1}}, "slip.rat: unknown key; did you mean rate?"),
    ],
)
def test_a_wrong_fault_is_told_in_one_line(fault: Any, expected: str) -> None:
    assert f"scenario: faults.0{'' if expected.startswith(':') else '.'}{expected}" in problem(fault)


def test_two_faults_of_one_id_are_refused() -> None:
    kill = {"kind": "kill", "who": "one"}
    for name, others in (("a", {"id": "a"}), ("f2", {})):
        line = problem({**kill, "id": name}, {**kill, **others})
        assert line == f"scenario: faults.1.id: faults.0 has the id {name} too; rename one"


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ({"kind": "kill", "who": "minority"}, "who: there is one robot, so a minority is nobody"),
        ({"kind": "loss", "rate": 1, "to": "minority"}, "to: there is one robot, so a minority is nobody"),
        ({"kind": "partition", "groups": "halves"}, "groups: there is one robot, and nobody to cut it off"),
        ({"kind": "partition", "groups": "one"}, "groups: there is one robot, and nobody to cut it off from"),
        ({"kind": "partition", "groups": [["r1"]]}, "groups: one group holds all robots, so nobody is cut off"),
        ({"kind": "spoof", "by": "r1", "payload": "random"}, "as: the only victim is r1, which forges; name another"),
    ],
)
def test_one_robot_is_refused_what_takes_two(fault: dict[str, Any], expected: str) -> None:
    with pytest.raises(BadInput) as caught:
        load_scenario({**YARDS, "robots": {"count": 1}, "faults": [fault]})
    assert f"faults.0.{expected}" in str(caught.value)


@pytest.mark.parametrize("victims", ["one", {"count": 1}, {"fraction": 0.1}])
def test_nor_does_who_is_drawn_to_be_its_own_victim(victims: object) -> None:
    def spoof(by: str) -> dict[str, Any]:
        fault = {"kind": "spoof", "by": by, "as": victims, "payload": "freeze"}
        return {**YARDS, "seed": 5, "robots": {"count": 3}, "faults": [fault]}

    (fault,) = load_scenario(spoof("stranger")).faults
    assert isinstance(fault, Spoof)
    (number,) = meant(fault.victims, {"r1": 1, "r2": 2, "r3": 3}, frozenset(), (5, 0, TargetField.AS))
    victim = f"r{number}"
    with pytest.raises(BadInput) as caught:
        load_scenario(spoof(victim))
    says = f"faults.0.as: with seed 5 the only victim is {victim}, which forges; name another victim, or change by"
    assert says in str(caught.value)
    for other in {"r1", "r2", "r3"} - {victim}:
        load_scenario(spoof(other))


def test_no_draw_leaves_a_link_with_one_robot_at_both_ends() -> None:
    names = {"r1": 1, "r2": 2, "r3": 3, "r4": 4, "r5": 5}
    refused = set()
    for seed in range(40):
        fault = {"kind": "loss", "rate": 1, "from": "one", "to": ["r1"]}
        scenario = {"terrain": {"builtin": "open"}, "seed": seed, "faults": [fault]}
        if meant("one", names, frozenset(), (seed, 0, TargetField.FROM)) != (1,):
            assert load_scenario(scenario).faults
            continue
        refused.add(seed)
        both = f"faults.0.to: with seed {seed} sender and receiver are both r1; name one of them"
        with pytest.raises(BadInput, match=both):
            load_scenario(scenario)
    assert 0 < len(refused) < 20
    alone = {"terrain": {"builtin": "open"}, "robots": {"count": 1}, "faults": [{"kind": "loss", "rate": 1}]}
    assert load_scenario(alone).faults


def test_an_entry_of_an_empty_list_is_told_how_to_be_given() -> None:
    for source in (YARDS, {**YARDS, "faults": []}):
        with pytest.raises(BadInput, match=r"faults\.0\.at: faults is an empty list; give entries: faults=\[{"):
            load_scenario(source, {"faults.0.at": "30"})
    with pytest.raises(BadInput, match=r"intruders\.1: intruders is an empty list; give entries: intruders=\[{place: "):
        load_scenario(YARDS, {"intruders.1": "{}"})


def test_the_line_of_the_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    faults = "faults:\n- {kind: kill, who: one}\n- kind: loss\n  from: r1\n  rate: 1.2\n"
    file.write_text(f"terrain: {{builtin: yards}}\n{faults}", encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        load_scenario(file)
    line = "line 6: faults.1.rate = 1.2: expected a number from 0 to 1 (share of the frames)"
    assert str(caught.value) == f"{file}: {line}"
    with pytest.raises(BadInput, match=r"bad\.yaml: line 5: faults\.1\.from: there is no robot r1; robots are a$"):
        load_scenario(file, {"faults.1.rate": 0.5, "robots": [{"name": "a"}]})
    file.write_text("terrain: {builtin: yards}\nfaults:\n- {kind: kill, who: one}\n- kind: kill\n", encoding="utf-8")
    with pytest.raises(BadInput, match=r"bad\.yaml: line 4: faults\.1\.who: missing; give a robot's name"):
        load_scenario(file)


def test_an_override_is_named_and_no_line() -> None:
    fault = {"kind": "loss", "rate": 0.5}
    assert problem(fault, overrides={"faults.0.rate": 2}).startswith("override faults.0.rate = 2: expected a number")
    assert problem(fault, overrides={"faults": "[{kind: kill, who: r9}]"}).startswith("override faults.0.who: there is")
    assert problem(fault, overrides={"faults.1.rate": 1}) == (
        "override faults.1.rate: there is no entry 1; the list has entries 0 to 0"
    )
