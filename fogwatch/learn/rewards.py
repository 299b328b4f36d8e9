"""Rewards of an environment, all from the true fog; the same for each robot, since the fog is the fleet's.

With A(k) the mean age of all patrolled points after tick k, and M(k) the age of the stalest one, the true MFoW, in s:

    mean     -A(k)
    mfow     -M(k)
    change   A(k - 1) - A(k), which adds up to the change over an episode; A(-1) = 0

A step that takes several ticks gets the sum of theirs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from patrol.errors import BadInput, did_you_mean

if TYPE_CHECKING:
    from patrol.journal import TickRecord

Reward = Callable[["TickRecord | None", "TickRecord", float], float]
"""Takes the record of the tick before, None at the first, that of the tick, and s per tick."""


def minus_mean(before: TickRecord | None, record: TickRecord, step: float) -> float:
    """Return minus the mean age, s."""
    del before
    return -record.fog_mean * step


def minus_mfow(before: TickRecord | None, record: TickRecord, step: float) -> float:
    """Return minus the MFoW, s."""
    del before
    return -record.mfow * step


def minus_change(before: TickRecord | None, record: TickRecord, step: float) -> float:
    """Return how much the mean age has fallen, s."""
    return ((0.0 if before is None else before.fog_mean) - record.fog_mean) * step


REWARDS: dict[str, Reward] = {"mean": minus_mean, "mfow": minus_mfow, "change": minus_change}


def reward_of(reward: str | Reward) -> Reward:
    """Return a reward by its name, or one's own.

    Args:
        reward: The name, or a function like those of this module.

    Raises:
        BadInput: There is none of that name.
    """
    if not isinstance(reward, str):
        return reward
    if reward not in REWARDS:
        raise BadInput(f"reward = {reward!r}: no such reward; {did_you_mean(reward, list(REWARDS))}")
    return REWARDS[reward]
