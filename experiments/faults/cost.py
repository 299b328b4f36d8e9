"""The faults experiment: what faults cost the paper's final algorithm, without and with claims.

A *condition* is a set of faults. Each is run with every *variant* of the algorithm and every seed. A cost is the ratio
to the run of the same variant and seed without faults.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from experiments.sweeps.plan import Base, Case, Plan, make_plan
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Estimate, estimate
from patrol.errors import BadInput, did_you_mean
from patrol.radio.message import MAX_TRAIL

CALLED = "the faults experiment"
QUIET = "no faults"
KILLED, RESTARTED = "one killed", "one killed and restarted"
FEWER = "one robot fewer"
WITH_TRAIL = " with trail"

VARIANTS: Mapping[str, Mapping[str, object]] = {
    "final algorithm": {"patrol.policy": "potential-field", "patrol.options.separation": "none"},
    "with claims": {"patrol.policy": "potential-field", "patrol.options.separation": "claims"},
}

INDEPENDENT = (0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
BURSTS = (0.25, 0.5, 0.75, 0.85)
BURST_TICKS = 8
REACHES_M = (20, 40, 80)
TRAIL = MAX_TRAIL
"""Past positions in a frame, in conditions with a trail."""

FORGED_M = 25.0
"""Offset of forged positions, m."""

Faults = list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Condition:
    """A set of faults whose cost is measured."""

    group: str  # conditions that are shown together
    name: str  # in the group
    faults: Faults  # as in a scenario
    x: float | None = None  # its value on the group's axis; None where the group has no axis
    settings: Mapping[str, object] = field(default_factory=dict)  # what else it sets in the scenario, by dotted field


@dataclass(frozen=True, slots=True)
class FaultSetup:
    """The settings that all runs share."""

    terrain: str  # name of a built-in one
    point: float  # side of one grid point, m
    duration: float  # simulated time of each run, s
    robots: int  # number of the whole fleet
    seeds: tuple[int, ...]  # each condition is run with all of them
    key: Path  # file with a fleet key
    # what else each run sets in the scenario, by dotted field
    settings: Mapping[str, object] = field(default_factory=dict)

    @property
    def mapping(self) -> dict[str, object]:
        """The setup as settings of a scenario, by dotted field."""
        common: dict[str, object] = {
            "terrain.builtin": self.terrain,
            "point": self.point,
            "duration": self.duration,
            "robots.count": self.robots,
            "patrol.options.random_move_for": "all",
        }
        return {**common, **self.settings}


GROUPS: Mapping[str, str] = {
    "quiet": "no faults, for comparison",
    "loss": "each frame lost independently",
    "loss with trail": f"each frame lost independently, frames with the last {TRAIL} positions",
    "bursts": f"frames lost in bursts of {BURST_TICKS} on average",
    "bursts with trail": f"frames lost in bursts of {BURST_TICKS}, frames with the last {TRAIL} positions",
    "silence": "no robot sends",
    "death": "robots killed, and restarted",
    "fleet": "fleets of other sizes, and robots that join",
    "partition": "the fleet partitioned into halves",
    "range": "a radio of limited range",
    "forgery": "forged positions, without and with a key",
}
"""Groups of conditions, in the order they are shown in."""


def conditions(setup: FaultSetup) -> list[Condition]:
    """Return all conditions."""
    return [
        Condition("quiet", QUIET, []),
        *_loss_conditions(),
        *_radio_conditions(setup),
        *_robot_conditions(setup),
        *_forgery_conditions(setup),
    ]


def chosen(setup: FaultSetup, names: Sequence[str]) -> list[Condition]:
    """Return some of the conditions, always with the one without faults.

    The others are compared with that one. `names` are those of groups, or of conditions as GROUP: NAME; without any,
    all conditions are returned.
    """
    every = conditions(setup)
    labels = [f"{condition.group}: {condition.name}" for condition in every]
    for name in names:
        if name not in (*GROUPS, *labels):
            raise BadInput(f"--only {name}: no such group or condition; {did_you_mean(name, [*GROUPS, *labels])}")
    wanted = {*(names or GROUPS), "quiet"}
    return [condition for condition, name in zip(every, labels, strict=True) if {condition.group, name} & wanted]


def plan_of(setup: FaultSetup, tried: Sequence[Condition]) -> Plan:
    """Return the plan of all runs."""
    cases = [
        Case(case_name(condition, variant), {**setup.mapping, **sets, **condition.settings, "faults": condition.faults})
        for variant, sets in VARIANTS.items()
        for condition in tried
    ]
    return make_plan("faults", Base({"name": "faults"}, Path.cwd(), CALLED), cases, setup.seeds)


def case_name(condition: Condition, variant: str) -> str:
    """Return the name of the case of a condition and a variant."""
    return f"{condition.group}: {condition.name}, {variant}"


def _loss_conditions() -> Iterator[Condition]:
    with_trail: dict[str, object] = {"radio.trail": TRAIL}
    for end, settings in (("", {}), (WITH_TRAIL, with_trail)):
        for rate in INDEPENDENT:
            yield Condition(f"loss{end}", f"{100 * rate:g} % lost", [{"kind": "loss", "rate": rate}], rate, settings)
        for rate in BURSTS:
            burst: Faults = [{"kind": "loss", "rate": rate, "mean_burst": BURST_TICKS}]
            yield Condition(f"bursts{end}", f"{100 * rate:g} % lost", burst, rate, settings)


def _radio_conditions(setup: FaultSetup) -> Iterator[Condition]:
    third = setup.duration / 3.0
    silence: dict[str, Any] = {"kind": "silence", "who": "all"}
    yield Condition("silence", "total silence", [silence])
    yield Condition("silence", "silence for a third", [{**silence, "at": third, "for": third}])
    if setup.robots > 1:
        parted: Faults = [{"kind": "partition", "groups": "halves", "at": third, "for": third}]
        yield Condition("partition", "halves for a third", parted)
    for reach in REACHES_M:
        yield Condition("range", f"{reach} m", [{"kind": "range", "reach": reach}], float(reach))


def _robot_conditions(setup: FaultSetup) -> Iterator[Condition]:
    fifth = setup.duration / 5.0
    last = f"r{setup.robots}"
    kill: dict[str, Any] = {"kind": "kill", "who": last, "at": fifth}
    yield Condition("death", KILLED, [kill])
    yield Condition("death", RESTARTED, [kill, {"kind": "restart", "who": last, "at": 1.5 * fifth}])
    in_turn: Faults = []
    for number in range(1, setup.robots + 1):
        time_s = setup.duration * (number - 0.5) / (setup.robots + 1.0)
        in_turn.append({"kind": "kill", "who": f"r{number}", "at": time_s})
        in_turn.append(
            {"kind": "restart", "who": f"r{number}", "at": time_s + 0.5 * setup.duration / (setup.robots + 1.0)}
        )
    yield Condition("death", "each killed in turn and restarted", in_turn)
    if setup.robots > 1:
        yield Condition("fleet", FEWER, [], settings={"robots.count": setup.robots - 1})
    if setup.robots > 2:
        joining: Faults = [
            {"kind": "join", "who": f"r{number}", "at": setup.duration * (index + 1) / 3.0}
            for index, number in enumerate((setup.robots - 1, setup.robots))
        ]
        yield Condition("fleet", "two robots join", joining)


def _forgery_conditions(setup: FaultSetup) -> Iterator[Condition]:
    forged: dict[str, dict[str, Any]] = {
        "all positions shifted": {"kind": "spoof", "as": "all", "payload": {"offset": [FORGED_M, 0.0]}},
        "one robot's positions at random": {"kind": "spoof", "as": "one", "payload": "random"},
        "old frames sent again": {"kind": "spoof", "as": "all", "payload": {"replay": 60.0}},
    }
    for name, fault in forged.items():
        yield Condition("forgery", name, [fault])
        yield Condition("forgery", f"{name} (key)", [fault], settings={"radio.key": str(setup.key)})
    if setup.robots > 1:
        name = "all positions shifted by an insider (key)"
        insider: dict[str, Any] = {"kind": "spoof", "by": "r1", "as": "all", "payload": {"offset": [FORGED_M, 0.0]}}
        yield Condition("forgery", name, [insider], settings={"radio.key": str(setup.key)})


@dataclass(frozen=True, slots=True)
class Finding:
    """The results of a condition with a variant, means over the seeds."""

    condition: Condition
    variant: str  # its name
    mfow: Estimate | None  # mean MFoW over the run, s
    late: Estimate | None  # mean MFoW over the second half of the run, s
    cost: Estimate | None  # `mfow` as a ratio to the run of the same seed without faults
    delivered: Estimate | None  # share of the frames that were delivered
    belief: Estimate | None  # mean error of the believed ages, s
    collisions: Estimate | None  # their number
    stay: float | None  # longest time that any robot of any run stayed in one circle of four radii and strides, s


def findings(outcome: SweepOutcome, tried: Sequence[Condition]) -> list[Finding]:
    """Return the results of the runs, variant by variant."""
    quiet = next(condition for condition in tried if condition.group == "quiet")
    return [_make_finding(outcome, condition, quiet, variant) for variant in VARIANTS for condition in tried]


def _make_finding(outcome: SweepOutcome, condition: Condition, quiet: Condition, variant: str) -> Finding:
    name = case_name(condition, variant)

    def values(metric: str, case: str = name) -> Mapping[int, float]:
        return outcome.values(case, metric)

    mfow, free = values("mfow_mean_s"), values("mfow_mean_s", case_name(quiet, variant))
    sent, delivered = values("messages_sent"), values("messages_delivered")
    return Finding(
        condition=condition,
        variant=variant,
        mfow=_mean_estimate(mfow.values()),
        late=_mean_estimate(values("mfow_late_mean_s").values()),
        cost=_mean_estimate(mfow[seed] / free[seed] for seed in mfow if free.get(seed)),
        delivered=_mean_estimate(delivered[seed] / sent[seed] for seed in delivered if sent.get(seed)),
        belief=_mean_estimate(values("belief_error_s").values()),
        collisions=_mean_estimate(values("collisions").values()),
        stay=max(values("longest_stay_s").values(), default=None),
    )


def _mean_estimate(values: Any) -> Estimate | None:
    numbers = list(values)
    return estimate(numbers) if numbers else None


@dataclass(frozen=True, slots=True)
class FaultComparison:
    """A measure of some runs as a ratio to that of others, seed by seed."""

    group: str
    what: str
    variant: str
    ratio: Estimate


ConditionVariant = tuple[Condition, str]
"""A condition and the name of a variant that it is run with."""

AGAINST: Mapping[str, str] = {
    "claims": "mean MFoW with claims, as a ratio to that without under the same faults",
    "trail": f"mean MFoW where frames have the last {TRAIL} positions, as a ratio to that where they have none",
    "fleet": "late mean MFoW after a death, as a ratio to that of a fleet of that size from the start",
}
"""Groups of comparisons, in the order they are shown in."""


def comparisons(outcome: SweepOutcome, tried: Sequence[Condition]) -> list[FaultComparison]:
    """Return all comparisons that the tried conditions allow, over the seeds that both sides have."""
    compared = []
    for group, label, metric, these, those in _compared_pairs(tried):
        ours, theirs = outcome.values(case_name(*these), metric), outcome.values(case_name(*those), metric)
        ratio = _mean_estimate(ours[seed] / theirs[seed] for seed in ours if theirs.get(seed))
        if ratio is not None:
            compared.append(FaultComparison(group, label, these[1], ratio))
    return compared


def _compared_pairs(tried: Sequence[Condition]) -> Iterator[tuple[str, str, str, ConditionVariant, ConditionVariant]]:
    """Yield the comparisons: group, what is compared, the measure, and the two sides."""
    plain, claims = VARIANTS
    by_name = {(condition.group, condition.name): condition for condition in tried}
    for (group, name), condition in by_name.items():
        yield "claims", f"{group}: {name}", "mfow_mean_s", (condition, claims), (condition, plain)
    for (group, name), condition in by_name.items():
        bare = by_name.get((group.removesuffix(WITH_TRAIL), name), condition)
        for variant in VARIANTS if bare is not condition else ():
            yield "trail", f"{bare.group}: {name}", "mfow_mean_s", (condition, variant), (bare, variant)
    for after, reference in ((KILLED, ("fleet", FEWER)), (RESTARTED, ("quiet", QUIET))):
        died, alike = by_name.get(("death", after)), by_name.get(reference)
        if died is None or alike is None:
            continue
        for variant in VARIANTS:
            yield "fleet", f"{after}: {alike.name}", "mfow_late_mean_s", (died, variant), (alike, variant)


def as_json(setup: FaultSetup, found: Sequence[Finding], compared: Sequence[FaultComparison]) -> dict[str, Any]:
    """Return the content of faults.json: each mean with its 95 % interval."""
    measures = ("mfow", "late", "cost", "delivered", "belief", "collisions")
    return {
        "set": dict(setup.mapping),
        "seeds": list(setup.seeds),
        "findings": [
            {
                "group": entry.condition.group,
                "condition": entry.condition.name,
                "x": entry.condition.x,
                "variant": entry.variant,
                "faults": entry.condition.faults,
                **{name: _estimate_numbers(getattr(entry, name)) for name in measures},
                "longest_stay_s": entry.stay,
            }
            for entry in found
        ],
        "comparisons": [
            {
                "group": entry.group,
                "what": entry.what,
                "variant": entry.variant,
                "ratio": _estimate_numbers(entry.ratio),
            }
            for entry in compared
        ],
    }


def _estimate_numbers(found: Estimate | None) -> dict[str, Any] | None:
    return None if found is None else {"mean": found.mean, "ci95": found.interval, "runs": found.count}
