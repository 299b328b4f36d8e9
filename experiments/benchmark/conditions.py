"""The conditions of the benchmark by name: faults, robots that are not all alike, and other sensors.

For example, `loss-90` loses 90 % of all frames, and ``loss-90+deaths`` is both at once. `docs/benchmark.md` lists all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, prod
from typing import Any

from patrol.errors import BadInput, did_you_mean
from patrol.scenario import MAX_ROBOTS
from patrol.scenario.sections import Body

NONE, DEATHS = "none", "deaths"

DEATHS_S = (300.0, 1100.0)
"""When the robots r1 and r2 die in a run of `DEATHS_OF_S` or more, s; in a shorter run earlier, in proportion."""

DEATHS_OF_S = 1800.0

ONE_DEATH = 1.0 / 3.0
"""When r2 dies under `one-death` and `wreck`, as a share of the run."""

JITTER_S = 5.0
"""How long a jittered speed holds, s: about a leg between two vertices."""

JUMP_M, JUMPS_EVERY_S, JUMP_S = 1.0, 60.0, 5.0
"""How far positions jump under `jumps`, m, how often, and how long they then stay off, s."""

SLOWEST, FASTEST = 0.5, 1.25
"""Speeds of the first and the last robot under `speeds`, as shares of the scenario's speed."""

BODIES = ("holonomic", "differential", "car")
"""Body models under `bodies`, which the robots have in turn."""

BURSTS = {"kind": "loss", "rate": 0.5, "mean_burst": 8}
"""The fault of `bursts`; a burst has 8 ticks in the mean, as in `examples/sweeps/fault-kinds.yaml`."""

Faults = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Condition:
    """The faults and settings that a condition adds to a scenario.

    For example, `slower-5` has no fault, and the share of speed .95 for the first robot and 1 for the others.
    """

    faults: Faults = ()
    smallest_team: int = 2  # robots of the smallest team that it makes sense for
    robots: int | None = None  # number of robots, in place of the team's
    # share of the scenario's speed of the robot INDEX of COUNT; the shares of several are multiplied
    speeds: tuple[Callable[[int, int], float], ...] = ()
    models: tuple[str, ...] = ()  # body models, which the robots have in turn
    settings: Mapping[str, object] = field(default_factory=dict)  # others, by dotted field

    def add_to(self, settings: Mapping[str, object]) -> dict[str, object]:
        """Return settings of a scenario, by dotted field, with those of this condition; `robots.count` is among them.

        Robots that are not alike are listed one by one. For example, ``{"robots.count": 2, "robots.speed": 1}`` becomes
        ``{"robots": [{"speed": 0.95}, {"speed": 1.0}]}`` under `slower-5`.
        """
        changed = {**settings, **self.settings, **({} if self.robots is None else {"robots.count": self.robots})}
        if self.faults:
            changed["faults"] = [dict(fault) for fault in self.faults]
        if not (self.speeds or self.models):
            return changed
        for name in ("robots.starts", "robots.spare"):
            if name in settings:
                listed = "speeds, slower-P and bodies list the robots one by one"
                raise BadInput(f"--set {name}: {listed}; leave out these conditions, or this setting")
        count = int(str(changed.pop("robots.count")))
        entries: list[dict[str, object]] = [{} for _ in range(count)]
        if self.models:
            changed.pop("robots.model", None)
            for index, entry in enumerate(entries):
                entry["model"] = self.models[index % len(self.models)]
        if self.speeds:
            speed = _read_speed(changed.pop("robots.speed", Body.model_fields["speed"].default))
            for index, entry in enumerate(entries):
                entry["speed"] = round(speed * prod(share(index, count) for share in self.speeds), 6)
        return {"robots": entries, **changed}  # first, so that other fields of robots then hold for all entries


@dataclass(frozen=True, slots=True)
class Numbered:
    """Conditions whose names end in a whole number."""

    largest: int  # number
    unit: str
    make: Callable[[int], Condition]


NUMBERED: Mapping[str, Numbered] = {
    "loss-": Numbered(100, "%", lambda percent: Condition([{"kind": "loss", "rate": percent / 100.0}])),
    # a robot that jitters by 100 % could stand still
    "jitter-": Numbered(99, "%", lambda percent: Condition([_jitter(percent / 100.0)], 1)),
    "slower-": Numbered(99, "%", lambda percent: Condition((), 1, speeds=(_first_slower(percent / 100.0),))),
    "delay-": Numbered(60, "s", lambda late_s: Condition([{"kind": "delay", "delay": {"constant": late_s}}])),
    "range-": Numbered(1000, "m", lambda reach_m: Condition([{"kind": "range", "reach": reach_m}])),
    "sector-": Numbered(360, "degrees", lambda degrees: Condition((), 1, settings={"sensor.angle": degrees})),
    "noise-": Numbered(1000, "cm", lambda off_cm: Condition([_noise(off_cm / 100.0)], 1)),
    "robots-": Numbered(MAX_ROBOTS, "robots", lambda count: Condition((), 1, robots=count)),
}
"""Conditions with a number, by the prefix of their names."""

EXAMPLES = ("loss-50", "loss-90", "jitter-20", "slower-5", "delay-3", "range-30", "sector-90", "noise-10", "robots-26")
ALL = (NONE, "silence", DEATHS, "one-death", "wreck", "spoof", "bursts", "jumps", "speeds", "bodies", *EXAMPLES)
"""All conditions, with examples of those with a number."""


def check_condition(name: str) -> None:
    """Refuse a name that is no condition."""
    parts = name.split("+")
    for part in parts:
        if _part_of(part, DEATHS_OF_S) is None:
            prefix = next((prefix for prefix in NUMBERED if part.startswith(prefix)), None)
            hint = f"no such condition; {did_you_mean(part, ALL)}, or join several, as in loss-90+deaths"
            if prefix is not None:
                kind = NUMBERED[prefix]
                hint = f"expected {prefix}1 to {prefix}{kind.largest}, in whole {kind.unit}"
            raise BadInput(f"--conditions {name}: {part}: {hint}")
    counts = [part for part in parts if part.startswith("robots-")]
    if len(set(parts)) < len(parts) or (NONE in parts and len(parts) > 1) or len(counts) > 1:
        remedy = "name each condition once, one robots-N at most, and none alone"
        raise BadInput(f"--conditions {name}: these do not go together; {remedy}")


def condition_of(name: str, duration_s: float) -> Condition:
    """Return the condition of a name that `check_condition` lets pass, for runs of that duration."""
    parts = [condition for part in name.split("+") if (condition := _part_of(part, duration_s)) is not None]
    return Condition(
        [fault for part in parts for fault in part.faults],
        max(part.smallest_team for part in parts),
        next((part.robots for part in parts if part.robots is not None), None),
        tuple(share for part in parts for share in part.speeds),
        next((part.models for part in parts if part.models), ()),
        {name: value for part in parts for name, value in part.settings.items()},
    )


def _part_of(part: str, duration_s: float) -> Condition | None:
    """Return one part of a condition; None if there is no such condition."""
    if match := re.fullmatch("([a-z]+-)([1-9][0-9]{,5})", part):
        kind = NUMBERED.get(match[1])
        return None if kind is None or int(match[2]) > kind.largest else kind.make(int(match[2]))
    earlier = min(duration_s / DEATHS_OF_S, 1.0)
    deaths = [_death(f"r{number}", at_s * earlier) for number, at_s in enumerate(DEATHS_S, start=1)]
    named = {
        NONE: Condition((), 1),
        "silence": Condition([{"kind": "silence", "who": "all"}]),
        "spoof": Condition([{"kind": "spoof", "as": "r1", "payload": "random"}]),
        DEATHS: Condition(deaths, 3),
        "one-death": Condition([_death("r2", duration_s * ONE_DEATH)]),
        "wreck": Condition([_death("r2", duration_s * ONE_DEATH) | {"wreck": "stays"}]),
        "bursts": Condition([BURSTS]),
        "jumps": Condition(_jumps(duration_s), 1),
        "speeds": Condition(speeds=(lambda index, count: SLOWEST + (FASTEST - SLOWEST) * index / (count - 1),)),
        "bodies": Condition(models=BODIES),
    }
    return named.get(part)


def _death(robot: str, at_s: float) -> dict[str, Any]:
    return {"kind": "kill", "who": robot, "at": round(at_s, 3), "wreck": "removed"}


def _noise(off_m: float) -> dict[str, Any]:
    return {"kind": "drift", "who": "all", "noise": off_m}


def _jumps(duration_s: float) -> list[dict[str, Any]]:
    """Return the faults in which the positions of all robots jump to one side after another, and back."""
    sides = ((JUMP_M, 0.0), (0.0, JUMP_M), (-JUMP_M, 0.0), (0.0, -JUMP_M))
    return [
        {"kind": "drift", "who": "all", "at": number * JUMPS_EVERY_S, "for": JUMP_S, "bias": list(sides[number % 4])}
        for number in range(1, ceil(duration_s / JUMPS_EVERY_S))
    ]


def _jitter(size: float) -> dict[str, Any]:
    return {"kind": "motion", "who": "all", "jitter": {"size": size, "every": JITTER_S}}


def _first_slower(share: float) -> Callable[[int, int], float]:
    return lambda index, _: 1.0 if index else 1.0 - share


def _read_speed(speed: object) -> float:
    try:
        return float(str(speed))
    except ValueError:
        raise BadInput(f"--set robots.speed={speed}: expected a number of m/s") from None
