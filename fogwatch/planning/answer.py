"""The answer of a plan, in lines of text."""

from __future__ import annotations

import math
from collections.abc import Iterator

from fogwatch.planning.plan import AgeKept, FleetPlan, FleetSize
from fogwatch.terminal.live_table import robots_text
from monitor.tables.table import Table
from patrol.measures.best_tour import NO_BOUND
from patrol.scenario.assumptions import assumption_lines
from patrol.scenario.patrols import patrol_name


def answer_lines(plan: FleetPlan) -> Iterator[str]:
    """Yield the answer of a plan in lines of text."""
    yield from assumption_lines(plan.scenario)
    if plan.wanted_s is not None and any(size.simulated is None for size in plan.sizes):
        yield "in brackets: by the better of the tours, not simulated"
    if any(size.bound_s == 0.0 for size in plan.sizes):
        yield f"bound -: {NO_BOUND}"
    if all(size.age_s is None for size in plan.sizes):
        yield "tours -: the sensor leaves some of an age, cars do not look all around, or the ground is too large"
    areas = [size.area_m2 for size in plan.sizes]
    if max(areas) > 1.01 * min(areas):
        yield f"ground: fewer robots start in fewer parts and reach less of it, {min(areas):.0f} to {max(areas):.0f} m²"
    reason = plan.sizes[-1].left_out
    if reason is not None:
        yield f"left out: {reason.text}"
    yield from _on_patrol(plan)
    if given_up := [str(size.robots) for size in plan.sizes if 0 < len(size.runs) < plan.seeds]:
        yield f"given up at the first run that failed, of {plan.seeds}: {', '.join(given_up)} robots"
    if plan.wanted_s is not None:
        yield from _size_answer(plan, plan.wanted_s)
    if plan.chosen is not None:
        yield from _test_lines(plan.size(plan.chosen), plan.wanted_s)


def _on_patrol(plan: FleetPlan) -> Iterator[str]:
    """Say for how much of the time robots with a battery patrol."""
    spec = plan.scenario.roster[0]
    if spec.battery is None or not plan.scenario.docks:
        return
    robots = plan.sizes[-1].robots if plan.chosen is None else plan.chosen
    share, limit = spec.battery.patrol_share(spec.speed), spec.battery.most_on_patrol(robots, spec.speed)
    yield f"batteries: on patrol for {100.0 * share:.0f} % of the time; of {robots_text(robots)}, {limit} at a time"


def _size_answer(plan: FleetPlan, wanted_s: float) -> Iterator[str]:
    """Say how many robots keep the wanted age."""
    how = "on the better of the tours" if plan.quick else "in a simulated run"
    if plan.chosen is None:
        yield f"answer: none of these numbers of robots keeps {wanted_s:g} s {how}; {_remedy_text(plan, wanted_s)}"
        if simulated := [size for size in plan.sizes if size.runs]:
            yield f"most robots: {_kept_by(simulated[-1], wanted_s)}"
            yield from _closed_out(simulated[-1])
            yield from _zone_lines(simulated[-1])
        return
    size = plan.size(plan.chosen)
    if plan.quick:
        yield f"answer: {robots_text(plan.chosen)}, by tours alone: {age_text(size.age_s)} s; run it without --quick"
        return
    yield f"answer: {_kept_by(size, wanted_s)}; longer runs may exceed it"
    fewer = next((size for size in plan.sizes if size.robots == plan.chosen - 1), None)
    if fewer is not None and fewer.runs:
        yield f"one fewer: {_kept_by(fewer, wanted_s)}"


def _kept_by(size: FleetSize, wanted_s: float) -> str:
    """Say in how many of its runs a fleet keeps an age, and the ages of the worst one."""
    keeping = sum(run.keeps(wanted_s) for run in size.runs)
    seeds = "" if len(size.runs) == 1 else f"kept by {keeping} of {len(size.runs)} seeds; in the worst run "
    return f"{_keeping_sentence(size.robots, wanted_s, keeping == len(size.runs))}: {seeds}{_ages_text(size.simulated)}"


def _remedy_text(plan: FleetPlan, wanted_s: float) -> str:
    """Name remedies where no number keeps the wanted age."""
    last = plan.sizes[-1]
    if plan.opened and plan.opened[-1].keeps(wanted_s):
        robots = len(plan.opened[-1].scenario.roster)
        return f"with nothing ever closed {_keeping_sentence(robots, wanted_s, True)}, so what closes is the reason"
    if last.tour_s is None:
        return "give --robots with larger numbers, or a longer --age"
    needed = math.ceil(last.tour_s * last.robots / wanted_s)
    return f"one tour for all needs about {needed}; give a longer --age, a faster body or a longer --sensor-range"


def _test_lines(size: FleetSize, wanted_s: float | None) -> Iterator[str]:
    """Say which ages the chosen fleet keeps with one robot dead, and as another patrol."""
    if (dead := size.one_dead) is not None:
        text = f"{robots_text(size.robots - 1)} left, {_holding_text(dead, wanted_s)}{_ages_text(dead)}"
        yield f"one dead: {text}; largest since its death {age_text(dead.peak_s)} s"
    if (alternative := size.other_patrol) is not None:
        name = patrol_name(alternative.scenario.patrol.policy)
        yield f"--patrol {name}: {_holding_text(alternative, wanted_s)}{_ages_text(alternative)}"
    if size.simulated is not None:
        yield from _closed_out(size)
        yield from _zone_lines(size)
    for run in (size.simulated, size.one_dead, size.other_patrol):
        if run is not None:
            yield from (f"warning: {run.scenario.name}: {warning}" for warning in run.warnings)


def _closed_out(size: FleetSize) -> Iterator[str]:
    """Say how old all ground got, where the ages above are those of open ground."""
    simulated = size.simulated
    if simulated is None or simulated.all_max_s is None:
        return
    names = ", ".join(c.name for c in simulated.scenario.closures if c.name in simulated.closed)
    if names:
        because = f", because of {names}" if simulated.all_max_s > simulated.max_s else f"; closed: {names}"
        yield (
            f"closures: ages are of open ground, the time in which it was closed out left out; with it the largest is "
            f"{age_text(simulated.all_max_s)} s{because}"
        )
    tried = {name for run in size.runs for name in run.closed}
    for closure in simulated.scenario.closures:
        if closure.name in tried or (closure.closed is None and closure.closes is None):
            continue
        why, remedy = "closed in no run", "give a longer --duration"
        if closure.closed and (begin_s := closure.closed[0][0]) >= simulated.scenario.duration:
            why, remedy = f"begins at {begin_s:g} s, after the run's end", f"--duration {2 * begin_s:g} would try it"
        yield f"closure {closure.name}: {why}, so it was not tried; {remedy}"


def _zone_lines(size: FleetSize) -> Iterator[str]:
    """Say for each zone with a wanted age whether it is kept, and which zones are slow."""
    zones = size.runs[0].scenario.zones
    for zone in zones:
        ages_s = [run.zones_s[zone.name] for run in size.runs if zone.name in run.zones_s]
        if zone.age is not None and ages_s:
            count = sum(age_s <= zone.age for age_s in ages_s)
            seeds = f", kept by {count} of {len(ages_s)} seeds" if len(ages_s) > 1 else ""
            keep = "kept" if count == len(ages_s) else "not kept"
            yield f"zone {zone.name}: wanted {zone.age:g} s, {keep}{seeds}: largest {age_text(max(ages_s))} s"
    if slow := [f"{zone.name} ({zone.speed:g} m/s)" for zone in zones if zone.speed is not None]:
        yield f"slow zones: {', '.join(slow)}; tours take as long as robots need there"


def _holding_text(kept: AgeKept, wanted_s: float | None) -> str:
    if wanted_s is None:
        return ""
    return f"{'keeps' if kept.keeps(wanted_s) else 'does not keep'} {wanted_s:g} s: "


def _keeping_sentence(robots: int, wanted_s: float, holds: bool) -> str:
    is_one = robots == 1
    verb = ("keeps" if is_one else "keep") if holds else ("does not keep" if is_one else "do not keep")
    return f"{robots_text(robots)} {verb} {wanted_s:g} s"


def _ages_text(kept: AgeKept | None) -> str:
    if kept is None:
        return ""
    end_s = kept.scenario.duration
    invalid = "" if kept.outcome == "valid" else f"; verdict {kept.outcome}"
    ages = f"largest {age_text(kept.max_s)} s, mean {age_text(kept.mean_s)} s"
    return f"{ages}, from {kept.from_s:g} s to {end_s:g} s{invalid}"


def answer_table(plan: FleetPlan) -> Table:
    """Return a plan's table: the ages that fleets of each size keep."""
    wanted = plan.wanted_s
    heads = ["robots", "bound (s)", "one tour (s)", "own tours (s)", "simulated: mean (s)", "largest (s)"]
    rows = []
    for size in plan.sizes:
        simulated = size.simulated
        cells = [age_text(size.bound_s or None), age_text(size.tour_s), age_text(size.own_tours_s)]
        cells += ["-", "-"] if simulated is None else [age_text(simulated.mean_s), age_text(simulated.max_s)]
        rows.append([str(size.robots), *cells, *([] if wanted is None else [_keeps_mark(size, wanted)])])
    return Table([*heads, *([] if wanted is None else [f"keeps {wanted:g} s"])], rows, range(len(heads)))


def _keeps_mark(size: FleetSize, wanted_s: float) -> str:
    if size.simulated is not None:
        return "yes" if size.simulated.keeps(wanted_s) else "no"
    return "-" if size.age_s is None else "(yes)" if size.age_s <= wanted_s else "(no)"


def age_text(seconds: float | None) -> str:
    """Return an age in s, for example "12.3"; "-" for none."""
    return "-" if seconds is None else f"{seconds:.1f}"
