"""The plan: what age a fleet of each size can keep, by tours and in simulated runs, and how many robots an age needs.

A fleet keeps an age if nothing is older: in simulated runs of several seeds, if in each the largest MFoW after the
first quarter of the run is at most that age, and the verdict is valid. The first quarter is left out because ground
counts as unseen since the start of the run until a robot has been there. Where doors close, the age of a point counts
only the time in which it was not closed out.

The search for the least number begins with the least that keeps the age on one of its tours. It goes down while the
simulated fleet keeps the age, or else up until it does. It takes for granted that more robots keep no greater age.
A number is given up at its first run that does not keep the age.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from fogwatch.inprocess import run_in_process
from fogwatch.own_classes import find_classes
from fogwatch.planning.division import Divider, Territory
from fogwatch.terminal.live_table import robots_text
from patrol.errors import BadInput, NotPrepared
from patrol.ground.left_out import LeftOut
from patrol.journal.records import CLOSED
from patrol.measures.best_tour import BestTour, best_tour
from patrol.prepare import Prepared, prepare, sensor_footprint, terrain_of
from patrol.scenario import RobotGroup, changed_scenario
from patrol.scenario.patrols import PATROLS, STOCHASTIC, TOUR, patrol_name
from patrol.zones.ground import SpeedLimits
from worldsim.output.record import lower_bound

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.journal import TickRecord
    from patrol.scenario import Scenario

MOST_ROBOTS = 24
"""Robots of the largest fleet that is simulated."""

LEAST_S = 600.0
"""Shortest simulated run unless its length is given, s."""

INTERVALS = 12.0
"""The same, in ages kept by tours: the last quarter of a run has three of them."""

WANTED = 2.0
"""The same, in wanted ages: ground that is never seen is older than wanted long before the end."""

SETTLED = 0.25
"""Share of a run, and of the time before a robot's death, that does not count."""

KILLED_AT = 0.5
"""Share of a run after which a robot is killed."""

LOOKED_AT = 2.0
"""The first number in the search for a wanted age keeps, on one tour for all, at most this many times the age."""

SEEDS = 3
"""Simulated runs of each fleet, unless their number is given."""

MORE_WHERE_CLOSED = 2
"""Numbers that are tried beyond one that keeps the age with nothing ever closed, but not with what closes."""

_OTHER_PATROL = {STOCHASTIC: TOUR, TOUR: STOCHASTIC}
"""Patrol that a chosen fleet is compared with."""

MORE = 1
"""Numbers in the table beyond the least one that keeps the age by tours."""


Progress = Callable[[str, float], None]
"""Called with what is computed, as in "4 robots: tours", and the share of it that is done: 0 at its begin."""


@dataclass(frozen=True, slots=True)
class AgeKept:
    """The ages that a simulated fleet kept."""

    scenario: Scenario  # what was run
    from_s: float  # begin of the time that counts, which lasts to the end of the run
    mean_s: float  # mean MFoW in that time; of open ground where the scenario has closures
    max_s: float  # largest MFoW, likewise
    peak_s: float | None  # largest MFoW from a robot's death on, likewise; None without a death
    outcome: str  # of the verdict
    warnings: tuple[str, ...]  # of the verdict
    trace_hash: str  # of the run
    all_max_s: float | None = None  # as `max_s`, of all ground, closed out or not; None without closures
    # largest age of the ground of each zone with a wanted age, by name, in that time and while in force, likewise
    zones_s: Mapping[str, float] = field(default_factory=dict)
    closed: frozenset[str] = frozenset()  # names of the closures that closed in the run

    def keeps(self, age_s: float) -> bool:
        """Return whether nothing was older than an age, in a run whose verdict is valid."""
        return self.outcome == "valid" and self.max_s <= age_s


@dataclass(frozen=True, slots=True)
class FleetSize:
    """A fleet of some size."""

    robots: int  # how many
    area_m2: float  # of the patrolled ground
    bound_s: float  # lower bound of the MFoW; 0 where it says nothing
    tours: BestTour  # the best for all robots, one for each part of the terrain
    tour_s: float | None  # MFoW of the fleet on `tours`; None where there is none
    territories: tuple[Territory, ...] | None  # best division of the ground found; None where there is none
    own_tours_s: float | None  # MFoW of the fleet with a tour for each robot; None without territories
    runs: tuple[AgeKept, ...] = ()  # with the scenario's policy, one a seed; empty if not run
    # with one robot dead from the middle of the run; None if not run, and for one robot
    one_dead: AgeKept | None = None
    # as the tour if the scenario is stochastic, or the other way round; None if not run, and for other policies
    other_patrol: AgeKept | None = None
    left_out: LeftOut | None = None  # free ground that none of the robots sees; None where there is none

    @property
    def simulated(self) -> AgeKept | None:
        """The run with the largest age, one that is not valid first; None if there is none."""
        return max(self.runs, key=lambda kept: (kept.outcome != "valid", kept.max_s), default=None)

    @property
    def age_s(self) -> float | None:
        """The age that the tours keep, the better of both kinds, s."""
        return min((age for age in (self.tour_s, self.own_tours_s) if age is not None), default=None)


@dataclass(frozen=True, slots=True)
class FleetPlan:
    """A plan: what ages fleets of several sizes keep, and how many robots the wanted age needs."""

    scenario: Scenario  # ground, body and sensor, with faults and intruders left out
    terrain: Terrain
    wanted_s: float | None  # the wanted age; None for none
    sizes: tuple[FleetSize, ...]  # ascending by number of robots
    # least number of robots that keeps the wanted age, simulated or, with `quick`, by tours; without a wanted age the
    # largest number; None if no number keeps it
    chosen: int | None
    quick: bool  # True if nothing was simulated
    # where no number keeps the age, runs of the largest with nothing ever closed, up to the first that does not keep
    # it; empty without closures
    opened: tuple[AgeKept, ...] = ()
    seeds: int = SEEDS  # number of runs of each fleet, unless one fails

    def size(self, robots: int) -> FleetSize:
        """Return the fleet of some size."""
        return next(size for size in self.sizes if size.robots == robots)

    def by_tours(self) -> int | None:
        """Return the least number of robots that keeps the wanted age by tours."""
        wanted = math.inf if self.wanted_s is None else self.wanted_s
        return min(
            (size.robots for size in self.sizes if size.age_s is not None and size.age_s <= wanted), default=None
        )


def make_plan(
    scenario: Scenario,
    wanted_s: float | None,
    numbers: Sequence[int] | None,
    progress: Progress,
    *,
    duration_s: float | None = None,
    quick: bool = False,
    seeds: int = SEEDS,
) -> FleetPlan:
    """Make the plan.

    Number of robots, faults and intruders of the scenario do not count; it must not list its robots. `wanted_s` is the
    age that nothing is to exceed, needed without `numbers`. `numbers` are the numbers of robots to look at, ascending;
    None searches for those around the answer. `duration_s` is the length of each simulated run; None for what
    `_Planner.duration_s` says. With `quick` nothing is simulated. `seeds` is the number of runs of each fleet, with the
    scenario's seed and those after it.
    """
    if not quick:
        find_classes([scenario])
    planner = _Planner(scenario, wanted_s, progress, duration_s, quick, seeds)
    if numbers is None:
        if wanted_s is None:
            raise ValueError("neither an age nor numbers")
        chosen = planner.search(wanted_s)
    else:
        chosen = planner.look_at(numbers)
    if chosen is not None and not quick:
        if chosen - 1 in planner.sizes and planner.sizes[chosen - 1].runs:
            planner.simulate(chosen - 1)
        planner.test(chosen)
    opened = () if chosen is not None or wanted_s is None or quick else planner.opened(wanted_s)
    sizes = tuple(size for _, size in sorted(planner.sizes.items()))
    return FleetPlan(planner.scenario, planner.terrain, wanted_s, sizes, chosen, quick, opened, seeds)


def planned_scenario(scenario: Scenario) -> Scenario:
    """Return a scenario as plans use it: without faults, intruders, given starts and spare robots."""
    if not isinstance(scenario.robots, RobotGroup):
        raise BadInput(f"{scenario.name} lists its robots; a plan needs robots of one kind: give one entry with count")
    return changed_scenario(scenario, {"faults": [], "intruders": [], "robots.starts": "random", "robots.spare": None})


class _Planner:
    """Computes and runs fleets of several sizes on one terrain; `sizes` has what is known, by number of robots."""

    def __init__(
        self,
        scenario: Scenario,
        wanted_s: float | None,
        progress: Progress,
        duration_s: float | None,
        quick: bool,
        seeds: int,
    ) -> None:
        self.scenario = planned_scenario(scenario)
        try:
            self.terrain = terrain_of(scenario)
        except BadInput as error:
            raise NotPrepared(str(error)) from None
        self.sizes: dict[int, FleetSize] = {}
        self._wanted_s = wanted_s
        self._progress = progress
        self._duration_s = duration_s
        self._quick = quick
        self._seeds = seeds
        self._opened: dict[int, tuple[AgeKept, ...]] = {}
        self._limits = SpeedLimits(self.scenario.zones, self.terrain)
        self._divider = Divider()

    def search(self, wanted_s: float) -> int | None:
        """Search for the least number of robots that keeps an age; see the module."""
        number = self._first_by_tours(wanted_s)
        if self._quick or number is None:
            return number
        if self._keeps_age(number, wanted_s):
            while number > 1 and self.size(number - 1).bound_s <= wanted_s and self._keeps_age(number - 1, wanted_s):
                number -= 1
            return number
        limit = MOST_ROBOTS
        while number < limit:
            opened = self.opened(wanted_s)
            if limit == MOST_ROBOTS and opened and opened[-1].keeps(wanted_s):
                limit = min(number + MORE_WHERE_CLOSED, MOST_ROBOTS)
            number += 1
            if self._keeps_age(number, wanted_s):
                return number
        return None

    def look_at(self, numbers: Sequence[int]) -> int | None:
        """Compute and run fleets of some sizes; return the least that keeps the wanted age, or the largest."""
        for number in numbers:
            self.size(number)
            if not self._quick:
                self.simulate(number)
        if self._wanted_s is None:
            return numbers[-1]
        wanted = self._wanted_s
        return next((number for number in numbers if self._keeps_age(number, wanted)), None)

    def test(self, number: int) -> None:
        """Run a fleet with one robot dead from the middle of the run, and as another patrol."""
        size, scenario = self.size(number), self._scenario_of(number)
        dead = alternative = None
        if number > 1:
            kill = {"kind": "kill", "at": KILLED_AT * scenario.duration, "who": "r1", "wreck": "removed"}
            name = f"{scenario.name}-one-dead"
            dead = self._run_scenario(changed_scenario(scenario, {"name": name, "faults": [kill]}), "one of them dead")
        if (patrol := _OTHER_PATROL.get(patrol_name(scenario.patrol.policy))) is not None:
            changes = {"name": f"{scenario.name}-{patrol}", "patrol.policy": PATROLS[patrol].policy}
            alternative = self._run_scenario(changed_scenario(scenario, changes), f"as the patrol {patrol}")
        self.sizes[number] = replace(size, one_dead=dead, other_patrol=alternative)

    def size(self, number: int) -> FleetSize:
        """Return the tours of a fleet of some size."""
        if number not in self.sizes:
            self._progress(f"{robots_text(number)}: tours", 0.0)
            self._add_size(number, *self._with_tours(number))
        return self.sizes[number]

    def _with_tours(self, number: int) -> tuple[Prepared, BestTour]:
        prepared = prepare(changed_scenario(self.scenario, {"robots.count": number}), self.terrain)
        return prepared, best_tour(prepared)

    def _add_size(self, number: int, prepared: Prepared, tours: BestTour) -> None:
        """Divide the ground among a fleet of some size, and keep its tours."""
        # The tours of parts of the ground are searched for without looks aside.
        is_divided = tours.length_m is not None and sensor_footprint(prepared.scenario, prepared.terrain).all_round
        territories = self._divider.divide(prepared) if is_divided else None
        scenario = prepared.scenario
        own_s = [
            _driven_s(territory.tour.way, territory.tour.length_m, scenario, self._limits)
            for territory in (() if territories is None else territories)
        ]
        area_m2 = float(np.count_nonzero(prepared.patrolled)) * prepared.terrain.point_area
        self.sizes[number] = FleetSize(
            number,
            area_m2,
            lower_bound(area_m2, scenario.roster, scenario.sensor.range),
            tours,
            _shared_s(tours, scenario, self._limits),
            territories,
            max(own_s, default=None),
            left_out=prepared.find_left_out(),
        )
        self._progress(f"{robots_text(number)}: tours", 1.0)

    def duration_s(self, number: int) -> float:
        """Return the length of the simulated runs of a fleet, s: as given, or long enough for its tours."""
        if self._duration_s is not None:
            return self._duration_s
        age_s = self.size(number).age_s or 0.0
        needed_s = max(LEAST_S, INTERVALS * age_s, WANTED * (self._wanted_s or 0.0))
        return 60.0 * math.ceil(needed_s / 60.0)

    def _first_by_tours(self, wanted_s: float) -> int | None:
        """Return the least number of robots that keeps an age by its tours, or by the bound where there are none."""
        for number in range(1, MOST_ROBOTS + 1):
            prepared, tours = self._with_tours(number)
            on_one_tour = _shared_s(tours, prepared.scenario, self._limits)
            if on_one_tour is not None and on_one_tour > LOOKED_AT * wanted_s:
                continue
            if number not in self.sizes:
                self._progress(f"{robots_text(number)}: tours", 0.0)
                self._add_size(number, prepared, tours)
            size = self.sizes[number]
            if (size.bound_s if size.age_s is None else size.age_s) <= wanted_s:
                for larger in range(number + 1, min(number + MORE, MOST_ROBOTS) + 1):
                    self.size(larger)
                return number
        self.size(MOST_ROBOTS)
        return None

    def _keeps_age(self, number: int, wanted_s: float) -> bool:
        if self._quick:
            age_s = self.size(number).age_s
            return age_s is not None and age_s <= wanted_s
        return all(self._simulate_run(number, seed).keeps(wanted_s) for seed in range(self._seeds))

    def simulate(self, number: int) -> None:
        """Run a fleet with all seeds."""
        for seed in range(self._seeds):
            self._simulate_run(number, seed)

    def _simulate_run(self, number: int, seed: int) -> AgeKept:
        """Return the run of a fleet with a seed, from 0 on, counted from the scenario's; run it unless it is known."""
        size = self.size(number)
        if seed == len(size.runs):
            scenario = changed_scenario(self._scenario_of(number), {"seed": self.scenario.seed + seed})
            self.sizes[number] = size = replace(
                size, runs=(*size.runs, self._run_scenario(scenario, f"seed {scenario.seed}"))
            )
        return size.runs[seed]

    def opened(self, wanted_s: float) -> tuple[AgeKept, ...]:
        """Run the largest simulated fleet again with nothing ever closed, up to the first seed that fails.

        Of the runs returned, the last alone may not keep the wanted age. There are none without closures.
        """
        number = max(number for number, size in self.sizes.items() if size.runs)
        if self.scenario.closures and number not in self._opened:
            runs: list[AgeKept] = []
            while len(runs) < self._seeds and (not runs or runs[-1].keeps(wanted_s)):
                changes = {"closures": [], "seed": self.scenario.seed + len(runs)}
                scenario = changed_scenario(self._scenario_of(number), changes)
                runs.append(self._run_scenario(scenario, f"seed {scenario.seed}, nothing ever closed"))
            self._opened[number] = tuple(runs)
        return self._opened.get(number, ())

    def _scenario_of(self, number: int) -> Scenario:
        settings = {"name": f"{self.scenario.name}-{number}", "robots.count": number}
        return changed_scenario(self.scenario, {**settings, "duration": self.duration_s(number)})

    def _run_scenario(self, scenario: Scenario, how: str) -> AgeKept:
        what = f"{robots_text(len(scenario.roster))}: {how}"
        self._progress(what, 0.0)
        ticks = scenario.duration / scenario.step
        ages: list[float] = []

        def take(record: TickRecord) -> None:
            ages.append(record.mfow * scenario.step)
            self._progress(what, min(len(ages) / ticks, 1.0))

        outcome = run_in_process(prepare(scenario, self.terrain), keep=False, progress=take)
        killed = round(KILLED_AT * len(ages)) if scenario.faults else 0
        begin = killed + round(SETTLED * len(ages))
        open_ages, zones = outcome.verdict.open_ages, outcome.verdict.zones
        judged = np.array(ages) if open_ages is None else open_ages.ages_s
        zones_s = open_ages.zones_s if open_ages is not None else {} if zones is None else zones.ages_s
        late, end = judged[begin:], outcome.journal.end
        in_zones = {name: zone_s[begin:] for name, zone_s in zones_s.items()}
        wanted = [zone.name for zone in scenario.zones if zone.age is not None]
        return AgeKept(
            scenario,
            begin * scenario.step,
            float(late.mean()),
            float(late.max()),
            float(judged[killed:].max()) if scenario.faults else None,
            outcome.verdict.outcome,
            outcome.verdict.warnings,
            "" if end is None else end.trace_hash,
            None if open_ages is None else max(ages[begin:]),
            {n: float(np.nanmax(s)) for n, s in in_zones.items() if n in wanted and not np.isnan(s).all()},
            frozenset(event.detail for event in outcome.journal.events if event.kind == CLOSED),
        )


def plan_facts(plan: FleetPlan) -> dict[str, Any]:
    """Write a plan as plain lists, texts and numbers."""
    scenario, body = plan.scenario, plan.scenario.roster[0]
    return {
        "name": scenario.name,
        "point_m": scenario.point,
        "body": {
            "model": body.model,
            "radius_m": body.radius,
            "speed_m_s": body.speed,
            "turning_radius_m": body.turning_radius if body.model == "car" else None,
        },
        "sensor": {"kind": scenario.sensor.kind, "range_m": scenario.sensor.range},
        "policy": scenario.patrol.policy,
        "wanted_age_s": plan.wanted_s,
        "criterion": "by tours" if plan.quick else "largest simulated MFoW after the first quarter of each run",
        "robots": plan.chosen if plan.wanted_s is not None else None,
        "robots_by_tours": plan.by_tours() if plan.wanted_s is not None else None,
        "sizes": [_size_facts(size, plan.wanted_s) for size in plan.sizes],
    }


def _size_facts(size: FleetSize, wanted_s: float | None) -> dict[str, Any]:
    tours_m = None if size.territories is None else [territory.tour.length_m for territory in size.territories]
    return {
        "robots": size.robots,
        "patrolled_area_m2": size.area_m2,
        "left_out": None if size.left_out is None else asdict(size.left_out),
        "bound_s": size.bound_s,
        "tour_s": size.tour_s,
        "tour_m": size.tours.length_m,
        "own_tours_s": size.own_tours_s,
        "own_tours_m": tours_m,
        "age_s": size.age_s,
        "simulated": _kept_facts(size.simulated, wanted_s),
        "seeds": [_kept_facts(run, wanted_s) for run in size.runs],
        "one_dead": _kept_facts(size.one_dead, wanted_s),
        "other_patrol": _kept_facts(size.other_patrol, wanted_s),
    }


def _kept_facts(kept: AgeKept | None, wanted_s: float | None) -> dict[str, Any] | None:
    if kept is None:
        return None
    return {
        "duration_s": kept.scenario.duration,
        "from_s": kept.from_s,
        "seed": kept.scenario.seed,
        "patrol": patrol_name(kept.scenario.patrol.policy),
        "mean_s": kept.mean_s,
        "max_s": kept.max_s,
        "peak_s": kept.peak_s,
        "keeps": None if wanted_s is None else kept.keeps(wanted_s),
        "verdict": kept.outcome,
        "warnings": list(kept.warnings),
        "trace_hash": kept.trace_hash,
        "all_max_s": kept.all_max_s,
        "closed": sorted(kept.closed),
        "zones_s": dict(kept.zones_s),
    }


def _shared_s(tours: BestTour, scenario: Scenario, limits: SpeedLimits) -> float | None:
    """Return the MFoW of a fleet on the tours that its robots share, s; None without tours."""
    if tours.length_m is None:
        return None
    return max(_driven_s(part.way, part.length_m or 0.0, scenario, limits) / len(part.speeds) for part in tours.parts)


def _driven_s(way: Sequence[tuple[float, float]], length_m: float, scenario: Scenario, limits: SpeedLimits) -> float:
    """Return the time of a closed way, s: at the robots' speed, or that of slow zones, as if always in force."""
    speed, slow = scenario.roster[0].speed, [zone.name for zone in scenario.zones if zone.speed is not None]
    time_s = length_m / speed
    for (x, y), (to_x, to_y) in pairwise([*way, way[0]]) if slow else ():
        part_m = math.dist((x, y), (to_x, to_y))
        count = max(1, math.ceil(part_m / scenario.point))
        for share in (np.arange(count) + 0.5) / count:
            limit = limits.at(x + share * (to_x - x), y + share * (to_y - y), slow)
            time_s += max(0.0, 1.0 / limit - 1.0 / speed) * part_m / count
    return time_s
