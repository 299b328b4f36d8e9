from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.scenario import (
    PotentialFieldOptions,
    Scenario,
    StochasticOptions,
    as_mapping,
    dump_scenario,
    load_scenario,
    parse_overrides,
    scenario_hash,
    with_spares,
)

YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}}
RESOLVED_0_2: dict[str, Any] = {
    "policy": "potential-field",
    "fow": "f3",
    "distance": "g4",
    "alpha": 40.0,
    "beta": 4000.0,
    "length": 800.0,
    "paths": "wave",
    "commitment": "target",
    "direction": "mode",
    "sectors": 8,
    "reach": "paper",
    "dilatation": 5.0,
    "avoidance": "goal-refinement",
    "separation": "claims",
    "random_move": 0.02,
    "random_move_for": "all",
    "give_way": True,
    "manoeuvres": True,
    "claim_width": 0.3,
    "obstacle_radius": 5.0,
    "critical_width": 8.0,
    "repulsion": 0.5,
    "repulsion_reach": 10.0,
    "fuzzy_distance": 5.5,
    "goal_distance": 5.5,
    "refine_side": 2.0,
    "refine_reach": 10.0,
    "surround_distance": 8.0,
    "surround_repulsion": 0.3,
    "contact_memory": 5.0,
    "tolerance": 1e-16,
}
"""The section of a `scenario.yaml` that 0.2 wrote into the folder of a run with its defaults."""


def read(**patrol: Any) -> Scenario:
    return load_scenario({**YARDS, "patrol": patrol})


def paper_options(scenario: Scenario) -> PotentialFieldOptions:
    assert isinstance(scenario.patrol.options, PotentialFieldOptions)
    return scenario.patrol.options


OPTIONS_0_3 = {"separation": "claims", "random_move": 0.02, "random_move_for": "all"}
RESOLVED_0_3: dict[str, Any] = {
    "policy": "committed",
    "options": {**OPTIONS_0_3, "obstacle_radius": 5.0, "critical_width": 8.0},
}
"""Of the section that 0.3 wrote, what chooses a policy."""


def test_a_run_folder_of_0_2_means_what_it_meant() -> None:
    assert read(**RESOLVED_0_2) == read() == read(options=None)
    assert read(commitment="target", random_move=0.3) == read(), "steps that its robots hardly made are no mistake"


@pytest.mark.parametrize(
    ("share", "policy"),
    [({}, "stochastic"), ({"unpredictability": 0.5}, "stochastic"), ({"unpredictability": 0}, "committed")],
)
def test_free_choices_are_stochastic_and_a_tour_without_them_is_committed(share: dict[str, float], policy: str) -> None:
    """Files of 0.3 state no share, and had free choices alone."""
    scenario = read(**{**RESOLVED_0_3, "options": {**RESOLVED_0_3["options"], **share}})
    assert scenario == read(policy=policy)
    assert scenario == load_scenario(as_mapping(scenario))
    notes = [note.partition(" is ")[0] for note in scenario.translated]
    given = f"{share.get('unpredictability', 1):g}"
    assert notes == (
        [f"scenario: patrol.policy: committed with unpredictability {given}"] if policy == "stochastic" else []
    )
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


def test_so_does_one_that_followed_the_paper_and_what_it_leaves_out_has_the_defaults_of_0_2() -> None:
    scenario = read(**{**RESOLVED_0_2, "commitment": "none", "dilatation": 2.0, "avoidance": "fuzzy", "tolerance": 0})
    options = paper_options(scenario)
    assert (options.dilatation, options.fuzzy, options.tolerance, options.separation) == (2.0, True, 0.0, "claims")
    assert (options.random_move, options.random_move_for) == (0.02, "all")
    assert scenario.patrol.avoidance == "none"
    options = paper_options(read(commitment="none", alpha=3))
    assert (options.alpha, options.separation) == (3.0, "claims")
    assert (options.random_move, options.random_move_for) == (0.02, "all")


def test_a_section_that_does_not_state_commitment_has_the_policy_that_it_names() -> None:
    assert isinstance(read(separation="none").patrol.options, StochasticOptions)
    assert isinstance(read(policy="potential-field", alpha=3).patrol.options, PotentialFieldOptions)


@pytest.mark.parametrize(("stated", "kept"), [("repulsion", "none"), (["claims", "repulsion"], ("claims",))])
def test_repulsion_did_nothing_for_a_committed_robot(stated: Any, kept: Any) -> None:
    options = read(commitment="target", separation=stated).patrol.options
    assert isinstance(options, StochasticOptions)
    assert options.separation == kept


def test_defaults_of_0_2_are_no_settings_of_a_policy_of_ones_own(tmp_path: Path) -> None:
    policy = tmp_path / "mine.py"
    policy.write_text("class Mine:\n    def decide(self, view): ...\n", encoding="utf-8")
    scenario = read(**{**RESOLVED_0_2, "policy": f"{policy}:Mine", "options": {"near": 3}})
    assert scenario.patrol.options == {"near": 3}
    built_on_ours = read(policy=f"{policy}:Mine", commitment="none", alpha=3, sectors=8, dilatation=5.0)
    assert built_on_ours.patrol.options == {"alpha": 3}


def test_overrides_of_0_2_go_where_the_fields_are() -> None:
    assert (
        paper_options(load_scenario(YARDS, parse_overrides(["patrol.commitment=none", "patrol.sectors=16"]))).sectors
        == 16
    )
    assert paper_options(load_scenario(YARDS, parse_overrides(["patrol={commitment: none, alpha: 3}"]))).alpha == 3.0
    over_a_file = load_scenario({**YARDS, "patrol": RESOLVED_0_2}, {"patrol.separation": "none"}).patrol.options
    assert isinstance(over_a_file, StochasticOptions)
    assert over_a_file.separation == "none"


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


@pytest.mark.parametrize(("old", "new"), [("target", "potential-field"), ("none", "committed")])
def test_a_policy_that_is_chosen_over_a_file_of_0_2_is_the_policy(old: str, new: str) -> None:
    scenario = load_scenario({**YARDS, "patrol": {**RESOLVED_0_2, "commitment": old}}, {"patrol.policy": new})
    assert scenario.patrol.policy == new
    assert scenario.patrol.options == load_scenario({**YARDS, "patrol": {"policy": new}}).patrol.options


def test_commitment_over_a_file_of_this_version_chooses_a_policy_and_changes_no_other() -> None:
    paper = {**YARDS, "patrol": {"policy": "potential-field"}}
    assert load_scenario(paper, {"patrol.commitment": "none"}) == load_scenario(paper)
    assert load_scenario(paper, {"patrol.commitment": "target"}) == load_scenario(YARDS)
    options = paper_options(load_scenario(YARDS, {"patrol.commitment": "none", "patrol.random_move": 0.3}))
    assert (options.separation, options.random_move) == ("claims", 0.3)


def test_fuzzy_avoidance_over_a_resolved_file_is_fuzzy() -> None:
    resolved = as_mapping(load_scenario(YARDS, {"patrol.policy": "potential-field"}))
    assert paper_options(load_scenario(resolved, {"patrol.avoidance": "fuzzy"})).fuzzy


@pytest.mark.parametrize(
    ("patrol", "expected"),
    [
        ({"dilatation": 2}, "patrol.options.dilatation: does nothing for the policy stochastic; leave it out, or set"),
        ({"avoidance": "fuzzy"}, "patrol.options.fuzzy: does nothing for the policy stochastic"),
        (
            {"policy": "committed", "options": {"unpredictability": 2}},
            "patrol.options.unpredictability: does nothing for the policy committed, which is the tour; set patrol.pol",
        ),
        ({"commitment": "maybe"}, "patrol.commitment: is target or none in files of 0.2; since then set patrol"),
        ({"commitment": "none", "sectors": 0}, "patrol.options.sectors = 0: expected"),
    ],
)
def test_what_is_refused(patrol: dict[str, Any], expected: str) -> None:
    with pytest.raises(BadInput) as refused:
        read(**patrol)
    assert expected in str(refused.value)


def test_a_mistake_in_a_file_of_0_2_is_named_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "old.yaml"
    file.write_text("terrain: {builtin: yards}\npatrol:\n  commitment: none\n  sectors: 0\n", encoding="utf-8")
    with pytest.raises(BadInput, match=r"line 4: patrol\.options\.sectors = 0"):
        load_scenario(file)


def test_what_is_written_is_this_version() -> None:
    text = dump_scenario(read(**RESOLVED_0_2))
    assert "commitment" not in text
    assert "  policy: stochastic " in text
