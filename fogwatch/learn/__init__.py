"""Learning environments over the world in one process, and what becomes of a trained network.

    from fogwatch.learn import parallel_env

    env = parallel_env("yards", {"robots.count": 5, "point": 1}, actions="bearing")
    observations, infos = env.reset(seed=7)

`parallel_env` makes a PettingZoo environment, `one_env` a Gymnasium environment of one robot. Importing this package
registers them as ``fogwatch/patrol-v0`` and ``fogwatch/patrol-one-v0``. It needs the extra ``learn``. A network that
was trained in them runs as the policy ``learned`` (`Layers.save`). See docs/environments.md.
"""

from __future__ import annotations

import sys

import gymnasium
from pettingzoo import register

from agent.learned.network import Layers, action_of, flattened
from fogwatch.learn import environments
from fogwatch.learn.environments import OneRobotEnv, PatrolEnv, one_env, parallel_env
from fogwatch.learn.episode import Episode

__all__ = ["PARALLEL_ID", "SINGLE_ID", "Episode", "Layers", "OneRobotEnv", "PatrolEnv", "action_of", "flattened"]
__all__ += ["one_env", "parallel_env"]

PARALLEL_ID = "fogwatch/patrol-v0"
SINGLE_ID = "fogwatch/patrol-one-v0"

register("parallel", PARALLEL_ID, entry_point="fogwatch.learn:parallel_env")
gymnasium.register(SINGLE_ID, entry_point="fogwatch.learn:one_env")

# Specifications and pickles that users saved with 1.0 name the modules of then.
for _module in ("one", "parallel"):
    sys.modules[f"fogwatch.learn.{_module}"] = environments
