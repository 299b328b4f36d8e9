"""The environments' names in the registries of PettingZoo and Gymnasium."""

from __future__ import annotations

import gymnasium
from pettingzoo import register

PARALLEL_ID = "fogwatch/patrol-v0"
SINGLE_ID = "fogwatch/patrol-one-v0"

register("parallel", PARALLEL_ID, entry_point="fogwatch.learn.parallel:parallel_env")
gymnasium.register(SINGLE_ID, entry_point="fogwatch.learn.one:one_env")
