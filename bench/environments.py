"""Learning environments: the processor time of a step, which is one tick of all robots with all their observations.

Robots take actions drawn at random from those that the mask allows, each for ten steps. Drawing them does not count.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np

from bench.runner import Bench
from fogwatch.learn import PatrolEnv, parallel_env
from patrol.scenario.policies import LEARNED_INPUTS, LearnedInput

ROBOTS = 5
HELD = 10
"""Steps for which a robot keeps its action."""
SKIPPED = 100
"""Steps that do not count: caches fill."""
COUNTED = 400
INPUTS: dict[str, tuple[LearnedInput, ...]] = {"all inputs": LEARNED_INPUTS, "sectors": ("sectors",)}


def main() -> None:
    """Measure both kinds of bodies, with all inputs and with the smallest useful one."""
    bench = Bench("environments", values=1, warmups=0, loops=1)
    for model in ("holonomic", "car"):
        for name, inputs in INPUTS.items():
            what = f"a step of {ROBOTS} {model} robots on yards, {name}"
            bench.time(what, partial(steps_time, model, inputs, SKIPPED, COUNTED), inner_loops=COUNTED)
    bench.end()


def steps_time(model: str, inputs: tuple[LearnedInput, ...], skipped: int, counted: int, loops: int) -> float:
    """Play episodes, and measure their steps after the first ones.

    Args:
        model: Of the robots.
        inputs: What they observe.
        skipped: Steps at the beginning that do not count, a multiple of `HELD`.
        counted: Steps after them, likewise.
        loops: Episodes.

    Returns:
        The processor time of the steps that count, of all episodes together, s.
    """
    settings = {"robots.count": ROBOTS, "robots.model": model, "point": 1}
    env = parallel_env("yards", settings, inputs=inputs)
    spent_s = 0.0
    for seed in range(loops):
        observations, _ = env.reset(seed=seed)
        rng = np.random.default_rng(seed)
        for step in range(0, skipped + counted, HELD):
            actions = drawn(observations, rng)
            begun_s = time.process_time()
            observations = _held(env, actions)
            if step >= skipped:
                spent_s += time.process_time() - begun_s
    return spent_s


def drawn(observations: dict[str, dict[str, Any]], rng: np.random.Generator) -> dict[str, int]:
    """Draw an action for each robot from those that its mask allows.

    Args:
        observations: By robot.
        rng: Where the numbers come from.
    """
    return {
        agent: int(rng.choice(np.flatnonzero(parts["action_mask"]))) for agent, parts in sorted(observations.items())
    }


def _held(env: PatrolEnv, actions: dict[str, int]) -> dict[str, dict[str, Any]]:
    observations: dict[str, dict[str, Any]] = {}
    for _ in range(HELD):
        observations, *_ = env.step(actions)
    return observations


if __name__ == "__main__":
    main()
