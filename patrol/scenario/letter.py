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

A rule that is named has to have an effect in the scenario. `letter: true` takes those that have one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from pydantic import Tag

from patrol.values.section import wrong
from patrol.values.types import Flag, at_least, by_shape, expecting

if TYPE_CHECKING:
    from patrol.scenario.policies import PaperPatrol

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


def rules_of(letter: Letter) -> frozenset[PaperRule]:
    """Return the rules of the paper that replace ours.

    Args:
        letter: The option.
    """
    if isinstance(letter, bool):
        return frozenset(PAPER_RULES if letter else ())
    return frozenset((letter,) if isinstance(letter, str) else letter)


def check_letter(patrol: PaperPatrol, models: Iterable[str], intruders: bool) -> None:
    """Refuse a rule that has no effect, and what contradicts the whole letter.

    Args:
        patrol: The scenario's section.
        models: Those of the robots.
        intruders: Whether there are any.

    Raises:
        PydanticCustomError: It names the field and the remedy.
    """
    letter, bodies = patrol.options.letter, set(models)
    if letter is True:
        _check_whole(patrol, bodies)
    elif letter is not False:
        named = rules_of(letter)
        for rule, (has_effect, remedy) in _needs(patrol, bodies, intruders).items():
            if rule in named and not has_effect:
                raise wrong(FIELD, f"{rule} has no effect here; drop it, or {remedy}")


def _check_whole(patrol: PaperPatrol, bodies: set[str]) -> None:
    if "differential" in bodies:
        remedy = "set their model to holonomic or car, or name the rules that you want"
        raise wrong(FIELD, f"true, and the paper has no differential robots; {remedy}")
    for field, ours in (("give_way", "give way"), ("manoeuvres", "search for manoeuvres")):
        if getattr(patrol, field):
            problem = f"true, and {FIELD} is true: the paper's robots do not {ours}; set {field} to false, or drop it"
            raise wrong(f"patrol.{field}", problem)


def _needs(patrol: PaperPatrol, bodies: set[str], intruders: bool) -> dict[PaperRule, tuple[bool, str]]:
    """Return, by rule, whether the scenario has what it acts on, and how to get that."""
    options = patrol.options
    return {
        "first-step": (options.paths == "wave", "set patrol.options.paths to wave"),
        "no-stop": (bodies != {"car"}, "set a robot's model to holonomic"),
        "whole-square": (patrol.avoidance == "goal-refinement", "set patrol.avoidance to goal-refinement"),
        "square-window": (options.dilatation != 0.0, "give a patrol.options.dilatation above 0"),
        "plain-unstuck": ("car" in bodies, "set a robot's model to car"),
        "surround-forces": (intruders, "give intruders"),
    }
