from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.scenario import Scenario, as_mapping, load_scenario, scenario_hash
from patrol.scenario.policies import PAPER_RULES, PaperRule

YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}}
INTRUDERS = [{"place": [20, 20]}]


def scenario(letter: Any = None, model: str = "holonomic", patrol: Any = None, **more: Any) -> Scenario:
    options = {} if letter is None else {"letter": letter}
    section = {"policy": "potential-field", **(patrol or {})}
    section["options"] = options | section.get("options", {})
    return load_scenario({**YARDS, "robots": {"model": model}, "patrol": section, **more})


def test_one_word_gives_the_paper_and_without_it_all_rules_are_ours() -> None:
    override = {"patrol.policy": "potential-field", "patrol.options.letter": "true"}
    for whole in (scenario(True), load_scenario(YARDS, override)):
        assert whole.patrol.paper_rules == set(PAPER_RULES)
        assert (whole.patrol.give_way, whole.patrol.manoeuvres) == (False, False)
    ours = scenario().patrol
    assert ours.paper_rules == frozenset()
    assert (ours.give_way, ours.manoeuvres) == (True, True)


@pytest.mark.parametrize(
    ("letter", "rules"),
    [("first-step", {"first-step"}), (["first-step", "no-stop"], {"first-step", "no-stop"}), (False, set())],
)
def test_rules_are_taken_one_by_one(letter: Any, rules: set[str]) -> None:
    patrol = scenario(letter).patrol
    assert patrol.paper_rules == rules
    assert patrol.give_way


def test_the_default_policy_has_no_letter() -> None:
    assert load_scenario(YARDS).patrol.paper_rules == frozenset()
    with pytest.raises(BadInput, match=r"patrol\.options\.letter"):
        load_scenario(YARDS, {"patrol.options.letter": "true"})


@pytest.mark.parametrize("letter", [True, "first-step", ["no-stop", "far-goal"]])
def test_a_resolved_scenario_means_the_same_when_it_is_read_again(letter: Any) -> None:
    first = scenario(letter)
    again = load_scenario(as_mapping(first))
    assert again == first
    assert scenario_hash(again) == scenario_hash(first) != scenario_hash(scenario())


def test_hashes_are_as_before_there_was_a_letter() -> None:
    paper = {"policy": "potential-field", "give_way": False, "manoeuvres": False}
    given = {"terrain": {"builtin": "open"}, "patrol": paper}
    assert scenario_hash(load_scenario(given)) == "ab20289afdd063d1843f5122dad474ebf5f2f5db73d46d4987a47d2e2e0c109e"


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"ties": "drawn"}, "patrol.options.ties: drawn has no effect unless patrol.options.letter has first-step"),
        ({"letter": "no-stop", "ties": "straight"}, "patrol.options.ties: straight has no effect"),
        ({"origin": "robot"}, "patrol.options.origin: robot has no effect unless patrol.options.paths is straight"),
        ({"ties": "first"}, "patrol.options.ties"),
    ],
)
def test_ties_and_origin_need_the_paths_that_they_change(options: dict[str, Any], problem: str) -> None:
    with pytest.raises(BadInput) as refused:
        scenario(patrol={"options": options})
    assert problem in str(refused.value)


def test_ties_and_origin_change_the_hash_where_they_differ() -> None:
    for options, without in (
        ({"letter": True, "ties": "drawn"}, {"letter": True, "ties": "diagonal"}),
        ({"paths": "straight", "origin": "robot"}, {"paths": "straight", "origin": "point"}),
    ):
        ours, before = (scenario(patrol={"options": each}) for each in (options, without))
        assert load_scenario(as_mapping(ours)) == ours
        assert scenario_hash(ours) != scenario_hash(before)
        del without["ties" if "ties" in without else "origin"]
        assert scenario_hash(before) == scenario_hash(scenario(patrol={"options": without}))


def test_all_robots_make_random_steps() -> None:
    for which in ("all", "holonomic"):
        with pytest.raises(BadInput, match="random_move_for: is gone: each robot makes random steps; drop it, or set"):
            scenario(patrol={"options": {"random_move_for": which}})


@pytest.mark.parametrize(
    ("policy", "why"),
    [
        ("stochastic", "does nothing for the policy stochastic; leave it out, or set"),
        ("committed", "is gone: committed is the tour alone; drop it, or set patrol.policy to stochastic"),
    ],
)
def test_random_steps_are_no_setting_of_policies_that_keep_to_a_place(policy: str, why: str) -> None:
    overrides = {"patrol.policy": policy, "patrol.options.random_move": 0.3}
    with pytest.raises(BadInput, match=f"random_move: {why}"):
        load_scenario(YARDS, overrides)


EFFECTLESS: list[tuple[PaperRule, dict[str, Any], str]] = [
    ("first-step", {"patrol": {"options": {"paths": "regions"}}}, "set patrol.options.paths to wave"),
    ("no-stop", {"model": "car"}, "set a robot's model to holonomic"),
    ("whole-square", {"patrol": {"avoidance": "none"}}, "set patrol.avoidance to goal-refinement"),
    ("square-window", {"patrol": {"options": {"dilatation": 0}}}, "give a patrol.options.dilatation above 0"),
    ("plain-unstuck", {}, "set a robot's model to car"),
    ("surround-forces", {}, "give intruders"),
]


@pytest.mark.parametrize(("rule", "settings", "remedy"), EFFECTLESS, ids=[rule for rule, _, _ in EFFECTLESS])
def test_a_rule_without_effect_is_refused_with_the_remedy(
    rule: PaperRule, settings: dict[str, Any], remedy: str
) -> None:
    with pytest.raises(BadInput) as refused:
        scenario([rule], **settings)
    assert f"patrol.options.letter: {rule} has no effect here; drop it, or {remedy}" in str(refused.value)
    assert "\n" not in str(refused.value)
    assert rule in scenario(True, **settings).patrol.paper_rules


@pytest.mark.parametrize(
    ("rule", "settings"),
    [
        ("plain-unstuck", {"model": "car"}),
        ("surround-forces", {"intruders": INTRUDERS}),
        ("square-window", {"patrol": {"options": {"dilatation": 2}}}),
    ],
)
def test_the_remedy_helps(rule: PaperRule, settings: dict[str, Any]) -> None:
    assert scenario([rule], **settings).patrol.paper_rules == {rule}


@pytest.mark.parametrize("field", ["give_way", "manoeuvres"])
def test_what_is_ours_contradicts_the_whole_letter(field: str) -> None:
    with pytest.raises(BadInput, match=rf"patrol\.{field}: true, and patrol\.options\.letter is true.*drop it"):
        scenario(True, patrol={field: True})
    assert getattr(scenario(["first-step"], patrol={field: True}).patrol, field)


def test_the_paper_has_no_differential_robots() -> None:
    with pytest.raises(BadInput, match="the paper has no differential robots"):
        scenario(True, model="differential")
    assert scenario(["no-stop"], model="differential").patrol.paper_rules == {"no-stop"}


@pytest.mark.parametrize("letter", ["to the letter", ["first-stop"], [], 1])
def test_anything_else_is_refused(letter: Any) -> None:
    with pytest.raises(BadInput, match=r"patrol\.options\.letter"):
        scenario(letter)
