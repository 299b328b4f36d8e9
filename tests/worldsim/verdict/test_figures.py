"""The summary's figures against those that the verdict adds up from the raw ticks by code of its own."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest

from patrol.summary.metric import metrics_of
from patrol.summary.model import (
    BatteryFigures,
    ClosureFigures,
    FaultFacts,
    IntruderFacts,
    LinkFacts,
    Messages,
    NodeFigures,
    RobotFigures,
    Summary,
    ZoneFigures,
)
from patrol.summary.totals import RunTotals, _Robot
from tests.chaos.bugs import altered
from tests.worldsim.checks.judged import Result
from tests.worldsim.conftest import Lab
from worldsim.output.summary import summarise
from worldsim.output.traffic import Traffic
from worldsim.verdict.judge import Verdict, judge

STATED = "header or end of the journal state it, and nothing can be added up"
GROUND = "of the ground, not of the ticks: tests/patrol/measures/test_best_tour.py"
ZONES = "from the verdict's own fog: test_zone_ages.py"
OPEN = "from the verdict's own fog: test_zone_ages.py"
PROGRESS = "from the verdict's own fog and places: tests/worldsim/checks/test_progress.py, test_summary.py"
VERTICES = "tests/patrol/measures/test_nodes.py adds up the visits again"
BATTERY = "tests/patrol/summary/test_batteries.py adds up the charge again"
CLOSURE = "tests/patrol/summary/test_closures.py counts the events again"
SEEN_INTRUDERS = "tests/worldsim/output/test_summary.py has intruders whose figures are known"
PROCESSES = "of processes, which no tick holds: tests/worldsim/output/test_summary.py, tests/worldsim/fleet"

NOT_RECOMPUTED: dict[str, str] = {
    **dict.fromkeys(("name", "policy", "scenario_hash", "trace_hash", "ended", "wall_s", "realtime_factor"), STATED),
    **dict.fromkeys(("bound_s", "point_m", "sensor_range_m", "patrolled_area_m2", "patrolled_vertices"), STATED),
    **dict.fromkeys(("best_tour_s", "best_tour_m", "left_out"), GROUND),
    **dict.fromkeys(("mfow_weighted_mean_s", "mfow_weighted_late_mean_s", "mfow_weighted_max_s"), ZONES),
    **dict.fromkeys(("best_weighted_s", *(f"zones.{key}" for key in ZoneFigures.model_fields)), ZONES),
    **dict.fromkeys((f"mfow_reachable_{key}_s" for key in ("mean", "late_mean", "max")), OPEN),
    **dict.fromkeys(("closed_out_share", "closed_out"), OPEN),
    **dict.fromkeys(("trapped", "stalest", "robots.longest_stay_s", "robots.longest_stay"), PROGRESS),
    **dict.fromkeys((f"nodes.{key}" for key in NodeFigures.model_fields), VERTICES),
    **dict.fromkeys((f"robots.battery.{key}" for key in BatteryFigures.model_fields), BATTERY),
    **dict.fromkeys((f"closures.{key}" for key in ClosureFigures.model_fields), CLOSURE),
    **dict.fromkeys((f"intruders.{key}" for key in IntruderFacts.model_fields), SEEN_INTRUDERS),
    **dict.fromkeys(("refused", "deadlines", "direct", "exit_codes"), PROCESSES),
    "verdict": "the verdict itself",
    "faults.kind": "of the scenario: tests/worldsim/output/test_summary.py",
    "faults.frames": "test_summary.py has the frames of each kind of fault",
}
"""Why the verdict does not recompute some figures, and what does; by their places, without names."""

FAULTS: list[dict[str, Any]] = [
    {"kind": "loss", "rate": 0.3, "id": "lossy"},
    {"kind": "delay", "delay": {"constant": 1.2}, "from": "r1", "id": "late"},
    {"kind": "duplicate", "rate": 0.4, "delay": {"constant": 0.8}, "id": "twice"},
    {"kind": "spoof", "by": "r2", "as": "r1", "payload": "freeze", "id": "forger"},
    {"kind": "pause", "who": "r2", "at": 3.0, "for": 4.0, "id": "pause"},
    {"kind": "kill", "who": "r3", "at": 12.0, "id": "kill"},
    {"kind": "restart", "who": "r3", "at": 13.0, "id": "restart"},
    {"kind": "restart", "who": "r3", "at": 17.0, "id": "again"},
]


@pytest.fixture
def run(lab: Lab) -> Result:
    return lab.driven(ticks=41, faults=FAULTS)


def verdict_on(result: Result) -> tuple[dict[str, Any], Verdict]:
    """The summary of a run, and the verdict on both."""
    world, journal = result
    summary, verdict = summarise(journal, judge(journal, {}, world.prepared), world.prepared)
    return summary.document(), verdict


def wrong(value: Any) -> Any:
    """Another value, as little off as shows."""
    match value:
        case str():
            return f"{value}."
        case dict():
            return value | {"another": 1}
        case float():
            return value * (1.0 + 1e-8) + 1e-8
    return 1 if value is None else value + 1


def declared() -> Iterator[str]:
    """The places of all figures of a summary, without names of robots, zones and the like."""
    parts: Mapping[str, Any] = {
        "messages": Messages,
        "robots": RobotFigures,
        "robots.battery": BatteryFigures,
        "nodes": NodeFigures,
        "zones": ZoneFigures,
        "closures": ClosureFigures,
        "intruders": IntruderFacts,
        "links": LinkFacts,
        "faults": FaultFacts,
    }
    yield from (key for key, _ in metrics_of(Summary) if key not in parts)
    for part, model in parts.items():
        yield from (f"{part}.{key}" for key in model.model_fields if f"{part}.{key}" not in parts)


def unnamed(place: tuple[str, ...]) -> set[str]:
    """The figures at a place, as `declared` writes them."""
    part, *more = place
    if part == "links":
        return {f"links.{key}" for key in LinkFacts.model_fields}
    return {f"{part}.{more[-1]}" if more else part}


def test_every_figure_is_recomputed_or_there_is_a_reason(run: Result) -> None:
    recomputed = set().union(*map(unnamed, judge(run[1], {}, run[0].prepared).recomputed))
    assert recomputed.isdisjoint(NOT_RECOMPUTED)
    assert recomputed | set(NOT_RECOMPUTED) == set(declared())


def test_a_good_summary_is_as_recomputed(run: Result) -> None:
    summary, verdict = verdict_on(run)
    assert verdict.valid
    rejected = [row.rejected for record in run[1].ticks for row in record.robots if row.number == 3]
    assert summary["robots"]["r3"]["rejected"] > max(count or 0 for count in rejected), "by three processes"
    assert verdict.checks[-1].name == "figures"
    assert verdict.checks[-1].detail == f"{len(verdict.recomputed)} figures of the summary are those of the ticks"


def test_a_wrong_value_of_each_figure_is_named(run: Result) -> None:
    """Each figure that the verdict recomputes is made wrong in a good summary, one after the other."""
    document, verdict = verdict_on(run)
    plain = judge(run[1], {}, run[0].prepared)
    for place, value in verdict.recomputed.items():
        *parents, key = place
        part: Any = document
        for name in parents:
            part = part[name]
        right = part[key]
        part[key] = wrong(right)
        found = plain.with_figures_of(document)
        assert not found.valid
        assert found.checks[-1].detail == f"{'.'.join(place)} is {part[key]} in the summary, and {value} by the ticks"
        part[key] = right
    assert plain.with_figures_of(document).valid


def changed(**figures: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Change figures that a function returns, by the object that it is a method of."""
    return lambda real: lambda of, *more: altered(**{key: make(of) for key, make in figures.items()})(real(of, *more))


@pytest.mark.parametrize(
    ("owner", "name", "make", "place"),
    [
        (RunTotals, "figures", changed(mfow_late_mean_s=lambda of: 0.5 * sum(of._mfow[:4]) / 4.0), "mfow_late_mean_s"),
        (RunTotals, "figures", changed(mfow_max_s=lambda of: 0.5 * max(of._mfow[:4])), "mfow_max_s"),
        (_Robot, "figures", changed(dead_end_share=lambda of: of.dead_ends / of.living), "robots.r2.dead_end_share"),
        (_Robot, "figures", changed(decisions=lambda of: of.living), "robots.r2.decisions"),
        (Traffic, "links", lambda real: lambda of: real(of) | {"r1": {}}, "links.r1.r2"),
    ],
)
def test_code_that_adds_up_something_else_is_found(
    lab: Lab, monkeypatch: pytest.MonkeyPatch, owner: type, name: str, make: Callable[[Any], Any], place: str
) -> None:
    """The second robot is alive in a tick without a decision, in which it is lost."""
    world = lab.patrol(ticks=9)
    result = world, lab.run(world, lab.fleet(world, silent={(2, 8, "B")}))
    monkeypatch.setattr(owner, name, make(getattr(owner, name)))
    assert verdict_on(result)[1].checks[-1].detail.startswith(f"{place} is ")


def test_figures_are_judged_of_any_run(lab: Lab) -> None:
    """Runs without ticks, with robots that never came, or with direct radio, whose counts are those of robots."""
    world = lab.patrol(ticks=5)
    _, verdict = verdict_on((world, lab.run(world, stop=lambda: True)))
    assert (verdict.checks[-1].ok, verdict.checks[-1].judged) == (True, False)
    silent = lab.patrol(ticks=9, faults=[{"kind": "join", "who": "r4", "at": 3.0}])
    assert verdict_on((silent, lab.run(silent)))[1].checks[-1].judged
    direct = lab.patrol(ticks=9, radio={"via": "direct"}, pace="realtime")
    summary, verdict = verdict_on((direct, lab.run(direct)))
    assert summary["messages"]["dropped"] is None
    assert (verdict.checks[-1].ok, verdict.checks[-1].judged) == (True, True)
    lost = lab.patrol(ticks=9)
    summary, verdict = verdict_on((lost, lab.run(lost, lab.fleet(lost, silent={(2, 8, "B")}))))
    assert summary["robots"]["r2"]["status"] == "lost"
    assert verdict.checks[-1].ok
