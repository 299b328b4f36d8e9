"""Plans from Python: how many robots some ground needs, as a table, a figure and an answer in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fogwatch.notebook.arguments import checked_arguments, scenario_of
from fogwatch.notebook.html import lines_html, table_html
from monitor.tables.table import Table
from patrol.errors import BadInput
from patrol.scenario import Scenario, naming
from runtime.starting.warmup import SELDOM, warm

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from fogwatch.planning.plan import AgeKept, FleetPlan

__all__ = ["PlanResult", "plan"]


class PlanResult:
    """The number of robots that keep an age on some ground, or the ages that fleets of some sizes keep.

    Attributes:
        plan: The plan itself, with the tours and territories of each fleet.
        folder: The folder of its files; None if they were not written.
    """

    def __init__(self, plan: FleetPlan, folder: Path | None = None) -> None:
        """Take a plan.

        Args:
            plan: The plan.
            folder: The folder that its files were written to; None for none.
        """
        self.plan = plan
        self.folder = folder

    @property
    def robots(self) -> int | None:
        """The least number of robots that keeps the wanted age; without one, the largest number looked at.

        None if no number keeps it.
        """
        return self.plan.chosen

    @property
    def answer(self) -> list[str]:
        """The plan's answer, in lines, as `fogwatch plan` prints it."""
        from fogwatch.planning.answer import answer_lines

        return list(answer_lines(self.plan))

    @property
    def facts(self) -> dict[str, Any]:
        """The content of plan.json (docs/plan.md)."""
        from fogwatch.planning.plan import plan_facts

        return plan_facts(self.plan)

    @property
    def table(self) -> pa.Table:
        """Table with a row a number of robots: bounds, tours, and the ages that simulated fleets kept, s."""
        return Table.of(
            {
                "robots": size.robots,
                "patrolled_area_m2": size.area_m2,
                "bound_s": size.bound_s,
                "tour_s": size.tour_s,
                "own_tours_s": size.own_tours_s,
                **self._kept_fields("", size.simulated),
                **self._kept_fields("one_dead_", size.one_dead),
                **self._kept_fields("other_patrol_", size.other_patrol),
            }
            for size in self.plan.sizes
        ).arrow()

    def figure(self) -> Figure:
        """Draw the ages that fleets keep over their number of robots, as a matplotlib figure.

        Raises:
            BadInput: matplotlib is not installed.
        """
        from fogwatch.planning.folder import curve_figure

        return curve_figure(self.plan)

    def __repr__(self) -> str:
        answer = next((line for line in self.answer if line.startswith("answer: ")), "")
        sizes = [size.robots for size in self.plan.sizes]
        return f"<PlanResult {self.plan.scenario.name}: {answer.removeprefix('answer: ') or f'robots {sizes}'}>"

    def _repr_html_(self) -> str:
        """Show the plan in a notebook: its table, and what it comes to."""
        from fogwatch.planning.answer import answer_table

        return table_html(answer_table(self.plan)) + lines_html(self.answer)

    def _kept_fields(self, prefix: str, kept: AgeKept | None) -> dict[str, object]:
        wanted_s = self.plan.wanted_s
        return {
            f"{prefix}mfow_mean_s": None if kept is None else kept.mean_s,
            f"{prefix}mfow_max_s": None if kept is None else kept.max_s,
            f"{prefix}keeps": None if kept is None or wanted_s is None else kept.keeps(wanted_s),
        }


@checked_arguments
def plan(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    age: float | None = None,
    robots: int | Sequence[int] | None = None,
    overrides: Mapping[str, object] | None = None,
    duration: float | None = None,
    quick: bool = False,
    seeds: int | None = None,
    out: str | Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> PlanResult:
    """Find out how many robots some ground needs so that nothing is older than an age, or what age robots keep.

    The same as `fogwatch plan` (docs/plan.md).

    Args:
        scenario: Ground, body, sensor and policy, as for `run`; faults and intruders are left out.
        age: The age that nothing is to exceed, s; needed without `robots`.
        robots: A number of robots, or several in ascending order; those around the answer unless given.
        overrides: Values by dotted field.
        duration: Length of each simulated run, s; 12 times the age of the tours, at least 600 s, unless given.
        quick: Whether to compute bounds and tours only, and simulate nothing.
        seeds: Simulated runs of each number, each with another seed; 3 unless given.
        out: A folder for the files that `fogwatch plan` writes, new or empty; none are written unless given.
        progress: Called with what is computed and the share of it that is done.

    Returns:
        The result.

    Raises:
        BadInput: The input is wrong; the message is one line that says what, and how to mend it.
    """
    for name, value in (("age", age), ("duration", duration)):
        if value is not None and not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
            raise BadInput(f"{name} = {value!r}: expected a finite number above 0, in s")
    if age is None and robots is None:
        raise BadInput("age, robots: one is needed, for example age=60 for the number of robots that keeps 60 s")
    if quick and duration is not None:
        raise BadInput(f"duration = {duration:g}: has no effect with quick, which simulates nothing; drop one of them")
    if seeds is not None and not (isinstance(seeds, int) and seeds >= 1):
        raise BadInput(f"seeds = {seeds!r}: expected a number of runs, 1 or more")
    loaded = scenario_of(scenario, overrides)
    warm(("patrol", "agent", "worldsim"), lambda _: None, SELDOM)
    from fogwatch.planning.folder import plan_folder, write_plan
    from fogwatch.planning.plan import SEEDS, make_plan

    numbers = None if robots is None else _check_numbers(robots)
    folder = None if out is None else plan_folder(Path(out), loaded.name)
    named = naming(scenario, overrides or ()) if isinstance(scenario, str | Path) else nullcontext()
    with named:
        shown = progress or (lambda _what, _done: None)
        new_plan = make_plan(loaded, age, numbers, shown, duration_s=duration, quick=quick, seeds=seeds or SEEDS)
        if folder is not None:
            write_plan(new_plan, folder)
    return PlanResult(new_plan, folder)


def _check_numbers(robots: int | Sequence[int]) -> list[int]:
    """Check numbers of robots."""
    from fogwatch.planning.plan import MOST_ROBOTS

    numbers = [robots] if isinstance(robots, int) else list(robots) if isinstance(robots, Iterable) else []
    if not all(isinstance(number, int) for number in numbers):
        numbers = []
    rise = all(first < second for first, second in pairwise(numbers))
    if not numbers or not rise or not 1 <= numbers[0] <= numbers[-1] <= MOST_ROBOTS:
        raise BadInput(f"robots = {robots!r}: expected numbers from 1 to {MOST_ROBOTS} that rise, such as range(1, 9)")
    return numbers
