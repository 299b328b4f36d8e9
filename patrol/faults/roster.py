"""Checks of a scenario's faults against its robots, the ground that closes and its duration."""

from __future__ import annotations

import math
from collections.abc import Sequence

from patrol.errors import did_you_mean
from patrol.faults.kinds import STRANGER, Fault, Forgery, OnGround, OnLinks, Partition, Spoof
from patrol.faults.targets import Drawing, TargetField, check_name, check_who, meant
from patrol.values import wrong


def tick_of(at: float, step: float) -> int:
    """Return the first tick that is not before a time; `at` and `step` are in s.

    For example, 3 for 1.2 s with steps of 0.5 s.
    """
    # Less a little: 0.3 s with steps of 0.1 s are tick 3, although the quotient is a little more than 3.
    return math.ceil(at / step - 1e-9)


def ticks_of(lasts: float, step: float) -> int:
    """Convert a duration (s) to ticks, half a tick rounded up; at least one.

    For example, 2 for 1.2 s and 3 for 1.25 s with steps of 0.5 s.
    """
    return max(1, math.floor(lasts / step + 0.5 + 1e-9))


def check_faults(
    faults: Sequence[Fault],
    names: Sequence[str],
    spares: frozenset[int],
    parts: Sequence[str],
    step: float,
    ticks: int,
    seed: int,
) -> None:
    """Raise for the first fault that the roster, the closable parts of the ground or the duration rule out.

    Such a fault names no robot of the roster, wants too many or none, cuts no robot off, forges in no other name, names
    no such part, or comes after the last tick. `names` are of the whole roster, in the order of the robots' numbers;
    targets by size are of the robots that are not spare.
    """
    fleet = len(names) - len(spares)
    for index, fault in enumerate(faults):
        where = f"faults.{index}"
        if tick_of(fault.at, step) >= ticks:
            latest = max(fault.at for fault in faults)
            ends = (
                f"the run ends at {ticks * step:g} s, so it would never happen; give an earlier time or a duration "
                f"above {latest:g}, or leave the {fault.kind} out"
            )
            raise wrong(f"{where}.at", ends, fault.at)
        for name, field in type(fault).model_fields.items():
            if name in ("who", "sources", "targets", "victims"):
                check_who(getattr(fault, name), names, fleet, f"{where}.{field.alias or name}")
        if isinstance(fault, Partition):
            _check_partition(fault, names, fleet, f"{where}.groups")
        if isinstance(fault, Spoof) and fault.by != STRANGER:
            _check_insider(fault, names, spares, (seed, index, TargetField.AS))
        if isinstance(fault, OnLinks):
            _check_links(fault, names, spares, seed, index)
        if isinstance(fault, OnGround) and fault.part not in parts:
            hint = did_you_mean(fault.part, parts) if parts else "the scenario has none; list it in closures"
            raise wrong(f"{where}.closure", f"there is no closure {fault.part}; {hint}")


def _check_partition(fault: Partition, names: Sequence[str], fleet: int, where: str) -> None:
    if not isinstance(fault.groups, str):
        _check_groups(fault.groups, names, where)
    elif fleet == 1:
        raise wrong(where, "there is one robot, and nobody to cut it off from; leave the partition out")


def _check_links(fault: OnLinks, names: Sequence[str], spares: frozenset[int], seed: int, place: int) -> None:
    """Raise if the draws leave no link, with one robot as both sender and receiver."""
    numbers = {name: number for number, name in enumerate(names, start=1)}
    sources = meant(fault.sources, numbers, spares, (seed, place, TargetField.FROM))
    if (
        len(names) > 1
        and sources == meant(fault.targets, numbers, spares, (seed, place, TargetField.TO))
        and len(sources) == 1
    ):
        name = names[sources[0] - 1]
        raise wrong(f"faults.{place}.to", f"with seed {seed} sender and receiver are both {name}; name one of them")


def _check_insider(fault: Spoof, names: Sequence[str], spares: frozenset[int], drawing: Drawing) -> None:
    """Raise unless a robot forges in another's name; invented robots have names of their own."""
    seed, index, _ = drawing
    where = f"faults.{index}"
    check_name(fault.by, names, f"{where}.by")
    # It forges in the names of robots that do not exist, whatever its own.
    if isinstance(fault.payload, Forgery) and fault.payload.invented is not None:
        return
    numbers = {name: number for number, name in enumerate(names, start=1)}
    if meant(fault.victims, numbers, spares, drawing) != (numbers[fault.by],):
        return
    drawn = len(names) > 1 and fault.victims not in (fault.by, (fault.by,))
    victim = f"with seed {seed} the only victim" if drawn else "the only victim"
    raise wrong(f"{where}.as", f"{victim} is {fault.by}, which forges; name another victim, or change by")


def _check_groups(groups: tuple[tuple[str, ...], ...], names: Sequence[str], where: str) -> None:
    homes: dict[str, int] = {}
    for index, group in enumerate(groups):
        for member, name in enumerate(group):
            check_name(name, names, f"{where}.{index}.{member}")
            if name in homes:
                twice = "listed twice" if homes[name] == index else f"in group {homes[name]} too"
                raise wrong(f"{where}.{index}.{member}", f"{name} is {twice}; a robot is in one group")
            homes[name] = index
    if len(groups) == 1 and len(homes) == len(names):
        raise wrong(where, "one group holds all robots, so nobody is cut off; leave some out")
