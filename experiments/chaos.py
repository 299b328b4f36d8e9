"""Chaos: many short random scenarios under random faults, and what must hold in each of them.

A scenario is run in several ways. None may fail, every verdict must be valid, and all traces must be equal. Where that
does not hold, `narrow` looks for fewer faults that break it in the same way. A run that takes too long says nothing of
that: `TooSlow`.
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
from patrol.ground.builtins import builtin_terrain
from patrol.random import Purpose
from patrol.scenario import Scenario, as_mapping, dump_scenario, load_scenario
from patrol.scenario.faults.delays import Dice
from patrol.scenario.faults.kinds import nothing
from worldsim.run_record import COMPLETED, DESERTED
from worldsim.verdict.judge import Verdict

KEY = b"chaos has no secrets"
"""The fleets' key, where they have one."""
LIMIT_S = 600.0
"""Wall time after which a run of a few seconds is broken off; see `TooSlow`."""
MOST_TRIES = 200
"""Runs that `narrow` makes at most."""

PACKAGES = ("patrol", "agent", "worldsim", "experiments", "fogwatch")

SPARE = 0.3
"""Share of the fleets that a spare robot joins."""

DIFFERENT = "traces differ"
"""The kind of breakage where ways of running a scenario do not give the same trace."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Ran:
    """What one way of running a scenario came to. ended: why, as in the journal."""

    trace: str
    verdict: Verdict
    ended: str


@dataclass(frozen=True, slots=True)
class Breakage:
    """What did not hold. kind: the same for breakages that are alike. detail: for people, maybe of many lines."""

    kind: str
    detail: str


class TooSlow(Exception):
    """A run was broken off because it took too long, so nobody knows whether it holds."""


class Patience:
    """Tells when a run has taken `LIMIT_S` of wall time since it began."""

    def __init__(self) -> None:
        self._end = math.inf
        self._lost = False

    def begin(self) -> None:
        """Time counts from now on."""
        self._end = time.monotonic() + LIMIT_S

    def lost(self) -> bool:
        """Whether the run shall stop; a run asks for it, and never does if it is done in time."""
        self._lost = self._lost or time.monotonic() > self._end
        return self._lost

    def check(self, ended: str) -> None:
        """Raise `TooSlow` for a run that ended so because it was told to stop."""
        if self._lost and ended not in (COMPLETED, DESERTED):
            raise TooSlow(f"broken off after {LIMIT_S:g} s")


Way = Callable[[Scenario], Ran]


# --- one scenario ----------------------------------------------------------------------------------------------------


def random_scenario(seed: int, key: Path) -> Scenario:
    """A short scenario that `seed` alone decides, with its faults written out.

    key: the file that a fleet's key is in, where it has one.
    """
    dice = Dice(seed, Purpose.CHAOS)
    step = dice.choice(0.5, 0.5, 0.5, 0.25, 1.0)
    ticks = dice.whole(60, 140)
    quiet = ticks // 4
    kinds = dice.choice(("car",), ("holonomic",), ("car", "holonomic"))
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


def _robot(dice: Dice, kinds: Sequence[str]) -> dict[str, Any]:
    return {
        "model": dice.choice(*kinds),
        "speed": dice.between(1.0, 5.0),
        "radius": dice.choice(0.3, 1.0),
        "turning_radius": dice.between(1.0, 4.0),
    }


def _sensor(dice: Dice) -> dict[str, Any]:
    return {
        "range": dice.between(4.0, 20.0),
        "angle": dice.choice(360, 360, 180, 90),
        "line_of_sight": dice.choice(True, False),
        "quality": dice.choice(1.0, 0.5, [[2, 1.0], [10, 0.3]]),
    }


def _patrol(dice: Dice) -> dict[str, Any]:
    direction = dice.choice("mode", "mode", "vector")
    mechanisms = ["claims", "artificial-obstacles", "semaphores", "repulsion"]
    return {
        "fow": dice.choice("f1", "f2", "f3", "f4", "f5"),
        "distance": dice.choice("g1", "g2", "g3", "g4", "g5"),
        "paths": dice.choice("wave", "straight", "regions"),
        "direction": direction,
        "sectors": dice.choice(8, 5, 16),
        "dilatation": dice.choice(0, 3, 5),
        "avoidance": dice.choice("none", "goal-refinement", *(["fuzzy"] if direction == "mode" else [])),
        "separation": dice.choice("none", dice.choice(*mechanisms), dice.some(mechanisms, len(mechanisms))),
        "random_move": dice.between(0.0, 0.3),
        "give_way": dice.choice(True, False),
    }


def _intruder(dice: Dice, terrain: str, point: float) -> dict[str, Any]:
    free = np.argwhere(builtin_terrain(terrain, point).free)
    row, col = (int(value) for value in free[dice.whole(0, len(free) - 1)])
    return {"place": [(col + 0.5) * point, (row + 0.5) * point], "at": dice.between(0.0, 20.0)}


# --- whether it holds ------------------------------------------------------------------------------------------------


def in_process(scenario: Scenario) -> Ran:
    """One run in this process, its records judged when it is over."""
    patience = Patience()
    patience.begin()
    return _ran(run_in_process(scenario, stop=patience.lost), patience)


def replayed(scenario: Scenario) -> Ran:
    """The same from the scenario as a file, judged as it goes on."""
    with tempfile.TemporaryDirectory(prefix="fogwatch-chaos-") as folder:
        file = Path(folder) / "scenario.yaml"
        file.write_text(dump_scenario(scenario), encoding="utf-8")
        again = load_scenario(file)
    patience = Patience()
    patience.begin()
    return _ran(run_in_process(again, keep=False, verify_fog=False, stop=patience.lost), patience)


def _ran(outcome: Outcome, patience: Patience) -> Ran:
    end = outcome.journal.end
    ended = end.reason if end else ""
    patience.check(ended)
    return Ran(outcome.summary["trace_hash"], outcome.verdict, ended)


IN_ONE_PROCESS: Mapping[str, Way] = {"in process": in_process, "replayed": replayed}


def examine(scenario: Scenario, ways: Mapping[str, Way]) -> Breakage | None:
    """Run a scenario in all ways; the first thing that does not hold, or None. Raises `TooSlow`, with the way."""
    traces: dict[str, str] = {}
    for name, way in ways.items():
        try:
            ran = way(scenario)
        except TooSlow as slow:
            raise TooSlow(f"{name}: {slow}") from None
        except BadInput as bad:
            return Breakage(f"{name}: refused", str(bad))
        except Exception as error:  # noqa: BLE001 - whatever it is, finding it is the purpose
            return Breakage(f"{name}: {type(error).__name__} at {_raised_at(error)}", traceback.format_exc())
        if ran.ended not in (COMPLETED, DESERTED):
            return Breakage(f"{name}: not completed", ran.ended)
        if not ran.verdict.valid:
            failed = ran.verdict.failed
            details = "\n".join(f"{check.name}: {check.detail}" for check in failed)
            return Breakage(f"{name}: {ran.verdict.outcome} by {', '.join(check.name for check in failed)}", details)
        traces[name] = ran.trace
    if len(set(traces.values())) > 1:
        return Breakage(DIFFERENT, "\n".join(f"{name}: {trace}" for name, trace in traces.items()))
    return None


def _raised_at(error: Exception) -> str:
    """The innermost place in our own code, as module:line."""
    places = [
        f"{module}:{line}"
        for frame, line in traceback.walk_tb(error.__traceback__)
        if (module := str(frame.f_globals.get("__name__"))).partition(".")[0] in PACKAGES
    ]
    return places[-1]


# --- fewer faults ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Fewest(Generic[T]):
    """Items that still break. least: whether it was tried for each of them that they do not without it."""

    items: tuple[T, ...]
    least: bool


@dataclass(frozen=True, slots=True)
class Narrowed:
    """A scenario whose other faults do nothing, those that it keeps, and whether none of them can be left out."""

    scenario: Scenario
    kept: tuple[Any, ...]
    least: bool


def with_faults(scenario: Scenario, faults: Sequence[Any]) -> Scenario:
    """The scenario with these of its faults alone, under the ids that they have and with the same draws.

    A fault's place in the list enters its draws. So what is left out before another leaves something at its place that
    does nothing: a clock that is not wrong.
    """
    ids = {fault.id for fault in faults}
    last = max((place for place, fault in enumerate(scenario.faults) if fault.id in ids), default=-1)
    mapping = as_mapping(scenario)
    entries = mapping.get("faults", [])[: last + 1]
    who, step = scenario.roster[0].name, scenario.step
    filled = [entry if entry["id"] in ids else nothing(entry["id"], 0.0, step, who) for entry in entries]
    return load_scenario(mapping | {"faults": filled})


def narrow(scenario: Scenario, breaks: Callable[[Scenario], bool], most: int = MOST_TRIES) -> Narrowed:
    """A scenario that `breaks` with as few of its faults as delta debugging finds in `most` tries."""
    found = fewest(list(scenario.faults), lambda faults: breaks(with_faults(scenario, faults)), most)
    return Narrowed(with_faults(scenario, found.items), found.items, found.least)


def fewest(items: Sequence[T], breaks: Callable[[Sequence[T]], bool], most: int = MOST_TRIES) -> Fewest[T]:
    """Some of the items, in their order, that still break, of which none can be left out; fewer tries may end earlier.

    Delta debugging (Zeller and Hildebrandt, "Simplifying and isolating failure-inducing input", 2002): parts of the
    items are left out, ever smaller ones, as long as what remains breaks. All of them together must break.
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
