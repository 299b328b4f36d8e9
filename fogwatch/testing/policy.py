"""A check of a policy: small fleets in one process, in the situations that policies meet."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from agent.policies.found import POLICIES
from fogwatch.testing.broken import RuleBroken, class_of, disturb_chance, put_up
from patrol.errors import BadInput

if TYPE_CHECKING:
    from agent.ports import Intent, Policy, PolicySetup
    from agent.view import View
    from patrol.scenario import Scenario
    from worldsim.world import World

TICKS = 60
"""Ticks of each run."""

FLEET: Mapping[str, Any] = {
    "terrain": {"builtin": "yards"},
    "point": 1.0,
    "step": 0.5,
    "robots": {"count": 3},
    "patrol": {"give_way": True},
}
SITUATIONS: Mapping[str, Mapping[str, Any]] = {
    "alone": {"robots.count": 1},
    "beside silent robots": {
        "faults": [{"kind": "silence", "at": 4, "who": ["r2", "r3"]}, {"kind": "kill", "at": 8, "who": ["r3"]}]
    },
    "at a wall": {"robots.count": 1, "robots.starts": [[1.6, 1.6, 3.9]]},
    "with nothing in view": {"sensor.range": 1.0, "robots.speed": 2.0},
    "off the ground that it knows": {
        "faults": [{"kind": "drift", "at": 5, "for": 10, "who": ["r1"], "bias": [1000, 1000], "noise": 3}]
    },
    "after a restart": {
        "faults": [{"kind": "kill", "at": 5, "who": ["r1"]}, {"kind": "restart", "at": 10, "who": ["r1"]}]
    },
    "beside an intruder": {"intruders": [{"place": [40, 20], "at": 5, "for": 10}]},
    "with batteries": {
        "robots.battery": {"capacity": 5, "idle": 1, "drive": 1, "charge": 200, "start": 0.5},
        "docks": [{"place": [10, 44], "radius": 1.0}],
    },
    "among zones and closures": {
        "zones": [
            {"name": "weighty", "polygon": [[5, 60], [15, 60], [15, 80], [5, 80]], "weight": 3},
            {"name": "out", "polygon": [[25, 20], [32, 20], [32, 30], [25, 30]], "keep_out": True},
        ],
        "closures": [{"name": "door", "polygon": [[38, 10], [42, 10], [42, 30], [38, 30]], "closed": [[5, 15]]}],
    },
}
"""Changes of the fleet, by situation."""

WITH_PLACES = ("at a wall", "beside an intruder", "with batteries", "among zones and closures")
"""Situations that hold on the fleet's own ground alone."""


@dataclass(frozen=True, slots=True)
class PolicyReport:
    """The figures of a policy under check.

    Attributes:
        decisions: Number that it took.
        median_ms: Wall time of half of them at most, ms.
        slowest_ms: Wall time of the slowest, ms; compiling counts. It is not judged: machines differ.
    """

    decisions: int
    median_ms: float
    slowest_ms: float

    def __str__(self) -> str:
        return f"{self.decisions} decisions, median {self.median_ms:.2f} ms, slowest {self.slowest_ms:.1f} ms"


def check_policy(
    policy: type[Any] | str,
    *,
    options: Mapping[str, Any] | None = None,
    models: tuple[str, ...] = ("holonomic", "differential", "car"),
    settings: Mapping[str, Any] | None = None,
) -> PolicyReport:
    """Check that a policy keeps the rules of `agent.ports.Policy`.

    It is run in a fleet of three, twice, with other states of `random` and `numpy.random`: both runs must give the same
    trace. Then it is run alone, beside silent robots, at a wall, with nothing in view, off the ground that its robot
    knows, after a restart, beside an intruder, with batteries, and among zones and closures: it must answer with an
    intent that its body can obey, and the verdict must be valid.

    Args:
        policy: The class, or its name as in a scenario (``./file.py:Class``).
        options: What `patrol.options` says.
        models: Body models that the policy is for.
        settings: More of the scenario, by dotted field; for example ``{"patrol.give_way": False}``, a body's
            ``{"robots.radius": 0.4}`` or ``{"terrain": {"map": "office.yaml"}, "point": 0.2}``.

    Returns:
        How many decisions it took, and how long they lasted.

    Raises:
        RuleBroken: The policy breaks a rule; the message says which, in what situation, at which tick.
        BadInput: Options or settings are wrong.
    """
    checked = class_of(policy, POLICIES)
    runs: list[_Run] = []
    extra = {**{f"patrol.options.{option}": value for option, value in (options or {}).items()}, **(settings or {})}
    for model in models:
        fleet = partial(_make_fleet, {"robots.model": model, **extra})
        first, second = (_run_policy(checked, fleet, f"a fleet ({model})", number) for number in (1, 2))
        _compare_runs(first, second)
        runs += [first, second]
        for situation, changes in SITUATIONS.items():
            if situation in WITH_PLACES and any(field.partition(".")[0] == "terrain" for field in extra):
                continue
            changed = partial(_make_fleet, {"robots.model": model, **changes, **extra})
            runs.append(_run_policy(checked, changed, f"{situation} ({model})", 0))
    times = [spent for run in runs for spent in run.times_ms]
    return PolicyReport(len(times), statistics.median(times), max(times))


@dataclass(slots=True)
class _Run:
    """One run of a fleet.

    Attributes:
        situation: As in `SITUATIONS`, with the body model.
        intents: In the order of the decisions, with tick and robot.
        times_ms: Of the decisions.
        trace: Its hash.
    """

    situation: str
    intents: list[tuple[int, str, Intent]] = field(default_factory=list)
    times_ms: list[float] = field(default_factory=list)
    trace: str = ""


Make = Callable[[str], "Scenario"]
"""Makes a scenario with the policy of a name."""


def _make_fleet(changes: Mapping[str, Any], name: str) -> Scenario:
    from patrol.scenario import load_scenario

    return load_scenario({**FLEET, "duration": TICKS * FLEET["step"], "patrol": {"policy": name}}, changes)


def _run_policy(policy: type[Any], make: Make, situation: str, chance: int) -> _Run:
    """Run a scenario with a policy; raise RuleBroken where it fails."""
    from fogwatch.inprocess import run_in_process

    run = _Run(situation)
    scenario = make(put_up(_watch_policy(policy, run)))
    failures: list[tuple[str, BaseException | None]] = []

    def fail(number: int, reason: str, error: BaseException | None) -> None:
        failures.append((f"{scenario.roster[number - 1].name}: {reason}", error))

    def disturb(world: World, _: object) -> None:
        disturb_chance(1000 * world.tick + chance)

    outcome = None
    try:
        outcome = run_in_process(scenario, failure=fail, look=disturb)
        run.trace = outcome.summary.trace_hash or ""
    except BadInput:
        if not failures:
            raise
    if failures:
        reason, error = failures[0]
        raise RuleBroken(f"{policy.__name__}, {situation}: it must always answer with an intent; {reason}") from error
    if outcome is not None and not outcome.verdict.valid:
        problems = "; ".join(f"{check.name}: {check.detail}" for check in outcome.verdict.failed)
        raise RuleBroken(f"{policy.__name__}, {situation}: the verdict is {outcome.verdict.outcome} by {problems}")
    return run


def _watch_policy(policy: type[Any], run: _Run) -> type[Any]:
    """Make a class that decides as a policy does, and notes its decisions and their times."""

    class Watched:
        def __init__(self, setup: PolicySetup) -> None:
            self._policy: Policy = policy(setup)

        def decide(self, view: View) -> Intent:
            began = time.perf_counter()
            intent = self._policy.decide(view)
            run.times_ms.append(1000.0 * (time.perf_counter() - began))
            run.intents.append((view.tick, view.spec.name, intent))
            return intent

    Watched.__name__ = policy.__name__
    if hasattr(policy, "Options"):
        Watched.Options = policy.Options  # type: ignore[attr-defined]
    return Watched


def _compare_runs(first: _Run, second: _Run) -> None:
    """Raise RuleBroken where two runs of the same scenario differ."""
    nothing = (None, "", None)
    for answer, repeated in zip_longest(first.intents, second.intents, fillvalue=nothing):
        if repr(answer) != repr(repeated):
            tick, robot, _ = answer if answer is not nothing else repeated
            raise RuleBroken(
                f"{first.situation}: the same scenario must give the same decisions; at tick {tick}, {robot} "
                f"answered {answer[2]!r} in one run and {repeated[2]!r} in the next. Use view.draw for chance, no "
                "clock, and keep state in self alone"
            )
    if first.trace != second.trace:
        raise RuleBroken(f"{first.situation}: the same scenario must give the same trace, and the intents are equal")
