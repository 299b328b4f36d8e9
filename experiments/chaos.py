"""Chaos: many short random scenarios under random faults, and what must hold in each of them.

A scenario is run in several ways. None may fail, every verdict must be valid, and all traces must be equal. Where that
does not hold, `narrow` looks for fewer faults that break it in the same way. A run that takes too long proves nothing
either way: `TooSlow`.
"""

from __future__ import annotations

import math
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from experiments.inprocess import Outcome, run_in_process
from patrol.errors import BadInput
from patrol.ground.maps.builtins import builtin_terrain
from patrol.random import Draws, Purpose
from patrol.scenario import Scenario, as_mapping, dump_scenario, load_scenario
from patrol.scenario.faults.kinds import nothing
from worldsim.run_record import COMPLETED, DESERTED
from worldsim.verdict.judge import Verdict

KEY = b"chaos has no secrets"
"""The key of fleets that have one."""
LIMIT_S = 600.0
"""Wall time after which a run, which should take seconds, is broken off; see `TooSlow`."""
MOST_TRIES = 200
"""Limit of the runs that `narrow` makes."""

PACKAGES = ("patrol", "agent", "worldsim", "experiments", "fogwatch")

SPARE = 0.3
"""Share of the fleets that have a spare robot, which joins."""

DIFFERENT = "traces differ"
"""Problem where the ways of running a scenario do not give the same trace."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class WayResult:
    """The result of one way of running a scenario.

    Attributes:
        trace: The trace hash.
        verdict: The verdict.
        ended: Why the run ended, as in the journal.
    """

    trace: str
    verdict: Verdict
    ended: str


@dataclass(frozen=True, slots=True)
class Breakage:
    """A promise that did not hold in a scenario.

    Attributes:
        what: What went wrong, in words that are the same for breakages of the same sort.
        detail: More of it for people, possibly many lines.
        way: The way of running the scenario that went wrong; empty where two ways differ.
    """

    what: str
    detail: str
    way: str = ""

    @property
    def kind(self) -> str:
        """The way and what went wrong; equal for breakages of the same sort."""
        return f"{self.way}: {self.what}" if self.way else self.what


class TooSlow(Exception):
    """A run was broken off because it took too long, so that it is unknown whether it holds."""


class TimeLimit:
    """Reports when a run has taken `LIMIT_S` of wall time since it began."""

    def __init__(self) -> None:
        self._end = math.inf
        self._lost = False

    def begin(self) -> None:
        """Start the time."""
        self._end = time.monotonic() + LIMIT_S

    def exceeded(self) -> bool:
        """Return whether the time is over, so that the run must stop; runs call this again and again."""
        self._lost = self._lost or time.monotonic() > self._end
        return self._lost

    def check(self, ended: str) -> None:
        """Raise an error for a run that was stopped by the limit.

        Args:
            ended: Why the run ended, as in the journal.

        Raises:
            TooSlow: The run did not reach its end because the time was over.
        """
        if self._lost and ended not in (COMPLETED, DESERTED):
            raise TooSlow(f"broken off after {LIMIT_S:g} s")


Way = Callable[[Scenario], WayResult]


# --- one scenario ----------------------------------------------------------------------------------------------------


def random_scenario(seed: int, key: Path) -> Scenario:
    """Return a short random scenario with its faults written out.

    Args:
        seed: Decides the scenario.
        key: The file of the fleet's key, named in scenarios whose fleet has one.

    Returns:
        The scenario.
    """
    dice = Draws(seed, Purpose.CHAOS)
    step = dice.choice(0.5, 0.5, 0.5, 0.25, 1.0)
    ticks = dice.whole(60, 140)
    quiet = ticks // 4
    kinds = dice.choice(("car",), ("differential",), ("holonomic",), ("car", "differential", "holonomic"))
    robots = [_robot(dice, kinds) for _ in range(dice.whole(2, 6))]
    faults = dice.whole(3, 14)
    interval = max((ticks - quiet) * step / faults, step)
    radio: dict[str, Any] = {"trail": dice.whole(0, 4), "forget_after": dice.between(step, 20.0)}
    if dice.share() < 0.5:
        radio["key"] = str(key)
    terrain, point = dice.choice("open", "yards", "clutter", "site"), dice.choice(1.0, 2.0)
    joining: list[dict[str, Any]] = []
    if dice.share() < SPARE:
        robots.append({**_robot(dice, kinds), "spare": True})
        joining.append({"kind": "join", "who": f"r{len(robots)}", "at": dice.between(0.0, (ticks - quiet) * step)})
    return load_scenario(
        {
            "name": f"chaos-{seed}",
            "terrain": {"builtin": terrain},
            "point": point,
            "step": step,
            "duration": ticks * step,
            "seed": seed,
            "robots": robots,
            "sensor": _sensor(dice),
            "patrol": _patrol(dice),
            "radio": radio,
            "intruders": [_intruder(dice, terrain, point)] if dice.share() < 0.2 else [],
            "faults": joining,
            "nemesis": {"interval": interval, "quiet": quiet * step},
        }
    )


def _robot(dice: Draws, kinds: Sequence[str]) -> dict[str, Any]:
    return {
        "model": dice.choice(*kinds),
        "speed": dice.between(1.0, 5.0),
        "radius": dice.choice(0.3, 1.0),
        "turning_radius": dice.between(1.0, 4.0),
    }


def _sensor(dice: Draws) -> dict[str, Any]:
    return {
        "range": dice.between(4.0, 20.0),
        "angle": dice.choice(360, 360, 180, 90),
        "line_of_sight": dice.choice(True, False),
        "quality": dice.choice(1.0, 0.5, [[2, 1.0], [10, 0.3]]),
    }


def _patrol(dice: Draws) -> dict[str, Any]:
    policy = dice.choice("committed", "potential-field")
    mechanisms = ["claims", "artificial-obstacles", "semaphores"]
    options: dict[str, Any] = {"random_move": dice.between(0.0, 0.3)}
    if policy == "potential-field":
        mechanisms.append("repulsion")
        direction = dice.choice("mode", "mode", "vector")
        options |= {
            "fow": dice.choice("f1", "f2", "f3", "f4", "f5"),
            "distance": dice.choice("g1", "g2", "g3", "g4", "g5"),
            "paths": dice.choice("wave", "straight", "regions"),
            "direction": direction,
            "sectors": dice.choice(8, 5, 16),
            "dilatation": dice.choice(0, 3, 5),
            "fuzzy": direction == "mode" and dice.choice(False, False, True),
        }
    separation = dice.choice("none", dice.choice(*mechanisms), dice.some(mechanisms, len(mechanisms)))
    return {
        "policy": policy,
        "options": {**options, "separation": separation},
        "avoidance": dice.choice("none", "goal-refinement"),
        "give_way": dice.choice(True, False),
        "manoeuvres": dice.choice(True, False),
    }


def _intruder(dice: Draws, terrain: str, point: float) -> dict[str, Any]:
    free = np.argwhere(builtin_terrain(terrain, point).free)
    row, col = (int(value) for value in free[dice.whole(0, len(free) - 1)])
    return {"place": [(col + 0.5) * point, (row + 0.5) * point], "at": dice.between(0.0, 20.0)}


# --- whether it holds ------------------------------------------------------------------------------------------------


def in_process(scenario: Scenario) -> WayResult:
    """Run a scenario in this process and judge its records afterwards.

    Args:
        scenario: The scenario.

    Returns:
        The result.

    Raises:
        TooSlow: The run took too long.
    """
    limit = TimeLimit()
    limit.begin()
    return _ran(run_in_process(scenario, stop=limit.exceeded), limit)


def replayed(scenario: Scenario) -> WayResult:
    """Write a scenario to a file, read it again, run it in this process, and judge it tick by tick.

    Args:
        scenario: The scenario.

    Returns:
        The result.

    Raises:
        TooSlow: The run took too long.
    """
    with tempfile.TemporaryDirectory(prefix="fogwatch-chaos-") as folder:
        file = Path(folder) / "scenario.yaml"
        file.write_text(dump_scenario(scenario), encoding="utf-8")
        again = load_scenario(file)
    limit = TimeLimit()
    limit.begin()
    return _ran(run_in_process(again, keep=False, verify_fog=False, stop=limit.exceeded), limit)


def _ran(outcome: Outcome, limit: TimeLimit) -> WayResult:
    end = outcome.journal.end
    ended = end.reason if end else ""
    limit.check(ended)
    return WayResult(outcome.summary.trace_hash or "", outcome.verdict, ended)


IN_ONE_PROCESS: Mapping[str, Way] = {"in process": in_process, "replayed": replayed}


def examine(scenario: Scenario, ways: Mapping[str, Way]) -> Breakage | None:
    """Run a scenario in several ways.

    Args:
        scenario: The scenario.
        ways: The ways by name.

    Returns:
        The first thing that does not hold, or None.

    Raises:
        TooSlow: A run took too long; the message names the way.
    """
    traces: dict[str, str] = {}
    for name, way in ways.items():
        try:
            ran = way(scenario)
        except TooSlow as slow:
            raise TooSlow(f"{name}: {slow}") from None
        except BadInput as bad:
            return Breakage("refused", str(bad), name)
        except Exception as error:  # noqa: BLE001 - to find any error is the purpose
            problem = f"{type(error).__name__} at {_raised_at(error)}"
            return Breakage(problem, traceback.format_exc(), name)
        if ran.ended not in (COMPLETED, DESERTED):
            return Breakage("not completed", ran.ended, name)
        if not ran.verdict.valid:
            failed = ran.verdict.failed
            details = "\n".join(f"{check.name}: {check.detail}" for check in failed)
            problem = f"{ran.verdict.outcome} by {', '.join(check.name for check in failed)}"
            return Breakage(problem, details, name)
        traces[name] = ran.trace
    if len(set(traces.values())) > 1:
        return Breakage(DIFFERENT, "\n".join(f"{name}: {trace}" for name, trace in traces.items()))
    return None


def _raised_at(error: Exception) -> str:
    """Return the innermost place in our own code, as module:line."""
    places = [
        f"{module}:{line}"
        for frame, line in traceback.walk_tb(error.__traceback__)
        if (module := str(frame.f_globals.get("__name__"))).partition(".")[0] in PACKAGES
    ]
    return places[-1]


# --- fewer faults ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Fewest(Generic[T]):
    """The result of `fewest`.

    Attributes:
        items: Items that still break.
        least: Whether it is known that leaving out any one of them mends it.
    """

    items: tuple[T, ...]
    least: bool


@dataclass(frozen=True, slots=True)
class Narrowed:
    """The result of `narrow`.

    Attributes:
        scenario: The scenario; its faults are those kept, and some without an effect.
        kept: The faults that are kept.
        least: Whether it is known that none of them can be left out.
    """

    scenario: Scenario
    kept: tuple[Any, ...]
    least: bool


def with_faults(scenario: Scenario, faults: Sequence[Any]) -> Scenario:
    """Return a scenario with some of its faults, under the same ids and with the same random draws.

    A fault's place in the list enters its draws. A fault left out before another is therefore replaced by one without
    an effect: a clock fault with no offset.

    Args:
        scenario: The scenario.
        faults: Those of its faults that are kept.

    Returns:
        The new scenario.
    """
    ids = {fault.id for fault in faults}
    last = max((place for place, fault in enumerate(scenario.faults) if fault.id in ids), default=-1)
    mapping = as_mapping(scenario)
    entries = mapping.get("faults", [])[: last + 1]
    who, step = scenario.roster[0].name, scenario.step
    filled = [entry if entry["id"] in ids else nothing(entry["id"], 0.0, step, who) for entry in entries]
    return load_scenario(mapping | {"faults": filled})


def narrow(scenario: Scenario, breaks: Callable[[Scenario], bool], most: int = MOST_TRIES) -> Narrowed:
    """Reduce a scenario that breaks to few of its faults.

    Args:
        scenario: The scenario.
        breaks: Whether a scenario breaks in the same way.
        most: Limit of the calls of `breaks`.

    Returns:
        A scenario that still breaks.
    """
    fewest_faults = fewest(list(scenario.faults), lambda faults: breaks(with_faults(scenario, faults)), most)
    return Narrowed(with_faults(scenario, fewest_faults.items), fewest_faults.items, fewest_faults.least)


def fewest(items: Sequence[T], breaks: Callable[[Sequence[T]], bool], most: int = MOST_TRIES) -> Fewest[T]:
    """Reduce items to few that still break, by delta debugging.

    Parts of the items are left out, ever smaller ones, as long as the rest breaks (Zeller and Hildebrandt, "Simplifying
    and isolating failure-inducing input", 2002).

    Args:
        items: The items, which together must break.
        breaks: Whether some of the items break.
        most: Limit of the calls of `breaks`.

    Returns:
        Items that still break, in their order. None of them can be left out, unless the limit was reached.
    """
    kept = list(items)
    tries = 0

    def still(part: list[T]) -> bool:
        nonlocal tries
        tries += 1
        return breaks(part)

    if kept and still([]):
        return Fewest((), True)
    parts = 2
    while len(kept) > 1:
        size = -(-len(kept) // parts)
        for begin in range(0, len(kept), size):
            rest = kept[:begin] + kept[begin + size :]
            if tries >= most:
                return Fewest(tuple(kept), False)
            if still(rest):
                kept = rest
                parts = max(parts - 1, 2)
                break
        else:
            if size == 1:
                break
            parts = min(2 * parts, len(kept))
    return Fewest(tuple(kept), True)
