"""Spells: one run of a small fleet each, with one stranger beside it. A seed decides all of it but the timing."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from patrol.random import Draws, Purpose
from patrol.scenario import Scenario, load_scenario
from runtime.security.roles import VIEWER, Role, robot_role

SCENARIO, ATTACKS = 1, 2
"""What draws are for, after the seed and the purpose: the spell itself, and the stranger's attacks."""

PACE = 10.0
"""Factor of real time of the fleets that keep a pace."""
AT_A_PACE = 0.3
"""Share of the fleets that keep one; the others run in lockstep, and their traces can be compared."""
RESTARTED = 0.5
"""Share of the fleets in which a robot is killed and started again, so that its seat is free for a while."""
WITH_A_PAGE = 0.3
"""Share of the fleets that have a page."""


class Holds(StrEnum):
    """What a stranger holds."""

    NOTHING = "no secret"
    VIEWER = "a viewer's credentials"
    ROBOT = "a robot's credentials"


@dataclass(frozen=True, slots=True)
class Spell:
    """One run of a fleet, and its stranger.

    Attributes:
        seed: Decides the rest.
        holds: What the stranger holds.
        victim: The robot whose credentials the stranger holds, or whose name it uses first.
        page: Whether the run has a page.
        scenario: The fleet's scenario.
        only: Names of the attacks that the stranger makes; empty for all that it can.
    """

    seed: int
    holds: Holds
    victim: str
    page: bool
    scenario: Scenario
    only: tuple[str, ...] = ()

    @property
    def lockstep(self) -> bool:
        """Whether the run is repeatable, so that its trace can be compared."""
        return self.scenario.pace == "lockstep"

    @property
    def who(self) -> str:
        """The stranger in words."""
        return f"{self.victim}'s credentials" if self.holds is Holds.ROBOT else str(self.holds)


def draw_spell(seed: int) -> Spell:
    """Draw a spell."""
    dice = Draws(seed, Purpose.STRANGER, SCENARIO)
    holds = dice.choice(*Holds)
    names = [f"r{number}" for number in range(1, 4)]
    victim = dice.choice(*names)
    paced = dice.share() < AT_A_PACE
    ticks = dice.whole(150, 250) if paced else dice.whole(500, 1000)
    faults: list[dict[str, Any]] = []
    if dice.share() < RESTARTED:
        killed = dice.whole(ticks // 5, ticks // 2)
        who = dice.choice(*names)
        faults = [
            {"kind": "kill", "who": who, "at": killed * 0.5},
            {"kind": "restart", "who": who, "at": (killed + dice.whole(2, ticks // 5)) * 0.5},
        ]
    scenario = load_scenario(
        {
            "name": f"hostile-{seed}",
            "terrain": {"builtin": dice.choice("open", "yards")},
            "point": 1.0,
            "step": 0.5,
            "duration": ticks * 0.5,
            "seed": seed,
            "pace": PACE if paced else "lockstep",
            "robots": [{"name": name, "model": dice.choice("car", "differential", "holonomic")} for name in names],
            "faults": faults,
        }
    )
    return Spell(seed, holds, victim, dice.share() < WITH_A_PAGE, scenario)


def role_of_stranger(holds: Holds, victim: str) -> Role | None:
    """The role in which a stranger gets in; None for one that holds nothing."""
    match holds:
        case Holds.NOTHING:
            return None
        case Holds.VIEWER:
            return VIEWER
        case Holds.ROBOT:
            return robot_role(victim)
