"""The environment of one robot: Gymnasium's rules."""

from dataclasses import replace
from typing import Any

import gymnasium
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from fogwatch.learn import SINGLE_ID, OneRobotEnv, one_env, parallel_env
from patrol.errors import BadInput

ALONE: dict[str, Any] = {"point": 1.0, "duration": 30.0}


@pytest.mark.parametrize(("actions", "decide"), [("bearing", "tick"), ("place", "arrival"), ("node", "arrival")])
def test_it_keeps_the_rules_of_gymnasium(actions: str, decide: str) -> None:
    env = gymnasium.make(SINGLE_ID, overrides=ALONE, actions=actions, decide=decide)
    check_env(env.unwrapped)


def test_its_episode_ends_with_the_scenario() -> None:
    env = one_env("yards", ALONE)
    env.reset(seed=4)
    ends = [env.step(env.action_space.sample())[2:4] for _ in range(60)]
    assert ends == [(False, False)] * 59 + [(False, True)]
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"call reset\(\) before the next step"):
        env.step(env.action_space.sample())
    with pytest.raises(NotImplementedError, match="draw nothing; run what you have trained"):
        env.render()


def test_gymnasium_may_pass_no_render_mode_and_a_caller_may_fall_back_from_another() -> None:
    gymnasium.make(SINGLE_ID, overrides=ALONE, render_mode=None)
    with pytest.raises(TypeError, match='render_mode = "rgb_array": environments draw nothing; leave it out'):
        gymnasium.make(SINGLE_ID, overrides=ALONE, render_mode="rgb_array")


def test_a_specification_that_version_1_0_saved_still_makes_the_environment() -> None:
    saved = replace(gymnasium.spec(SINGLE_ID), entry_point="fogwatch.learn.one:one_env", kwargs={"overrides": ALONE})
    env = gymnasium.make(EnvSpec.from_json(saved.to_json()))
    assert isinstance(env.unwrapped, OneRobotEnv)


@pytest.mark.parametrize("make", [one_env, parallel_env])
def test_a_step_needs_a_reset(make: Any) -> None:
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"call reset\(\) before the next step"):
        make("yards", ALONE).step({})


def test_several_robots_are_refused() -> None:
    with pytest.raises(BadInput, match=r"robots: there are 3, and this environment is for one; set robots\.count to 1"):
        one_env("yards", {**ALONE, "robots.count": 3})
