"""The scenario's section about its nemesis; `patrol.scenario.load` draws the faults.

The draws of a nemesis for each kind of fault, and what heals it.

A kind without an entry in `DRAWN` is never drawn, and a scenario whose nemesis lists it is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, Tag

from patrol.faults.kinds import STRANGER
from patrol.faults.roster import tick_of
from patrol.random import Draws
from patrol.values import NotNegative, Positive, Section, Seed, at_least, by_shape, expecting, wrong


class When:
    """Beginning and end of a fault, in ticks."""

    def __init__(self, step: float, begin: int, end: int) -> None:
        self.step, self.begin, self.end = step, begin, end

    @property
    def at(self) -> dict[str, float]:
        """The beginning, as fields of a fault."""
        return {"at": self._tick_time_s(self.begin)}

    @property
    def healed(self) -> dict[str, float]:
        """The beginning of the fault that heals it, as fields."""
        return {"at": self._tick_time_s(self.end)}

    @property
    def lasting(self) -> dict[str, float]:
        """Beginning and length, as fields of a fault.

        For example, ``{"at": 2.0, "for": 3.0}`` from tick 4 to tick 10 with steps of 0.5 s.
        """
        return {**self.at, "for": round((self.end - self.begin) * self.step, 6)}

    def _tick_time_s(self, k: int) -> float:
        """Return a tick's time in s, with few digits where they say the same."""
        time_s = round(k * self.step, 6)
        # A rounded time may fall to the tick after; then the long number is written.
        return time_s if tick_of(time_s, self.step) == k else k * self.step


class RobotsHit:
    """The robots that suffer process faults, with their times."""

    def __init__(self, names: Sequence[str], spared: set[str]) -> None:
        self.names = list(names)
        self._spared = spared
        self._busy: list[tuple[str, int, int]] = []

    def free(self, begin: int, end: int) -> list[str]:
        """List the robots that suffer no fault from one tick to another, both included."""
        busy = {name for name, first, last in self._busy if first <= end and begin <= last}
        return [name for name in self.names if name not in busy and name not in self._spared]

    def take(self, draws: Draws, begin: int, end: int, leave: int = 1) -> list[str]:
        """Draw robots for a fault from one tick to another; none when none can suffer one.

        leave: how many of those that are free then are left alone.
        """
        free = self.free(begin, end)
        if len(free) <= leave:
            return []
        chosen = draws.some(free, len(free) - leave)
        self._busy += [(name, begin, end) for name in chosen]
        return chosen

    def any(self, draws: Draws) -> str | list[str]:
        """All, or some, whatever they suffer."""
        some = draws.some(self.names, len(self.names))
        return "all" if draws.share() < 0.5 else some


# --- what is drawn for each kind -------------------------------------------------------------------------------------

Found = list[dict[str, Any]]


def draw_fault(draws: Draws, kinds: Sequence[str], robots: RobotsHit, when: When) -> Found:
    """Draw a fault: of the kinds, the first in a drawn order that can happen now.

    Kinds are keys of `DRAWN`. The result is the fault and what heals it, as entries of a scenario's `faults` without
    ids; empty when none can happen. `robots` notes which robots it hits.
    """
    for kind in draws.shuffled(kinds):
        if drawn := DRAWN[kind](draws, robots, when):
            return [{"kind": kind} | drawn[0], *drawn[1:]]
    return []


def _draw_kill(draws: Draws, robots: RobotsHit, when: When) -> Found:
    who = robots.take(draws, when.begin, when.end)
    # Drawn even if no robot is hit: the number of draws must not depend on the outcome.
    wreck = draws.choice("stays", "removed")
    return [{**when.at, "who": who, "wreck": wreck}, {"kind": "restart", **when.healed, "who": who}] if who else []


def _draw_restart(draws: Draws, robots: RobotsHit, when: When) -> Found:
    who = robots.take(draws, when.begin, when.begin, leave=0)
    return [{**when.at, "who": who}] if who else []


def _draw_pause(draws: Draws, robots: RobotsHit, when: When) -> Found:
    who = robots.take(draws, when.begin, when.end)
    return [{**when.lasting, "who": who}] if who else []


def _draw_resume(draws: Draws, robots: RobotsHit, when: When) -> Found:
    """Draw a pause without an end, which a resume ends."""
    who = robots.take(draws, when.begin, when.end)
    return [{**when.at, "kind": "pause", "who": who}, {"kind": "resume", **when.healed, "who": who}] if who else []


def _draw_join(draws: Draws, robots: RobotsHit, when: When) -> Found:
    who = robots.take(draws, 0, when.begin)
    return [{**when.at, "who": who}] if who else []


def _draw_leave(draws: Draws, robots: RobotsHit, when: When) -> Found:
    who = robots.take(draws, when.begin, when.end)
    return [{**when.at, "who": who}, {"kind": "join", **when.healed, "who": who}] if who else []


def _draw_links(draws: Draws, robots: RobotsHit) -> dict[str, Any]:
    sources, targets = robots.any(draws), robots.any(draws)
    return {"from": sources, "to": "all" if sources == targets else targets}


def _draw_wait(draws: Draws, when: When) -> dict[str, Any]:
    """Draw delays of some steps."""
    longest_s = 6.0 * when.step
    shape = draws.choice("constant", "uniform", "normal", "exponential")
    first, second = sorted((draws.between(0.0, longest_s), draws.between(0.0, longest_s)))
    return {shape: [first, second] if shape in ("uniform", "normal") else second}


def _draw_loss(draws: Draws, robots: RobotsHit, when: When) -> Found:
    fault = {**when.lasting, **_draw_links(draws, robots), "rate": draws.between(0.05, 1.0)}
    # Drawn in any case, so that later draws do not depend on the rate.
    burst = draws.between(1.0, 12.0)
    if fault["rate"] * (1.0 + burst) <= burst and draws.share() < 0.5:
        fault["mean_burst"] = burst
    return [fault]


def _draw_delay(draws: Draws, robots: RobotsHit, when: When) -> Found:
    return [{**when.lasting, **_draw_links(draws, robots), "delay": _draw_wait(draws, when)}]


def _draw_duplicate(draws: Draws, robots: RobotsHit, when: When) -> Found:
    fault = {**when.lasting, **_draw_links(draws, robots), "rate": draws.between(0.05, 1.0)}
    return [fault | draws.choice({}, {"delay": _draw_wait(draws, when)})]


def _draw_reorder(draws: Draws, robots: RobotsHit, when: When) -> Found:
    fault = {**when.lasting, **_draw_links(draws, robots), "rate": draws.between(0.05, 1.0)}
    return [fault | draws.choice({}, {"hold": draws.between(0.1 * when.step, 5.0 * when.step)})]


def _draw_partition(draws: Draws, robots: RobotsHit, when: When) -> Found:
    if len(robots.names) < 2:
        return []
    first = draws.some(robots.names, len(robots.names) - 1)
    outside = [name for name in robots.names if name not in first]
    extra = [draws.some(outside, len(outside))] if draws.share() < 0.5 else []
    groups: Any = draws.choice([first, *extra], [first, *extra], "halves", "one")
    return [{**when.lasting, "groups": groups, "direction": draws.choice("both", "one-way")}]


def _draw_silence(draws: Draws, robots: RobotsHit, when: When) -> Found:
    return [{**when.lasting, "who": robots.any(draws), "direction": draws.choice("in", "out", "both")}]


def _draw_range(draws: Draws, robots: RobotsHit, when: When) -> Found:
    through = draws.choice(True, False)
    return [{**when.lasting, "who": robots.any(draws), "reach": draws.between(5.0, 60.0), "through_walls": through}]


def _draw_bandwidth(draws: Draws, robots: RobotsHit, when: When) -> Found:
    return [{**when.lasting, "who": robots.any(draws), "bytes_per_s": draws.between(5.0, 100.0)}]


def _draw_spoof(draws: Draws, robots: RobotsHit, when: When) -> Found:
    by = draws.choice(STRANGER, draws.choice(*robots.names))
    if by == robots.names[0] and len(robots.names) == 1:
        by = STRANGER  # there is no other name to forge
    impersonated = [name for name in robots.names if name != by]
    offset = [draws.between(-20.0, 20.0), draws.between(-20.0, 20.0)]
    payload: Any = draws.choice(
        {"offset": offset},
        "freeze",
        {"replay": draws.between(when.step, 40.0 * when.step)},
        "random",
        {"invented": draws.whole(1, 3)},
        {"ahead": draws.whole(1, 10_000)},
    )
    return [{**when.lasting, "by": by, "as": draws.some(impersonated, len(impersonated)), "payload": payload}]


def _draw_drift(draws: Draws, robots: RobotsHit, when: When) -> Found:
    fault = {
        "who": robots.any(draws),
        "bias": [draws.between(-2.0, 2.0), draws.between(-2.0, 2.0)],
        "growth": [draws.between(-0.05, 0.05), draws.between(-0.05, 0.05)],
        "noise": draws.between(0.0, 0.5),
    }
    jump = {"jump": {"every": draws.between(2.0 * when.step, 40.0 * when.step), "size": draws.between(0.5, 10.0)}}
    return [{**when.lasting, **fault, **draws.choice({}, jump)}]


def _draw_clock(draws: Draws, robots: RobotsHit, when: When) -> Found:
    offset, rate = draws.between(-60.0, 60.0), draws.between(-0.2, 0.2)
    return [{**when.lasting, "who": robots.any(draws), "offset": offset, "rate": rate}]


def _draw_motion(draws: Draws, robots: RobotsHit, when: When) -> Found:
    noise = {name: draws.between(0.0, 0.4) for name in ("speed", "turning", "veer")}
    every = {"every": draws.between(when.step, 20.0 * when.step)}
    jitter = draws.choice({}, {"jitter": {"size": draws.between(0.05, 0.9), **every}})
    slip = draws.choice({}, {"slip": {"rate": draws.between(0.05, 0.8), **draws.choice({}, every)}})
    return [{**when.lasting, "who": robots.any(draws), **noise, **jitter, **slip}]


DRAWN: Mapping[str, Callable[[Draws, RobotsHit, When], Found]] = {
    "kill": _draw_kill,
    "restart": _draw_restart,
    "pause": _draw_pause,
    "resume": _draw_resume,
    "join": _draw_join,
    "leave": _draw_leave,
    "loss": _draw_loss,
    "delay": _draw_delay,
    "duplicate": _draw_duplicate,
    "reorder": _draw_reorder,
    "partition": _draw_partition,
    "silence": _draw_silence,
    "range": _draw_range,
    "bandwidth": _draw_bandwidth,
    "spoof": _draw_spoof,
    "drift": _draw_drift,
    "clock": _draw_clock,
    "motion": _draw_motion,
}
"""Draws of each kind. Another kind or another order changes the faults of every nemesis of `kinds: all`."""


MOST_FAULTS = 1000
"""A nemesis of more intervals than this is refused."""
QUIET = 1.0 / 3.0
"""Share of the run that is quiet at its end by default."""

if TYPE_CHECKING:
    KindName = str
else:
    KindName = Literal[tuple(DRAWN)]
_KINDS = f"all, or a list of kinds of faults: {', '.join(DRAWN)}"
Kinds = Annotated[
    Annotated[Literal["all"], expecting(_KINDS), Tag("=single")]
    | Annotated[
        tuple[Annotated[KindName, expecting(f"one of {', '.join(DRAWN)}")], ...],
        at_least(1, "kinds of faults"),
        Tag("=list"),
    ],
    by_shape(_KINDS),
]


class NemesisSpec(Section):
    """Random faults, written out as concrete ones when the scenario is loaded."""

    kinds: Kinds = Field("all", description="all, or a list of kinds of faults")
    interval: Positive = Field(description="s, length of an interval; one fault begins in each")
    seed: Seed | None = Field(None, description="random seed of the faults; null: the scenario's")
    quiet: NotNegative | None = Field(None, description="s without faults at the end; null: a third of the run")


def room_for(spec: NemesisSpec, step: float, ticks: int) -> tuple[int, float]:
    """Return the tick at which a nemesis's quiet window begins, and the length of an interval in ticks.

    The part of the run before that tick is left for faults.

    For example, (66, 20.0) for 100 ticks of 0.5 s with an interval of 10 s and the usual third of quiet.
    """
    quiet = ticks * QUIET if spec.quiet is None else spec.quiet / step
    end = min(math.floor(ticks - quiet + 1e-9), ticks - 1)
    if end < 1:
        problem = f"leaves no room for faults in a run of {ticks * step:g} s; give less, or a longer run"
        raise wrong("nemesis.quiet", problem, spec.quiet)
    if spec.interval < step:
        raise wrong("nemesis.interval", f"shorter than one step of {step:g} s; give more", spec.interval)
    if (faults := math.ceil(end * step / spec.interval)) > MOST_FAULTS:
        raise wrong("nemesis.interval", f"makes {faults} faults, at most {MOST_FAULTS} fit; give more", spec.interval)
    return end, spec.interval / step
