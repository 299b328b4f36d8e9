"""The paper to the letter: which rules of ours a patrol replaces by the paper's (`patrol.options.letter`).

    letter: true                       the paper: every rule below, no giving way, no manoeuvres
    letter: [first-step, no-stop]      two of the paper's rules, and ours otherwise

| rule | the paper's robot |
|---|---|
| first-step | takes for the direction of a force the first of eight steps of the wave's path, not its first bend |
| one-direction | tries the strongest direction only, although a wall may be right there |
| no-stop | does not stop at a stale place close by (cars never do) |
| far-goal | has its goal at the goal distance, although a wall may be in between |
| whole-square | may refine its goal to any point of the square, also to the side or behind a wall |
| square-window | spreads staleness over a square, through walls |
| plain-unstuck | gets out of dead ends by the five printed steps alone, without draws (cars) |
| surround-forces | surrounds an intruder by attraction and repulsion, not by places on a ring |

The paper does not say with which of the equally long paths to a point `first-step` goes (`patrol.options.ties`): the
one that begins diagonally, the one that begins straight, or one that is drawn. On open ground nearly all points have a
path that begins diagonally and one that does not, so a fixed choice puts nearly all forces into four of the eight
directions. Only `drawn` favours none.

A rule that is named has to have an effect in the scenario (`patrol.scenario.policies.check_letter`). `letter: true`
takes those that have one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, get_args

from pydantic import Tag

from patrol.values.types import Flag, at_least, by_shape, expecting

LATER_OPTIONS: Mapping[str, object] = {"letter": False, "ties": "diagonal", "origin": "point"}
"""Settings of `potential-field` that came later, and the values that change nothing."""

TO_THE_LETTER: Mapping[str, object] = {
    "patrol.options.letter": True,
    "patrol.options.ties": "drawn",
    "patrol.options.random_move_for": "all",
}
"""The paper to the letter, by dotted field of the scenario; of random steps it says "each robot", so cars make them."""

PaperRule = Literal[
    "first-step",
    "one-direction",
    "no-stop",
    "far-goal",
    "whole-square",
    "square-window",
    "plain-unstuck",
    "surround-forces",
]
Ties = Literal["diagonal", "straight", "drawn"]
"""Which of equally long paths of the wave gives its first step, with the rule `first-step`."""

PAPER_RULES: tuple[PaperRule, ...] = get_args(PaperRule)

LETTER = f"true (all) | false (none) | {' | '.join(PAPER_RULES)}, or a list"
Letter = Annotated[
    Annotated[Flag | PaperRule, expecting(LETTER), Tag("=single")]
    | Annotated[
        tuple[Annotated[PaperRule, expecting(LETTER)], ...],
        at_least(1, "rules"),
        Tag("=list"),
    ],
    by_shape(LETTER),
]

FIELD = "patrol.options.letter"
"""The option's place in a scenario."""


def rules_of(letter: Letter) -> frozenset[PaperRule]:
    """Return the rules of the paper that replace ours."""
    if isinstance(letter, bool):
        return frozenset(PAPER_RULES if letter else ())
    return frozenset((letter,) if isinstance(letter, str) else letter)
