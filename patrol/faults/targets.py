"""The targets of a fault: robots by name, or a number of robots that are drawn.

Which robots `one`, `half` and the like are is drawn from (seed, Purpose.FAULT, the fault's index, the field, robot):
the robots with the lowest draws. So it depends on no other fault, and on nothing that happens in a run. Spare robots
are among all and in no draw, so that a fault means the same robots with them and without.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from enum import IntEnum
from typing import Annotated

from pydantic import Field, Tag

from patrol.random import Purpose, draw
from patrol.values import Count, OneOf, RobotName, Share, at_least, by_shape, expecting, wrong

WORDS = ("one", "minority", "half", "all")
"""Targets by size; in a target these words never mean a robot of that name, in a list of names they do."""


class TargetField(IntEnum):
    """The one of a fault's targets that a draw is for."""

    WHO = 0
    FROM = 1
    TO = 2
    GROUPS = 3
    AS = 4


Drawing = tuple[int, int, TargetField]
"""Arguments of a target's draw: the scenario's seed, the fault's place among all faults, and the field."""


class Some(OneOf):
    """A number of robots, or a share of all, drawn from the seed."""

    CHOICE = "{count: N} or {fraction: SHARE}"

    count: Count | None = Field(None, description="how many robots")
    fraction: Share | None = Field(None, description="share of all robots, rounded half up, at least one")


WHO = "a robot's name, a list of names, one, minority, half, all, {count: N} or {fraction: SHARE}"
Names = Annotated[tuple[RobotName, ...], at_least(1, "names")]
Who = Annotated[
    Annotated[RobotName, expecting(WHO), Tag("=single")]
    | Annotated[Names, Tag("=list")]
    | Annotated[Some, Tag("=mapping")],
    by_shape(WHO),
]


def check_who(who: str | tuple[str, ...] | Some, names: Sequence[str], fleet: int, where: str) -> None:
    """Raise when a target cannot be among some robots, or holds none.

    `fleet` counts the robots that are not spare, `names` has all.
    """
    if isinstance(who, Some):
        if who.count is not None and who.count > fleet:
            raise wrong(f"{where}.count", f"there are {fleet} robots; give at most {fleet}", who.count)
    elif isinstance(who, str):
        if who not in WORDS:
            check_name(who, names, where)
        elif who == "minority" and fleet == 1:
            raise wrong(where, "there is one robot, so a minority is nobody; write one or all")
    else:
        for index, name in enumerate(who):
            check_name(name, names, f"{where}.{index}")
            if name in who[:index]:
                raise wrong(f"{where}.{index}", f"{name} is in the list twice; remove one")


def check_name(name: str, names: Sequence[str], where: str) -> None:
    """Raise when no robot has a name."""
    if name not in names:
        near = get_close_matches(name, names, n=1, cutoff=0.6)
        some = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
        raise wrong(where, f"there is no robot {name}; {f'did you mean {near[0]}?' if near else f'robots are {some}'}")


def meant(
    who: str | tuple[str, ...] | Some, numbers: Mapping[str, int], spares: frozenset[int], drawing: Drawing
) -> tuple[int, ...]:
    """Return the numbers of the robots that a target means, ascending; `check_who` has checked it."""
    if isinstance(who, tuple):
        return tuple(sorted(numbers[name] for name in who))
    if isinstance(who, str) and who not in WORDS:
        return (numbers[who],)
    if who == "all":
        return tuple(sorted(numbers.values()))
    # Without spares: a fault means the same robots, however many might join.
    fleet = [number for number in numbers.values() if number not in spares]
    return tuple(sorted(in_drawn_order(fleet, drawing)[: size_of(who, len(fleet))]))


def in_drawn_order(numbers: Iterable[int], drawing: Drawing) -> list[int]:
    """Sort robots into an order drawn for one field of one fault."""
    seed, index, field = drawing
    # The number decides between equal draws, which may happen.
    return sorted(numbers, key=lambda number: (draw(seed, Purpose.FAULT, index, field, number), number))


def size_of(who: str | Some, robots: int) -> int:
    """Return the number of robots that a target by size means.

    For example, of 5 robots a minority is 2, half is 2, and a fraction of 0.5 is 3.
    """
    if isinstance(who, Some):
        if who.count is not None:
            return who.count
        return max(1, math.floor((who.fraction or 0.0) * robots + 0.5))
    sizes = {"one": 1, "minority": max((robots - 1) // 2, min(robots - 1, 1)), "half": max(robots // 2, 1)}
    return sizes.get(who, robots)
