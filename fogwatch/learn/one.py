"""The Gymnasium environment of a robot alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NoReturn

import gymnasium

from fogwatch.learn.parallel import NO_EPISODE, Parts, PatrolEnv, parallel_env
from fogwatch.learn.rewards import Reward
from fogwatch.notebook.arguments import checked_arguments
from patrol.errors import BadInput
from patrol.scenario import Scenario
from patrol.scenario.policies import LearnedInput


class OneRobotEnv(gymnasium.Env[Parts, Any]):
    """A robot that patrols alone: `PatrolEnv` with its only agent.

    Attributes:
        fleet: The environment of the fleet of one robot.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's protocol

    def __init__(self, fleet: PatrolEnv) -> None:
        """Take the only agent of a fleet.

        Args:
            fleet: An environment with one agent.

        Raises:
            BadInput: It has several.
        """
        if len(fleet.possible_agents) != 1:
            count = len(fleet.possible_agents)
            raise BadInput(f"robots: there are {count}, and this environment is for one; set robots.count to 1")
        self.fleet = fleet
        self._agent = fleet.possible_agents[0]
        self.observation_space = fleet.observation_space(self._agent)
        self.action_space = fleet.action_space(self._agent)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Parts, dict[str, Any]]:
        """Begin an episode, as `PatrolEnv.reset`."""
        super().reset(seed=seed)
        observations, infos = self.fleet.reset(seed, options)
        return observations[self._agent], infos[self._agent]

    def step(self, action: Any) -> tuple[Parts, float, bool, bool, dict[str, Any]]:
        """Act, as `PatrolEnv.step`.

        Args:
            action: Of the robot.

        Raises:
            gymnasium.error.ResetNeeded: The episode is over, or none has begun.
        """
        agent = self._agent
        if not self.fleet.agents:
            raise gymnasium.error.ResetNeeded(NO_EPISODE)
        observations, rewards, terminated, ended, infos = self.fleet.step({agent: action})
        return observations[agent], rewards[agent], terminated[agent], ended[agent], infos[agent]

    def render(self) -> NoReturn:
        """Refuse to draw, as `PatrolEnv.render`."""
        self.fleet.render()

    def close(self) -> None:
        """Drop the episode."""
        self.fleet.close()


@checked_arguments
def one_env(
    scenario: Scenario | str | Path | Mapping[str, Any] = "yards",
    overrides: Mapping[str, object] | None = None,
    *,
    actions: Literal["bearing", "place", "node"] | None = None,
    decide: Literal["tick", "arrival"] | None = None,
    inputs: Sequence[LearnedInput] | None = None,
    window: int | None = None,
    heard: int | None = None,
    reward: str | Reward = "mean",
    keep: bool = False,
    render_mode: None = None,
) -> OneRobotEnv:
    """Make an environment of one robot.

    Args:
        scenario: As of `parallel_env`.
        overrides: Likewise; ``{"robots.count": 1}`` unless they say otherwise.
        actions: Likewise.
        decide: Likewise.
        inputs: Likewise.
        window: Likewise.
        heard: Likewise.
        reward: Likewise.
        keep: Likewise.
        render_mode: Likewise.

    Raises:
        BadInput: Likewise; or there are several robots.
    """
    fleet = parallel_env(
        scenario,
        {"robots.count": 1, **(overrides or {})},
        actions=actions,
        decide=decide,
        inputs=inputs,
        window=window,
        heard=heard,
        reward=reward,
        keep=keep,
        render_mode=render_mode,
    )
    return OneRobotEnv(fleet)
