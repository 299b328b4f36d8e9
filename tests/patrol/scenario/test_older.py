from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.scenario import Scenario, as_mapping, load_scenario, parse_overrides, scenario_hash, with_spares

YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}}


def read(**patrol: Any) -> Scenario:
    return load_scenario({**YARDS, "patrol": patrol})


STATED: dict[str, Any] = {"separation": "claims", "random_move": 0.02, "random_move_for": "all"}
"""Settings of `committed` that files of 1.0 state, beside the share of free choices."""


def test_no_options_are_the_defaults() -> None:
    assert read(options=None) == read()


@pytest.mark.parametrize(
    ("share", "policy"),
    [({}, "committed"), ({"unpredictability": 0.5}, "stochastic"), ({"unpredictability": 0}, "committed")],
)
def test_free_choices_are_stochastic_and_a_tour_without_them_is_committed(share: dict[str, float], policy: str) -> None:
    scenario = read(policy="committed", options={**STATED, **share})
    assert scenario == read(policy=policy)
    assert scenario == load_scenario(as_mapping(scenario))
    notes = [note.partition(" is ")[0] for note in scenario.translated]
    assert notes == (["scenario: patrol.policy: committed with unpredictability 0.5"] if policy == "stochastic" else [])
    assert load_scenario(as_mapping(scenario)).translated == ()
    assert with_spares(scenario, 2).translated == scenario.translated


def test_the_tour_has_the_hash_that_it_had() -> None:
    """Of 1.0, which stated no share of free choices, and random steps that robots on a tour did not make."""
    robots = {"robots": {"model": "holonomic"}}
    tour = load_scenario({**YARDS, **robots, "patrol": {"policy": "committed"}})
    assert scenario_hash(tour) == "d6ac605c914aa8195f2347d5f8bd3b7035bc62068dd024c00532a1136f64741a"


def test_a_file_that_states_a_part_of_the_settings_has_the_defaults_of_this_version() -> None:
    scenario = read(options={"separation": "claims", "random_move": 0.02})
    assert scenario == read()
    assert scenario.translated == ()
    tour = read(policy="committed", options={"separation": "claims", "random_move": 0.02})
    assert tour == read(policy="committed")


@pytest.mark.parametrize("patrol", [{}, {"policy": "committed"}])
def test_random_steps_that_are_no_setting_any_more_are_left_out_and_named(patrol: dict[str, Any]) -> None:
    scenario = read(**patrol, options={"random_move": 0.3, "random_move_for": "all"})
    assert scenario == read(**patrol)
    (note,) = scenario.translated
    assert note.startswith("scenario: patrol.options.random_move = 0.3: left out, as")


def test_they_are_refused_beside_a_policy_that_no_earlier_version_had() -> None:
    with pytest.raises(BadInput, match="random_move: does nothing for the policy stochastic"):
        read(policy="stochastic", options={"random_move": 0.3})


def test_another_policy_does_not_take_over_the_settings_of_the_one_that_it_replaces() -> None:
    stated = {**YARDS, "patrol": {"options": {"random_move": 0.5, "unpredictability": 0.5}}}
    replaced = load_scenario(stated, {"patrol.policy": "potential-field"})
    assert replaced == load_scenario({**YARDS, "patrol": {"policy": "potential-field"}})
    assert replaced.translated == ()
    same = load_scenario(stated, {"patrol.policy": "stochastic"})
    assert as_mapping(same)["patrol"]["options"]["unpredictability"] == 0.5
    tour = load_scenario(
        {**YARDS, "patrol": {"policy": "committed", **stated["patrol"]}}, {"patrol.policy": "committed"}
    )
    assert tour == load_scenario({**YARDS, "patrol": {"policy": "committed"}})


GONE = {
    "commitment: none": ("commitment", "patrol.policy to stochastic or potential-field"),
    "sectors: 16": ("sectors", "patrol.options.sectors"),
    "separation: none": ("separation", "patrol.options.separation"),
}


@pytest.mark.parametrize("setting", GONE)
def test_a_setting_from_before_1_0_is_refused_with_its_line_and_its_successor(setting: str, tmp_path: Path) -> None:
    name, successor = GONE[setting]
    problem = f"patrol.{name}: is no setting of patrol; set {successor}"
    file = tmp_path / "old.yaml"
    file.write_text(f"terrain: {{builtin: yards}}\npatrol:\n  give_way: true\n  {setting}\n", encoding="utf-8")
    with pytest.raises(BadInput) as refused:
        load_scenario(file)
    assert str(refused.value) == f"{file}: line 4: {problem}"
    with pytest.raises(BadInput) as refused:
        load_scenario(YARDS, parse_overrides([f"patrol.{setting.replace(': ', '=')}"]))
    assert str(refused.value) == f"override {problem}"


@pytest.mark.parametrize(
    ("patrol", "expected"),
    [
        ({"avoidance": "fuzzy"}, 'patrol.avoidance = "fuzzy": expected none or goal-refinement'),
        (
            {"options": {"alpha": 3}},
            "patrol.options.alpha: does nothing for the policy stochastic; leave it out, or set",
        ),
        (
            {"policy": "committed", "options": {"unpredictability": 2}},
            "patrol.options.unpredictability: does nothing for the policy committed, which is the tour; set patrol.pol",
        ),
    ],
)
def test_what_is_refused(patrol: dict[str, Any], expected: str) -> None:
    with pytest.raises(BadInput) as refused:
        read(**patrol)
    assert expected in str(refused.value)
