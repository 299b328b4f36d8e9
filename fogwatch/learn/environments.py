"""The PettingZoo environment of a fleet, and the Gymnasium environment of a robot alone."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NoReturn

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray
from pettingzoo.utils.env import ParallelEnv

from agent.learned.network import MASK, STAY
from agent.learned.observation import Observer
from fogwatch.inprocess import check_in_process
from fogwatch.learn.episode import Episode
from fogwatch.notebook.arguments import WrongArguments, checked_arguments, scenario_of
from fogwatch.own_classes import named_classes
from patrol.classes.static_check import announce
from patrol.errors import BadInput, did_you_mean, quoted
from patrol.journal import TickRecord
from patrol.prepare import Prepared, prepare
from patrol.scenario import Scenario
from patrol.scenario.policies import LEARNED, LearnedInput, LearnedOptions

Parts = dict[str, NDArray[Any]]

NO_EPISODE = "no episode, or it is over: call reset() before the next step"

Reward = Callable[[TickRecord | None, TickRecord, float], float]
"""Takes the record of the tick before, None at the first, that of the tick, and s per tick.

The fog is the fleet's, so all robots get the same. With A(k) the mean age of all patrolled points after tick k, and
M(k) the age of the stalest one, the true MFoW, in s:

    mean     -A(k)
    mfow     -M(k)
    change   A(k - 1) - A(k), which adds up to the change over an episode; A(-1) = 0

A step that takes several ticks gets the sum of theirs.
"""


def _minus_mean(_before: TickRecord | None, record: TickRecord, step: float) -> float:
    return -record.fog_mean * step


def _minus_mfow(_before: TickRecord | None, record: TickRecord, step: float) -> float:
    return -record.mfow * step


def _minus_change(before: TickRecord | None, record: TickRecord, step: float) -> float:
    return ((0.0 if before is None else before.fog_mean) - record.fog_mean) * step


REWARDS: dict[str, Reward] = {"mean": _minus_mean, "mfow": _minus_mfow, "change": _minus_change}


class PatrolEnv(ParallelEnv[str, Parts, Any]):  # type: ignore[misc] # PettingZoo is untyped
    """A fleet on patrol, of which each robot is an agent, named as in the scenario.

    A step is one tick of all robots; with ``decide="arrival"`` it is as many ticks as pass until a robot needs a
    decision. An agent that is paused, or that comes or comes back later, is silent meanwhile: its observation is zero,
    it is not active, and its actions have no effect. One that is gone for good is terminated. At the end of the
    scenario's duration all are truncated.

    Attributes:
        prepared: The scenario of the present episode, with its terrain and fields.
        options: What robots see and decide.
        episode: The present one; None before the first `reset`.
    """

    metadata: dict[str, Any] = {"name": "fogwatch_patrol_v0", "render_modes": []}  # noqa: RUF012 - PettingZoo's protocol
    render_mode: str | None = None

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any],
        overrides: Mapping[str, object],
        reward: str | Reward = "mean",
        *,
        keep: bool = False,
    ) -> None:
        """Load and prepare the scenario; `parallel_env` is the usual way to make an environment.

        The arguments are as there, `overrides` with the settings of the policy `learned`.
        """
        self._source, self._overrides, self._keep = scenario, dict(overrides), keep
        if isinstance(reward, str) and reward not in REWARDS:
            raise BadInput(f"reward = {reward!r}: no such reward; {did_you_mean(reward, list(REWARDS))}")
        self._reward = REWARDS[reward] if isinstance(reward, str) else reward
        classes = named_classes(scenario_of(self._source, self._overrides))
        announce(named for named, _ in classes if named.sort.section != "patrol")  # the agents decide instead
        self.prepared = self._prepare_scenario(None)
        options = self.prepared.scenario.patrol.options
        assert isinstance(options, LearnedOptions)
        self.options = options
        self.episode: Episode | None = None
        self._numbers = {spec.name: spec.number for spec in self.scenario.roster}
        self.possible_agents = list(self._numbers)
        self.agents: list[str] = []
        self._due: set[int] = set()
        self._last: TickRecord | None = None
        observer = Observer(self.prepared.terrain, options, self.scenario.step)
        self._silent: Parts = {name: np.zeros(shape, np.float32) for name, shape in observer.shapes.items()}
        choices = {"bearing": STAY + 1, "node": self.prepared.make_graph().size if options.actions == "node" else 0}
        self._choices = choices.get(options.actions)
        if self._choices is not None:
            self._silent[MASK] = np.ones(self._choices, np.int8)
        # A space for each agent, as each has its own random numbers.
        self._observation_spaces = {agent: self._make_observation_space() for agent in self.possible_agents}
        self._action_spaces = {agent: self._make_action_space() for agent in self.possible_agents}

    @property
    def scenario(self) -> Scenario:
        """The scenario of the present episode."""
        return self.prepared.scenario

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's observations (`agent.learned.observation`), with a mask of discrete actions."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's actions (`agent.learned.network`)."""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Parts], dict[str, dict[str, Any]]]:
        """Begin an episode.

        Args:
            seed: The scenario's seed. Without one the first episode has the scenario's own, and each further episode
                the seed after that of the one before.
            options: Not used.

        Returns:
            Observations and infos by agent, as of `step`.

        Raises:
            BadInput: The scenario cannot be run with this seed.
        """
        del options
        seed = self.scenario.seed + (self.episode is not None) if seed is None else operator.index(seed)
        if seed != self.scenario.seed:
            self.prepared = self._prepare_scenario(seed)
        self._last = None
        self.episode = Episode(self.prepared, self.options, keep=self._keep)
        self.agents = [name for name, number in self._numbers.items() if self.episode.will_be_alive(number)]
        self._due = self._find_due(self.episode)
        return self._observe_robots(self.episode), self._make_infos(0)

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Parts], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let all agents act.

        Args:
            actions: By agent. Those of agents that are not active have no effect; an active one without an action goes
                on as before.

        Returns:
            By agent: observation; reward (`Reward`), the same for all; whether the agent is gone for
            good; whether the scenario's duration is over; and info: whether the agent is ``active`` and so decides
            next, the number of ``ticks`` of this step, and the true ``mfow_s`` and ``mean_age_s`` after it. After the
            end of an episode all five are empty.

        Raises:
            gymnasium.error.ResetNeeded: No episode has begun.
        """
        episode = self.episode
        if episode is None:
            raise ResetNeeded(NO_EPISODE)
        if not self.agents:
            return {}, {}, {}, {}, {}
        for name, action in actions.items():
            if name not in self._numbers:
                raise BadInput(f"{name}: no such agent; these are {', '.join(self.possible_agents)[:100]}")
            if self._numbers[name] in self._due:
                episode.take(self._numbers[name], self._check_action(name, action))
        reward, ticks = 0.0, 0
        waits = self.options.decide == "arrival"
        while not ticks or (waits and not self._due and not episode.over):
            record = episode.advance()
            reward += self._reward(self._last, record, self.scenario.step)
            self._last, ticks = record, ticks + 1
            self._due = self._find_due(episode)
        observations, infos = self._observe_robots(episode), self._make_infos(ticks)
        terminated = {name: not episode.will_be_alive(self._numbers[name]) for name in self.agents}
        ended = {name: episode.over and not terminated[name] for name in self.agents}
        rewards = dict.fromkeys(self.agents, reward)
        self.agents = [name for name in self.agents if not terminated[name] and not ended[name]]
        return observations, rewards, terminated, ended, infos

    def render(self) -> NoReturn:
        """Refuse to draw: the page and the pictures of a run show what was learned."""
        raise NotImplementedError(
            "environments draw nothing; run what you have trained as the policy `learned`, and watch its page, or "
            "fogwatch animate"
        )

    def close(self) -> None:
        """Drop the episode."""
        self.episode, self.agents = None, []

    def _check_action(self, name: str, action: Any) -> Any:
        """Return an action as its space has it; arrays of one number, as networks give them, are that number."""
        space = self._action_spaces[name]
        array = np.asarray(action)
        if isinstance(space, spaces.Discrete):
            converted = array.reshape(-1)[0] if array.size == 1 and array.dtype.kind in "iu" else None
        else:
            converted = array.astype(np.float32) if array.dtype.kind in "iuf" and array.shape == space.shape else None
        if converted is None or not space.contains(converted):
            raise BadInput(f"action of {name} = {action!r}: is not in {space}")
        return int(converted) if isinstance(space, spaces.Discrete) else converted

    def _prepare_scenario(self, seed: int | None) -> Prepared:
        overrides = self._overrides if seed is None else {**self._overrides, "seed": seed}
        scenario = scenario_of(self._source, overrides)
        check_in_process(scenario)
        terrain = None if seed is None else self.prepared.terrain
        return prepare(scenario, terrain)

    def _find_due(self, episode: Episode) -> set[int]:
        return {number for number, view in episode.views.items() if episode.decisions(number).is_due(view)}

    def _observe_robots(self, episode: Episode) -> dict[str, Parts]:
        observations: dict[str, Parts] = {}
        for name in self.agents:
            number = self._numbers[name]
            view = episode.views.get(number)
            if view is None:
                observations[name] = {part: values.copy() for part, values in self._silent.items()}
                continue
            decisions = episode.decisions(number)
            parts: Parts = dict(decisions.observe(view))
            if (mask := decisions.mask(view)) is not None:
                parts[MASK] = mask
            observations[name] = parts
        return observations

    def _make_infos(self, ticks: int) -> dict[str, dict[str, Any]]:
        step, last = self.scenario.step, self._last
        mfow_s, mean_age_s = (0.0, 0.0) if last is None else (last.mfow * step, last.fog_mean * step)
        facts = {"ticks": ticks, "mfow_s": mfow_s, "mean_age_s": mean_age_s}
        return {name: {"active": self._numbers[name] in self._due, **facts} for name in self.agents}

    def _make_observation_space(self) -> spaces.Dict:
        boxes = [  # of a mapping Gymnasium would sort the parts
            (name, spaces.Box(0 if name == MASK else -1, 1, values.shape, values.dtype.type))
            for name, values in self._silent.items()
        ]
        return spaces.Dict(boxes)

    def _make_action_space(self) -> spaces.Space[Any]:
        return spaces.Box(-1.0, 1.0, (2,), np.float32) if self._choices is None else spaces.Discrete(self._choices)


@checked_arguments
def parallel_env(
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
) -> PatrolEnv:
    """Make an environment of a whole fleet.

    Args:
        scenario: A scenario file, a map's YAML file, the name of a built-in terrain, a mapping shaped like a scenario
            file, or a loaded scenario. Its policy is replaced by `learned`.
        overrides: Values by dotted field, such as ``{"robots.count": 5, "point": 1}``.
        actions: ``bearing``, ``place`` or ``node``.
        decide: ``tick`` or ``arrival``.
        inputs: What agents see.
        window: Points, side of the window.
        heard: Positions of other robots in an observation.
        reward: ``mean``, ``mfow`` or ``change`` (docs/environments.md), or a function of the record of the tick before
            (None at the first), that of the tick, and s per tick.
        keep: Whether episodes keep the records of all ticks, so that they can be judged.
        render_mode: None, as environments draw nothing.

    Returns:
        The environment. What is not given here is as `patrol.options` of the scenario say, if its policy is `learned`,
        or as their defaults.

    Raises:
        BadInput: One line that says what is wrong, and how to mend it.
    """
    if render_mode is not None:
        raise WrongArguments(f"render_mode = {quoted(render_mode)}: environments draw nothing; leave it out")
    options = {"actions": actions, "decide": decide, "inputs": inputs, "window": window, "heard": heard}
    settings = {f"patrol.options.{name}": value for name, value in options.items() if value is not None}
    if inputs is not None:
        settings["patrol.options.inputs"] = list(inputs)
    return PatrolEnv(scenario, {**(overrides or {}), "patrol.policy": LEARNED, **settings}, reward, keep=keep)


class OneRobotEnv(gymnasium.Env[Parts, Any]):
    """A robot that patrols alone: `PatrolEnv` with its only agent.

    Attributes:
        fleet: The environment of the fleet of one robot.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - Gymnasium's protocol

    def __init__(self, fleet: PatrolEnv) -> None:
        """Take the only agent of a fleet; BadInput if it has several."""
        if (count := len(fleet.possible_agents)) != 1:
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
        """Act, as `PatrolEnv.step`; ResetNeeded when the episode is over, or none has begun."""
        agent = self._agent
        if not self.fleet.agents:
            raise ResetNeeded(NO_EPISODE)
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

    The arguments are those of `parallel_env`; `robots.count` is 1 unless `overrides` say otherwise.

    Raises:
        BadInput: As of `parallel_env`; or there are several robots.
    """
    options: dict[str, Any] = {"actions": actions, "decide": decide, "inputs": inputs, "window": window, "heard": heard}
    alone = {"robots.count": 1, **(overrides or {})}
    return OneRobotEnv(parallel_env(scenario, alone, reward=reward, keep=keep, render_mode=render_mode, **options))
