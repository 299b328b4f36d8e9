"""The page of the faults experiment, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from experiments.faults.cost import AGAINST, GROUPS, QUIET, VARIANTS, FaultComparison, FaultSetup, Finding
from experiments.sweeps.stats import Estimate, with_interval
from monitor.tables.table import Table

HEADS = (
    "",
    "variant",
    "MFoW (s)",
    "cost",
    "late (s)",
    "delivered",
    "belief error (s)",
    "collisions",
    "longest stay (s)",
)


def page(
    setup: FaultSetup,
    found: Sequence[Finding],
    compared: Sequence[FaultComparison],
    *,
    command: str,
    computing_s: float,
    failed: int,
    pictures: Sequence[str],
) -> str:
    """Return the page as Markdown.

    `computing_s` is the processor time of all runs together; for results of older versions, which lack it, the wall
    time. `pictures` are the files of pictures to show.
    """
    parts = (
        *_page_head(setup, command, computing_s, failed, pictures),
        *_comparison_sections(compared),
        *_group_sections(found),
    )
    return "\n\n".join(parts) + "\n"


def _page_head(
    setup: FaultSetup, command: str, computing_s: float, failed: int, pictures: Sequence[str]
) -> Iterator[str]:
    yield "# What faults cost"
    yield f"Made by `{command}`: {computing_s / 60.0:.0f} min of computing time on one core."
    where = f"`{setup.terrain}`, {setup.robots} robots, {setup.duration:g} s, points of {setup.point:g} m"
    yield f"""{where}, seeds {", ".join(map(str, setup.seeds))}; all other settings have their defaults:
cars that follow the paper's final algorithm and give way (`patrol.give_way`), without and with claims
(`patrol.options.separation: claims`).""" + "".join(
        f"\nSet in every run: `{name}: {value}`." for name, value in setup.settings.items()
    )
    means = (
        "Numbers are means over the seeds ± half their 95 % interval. Cost: mean MFoW as a ratio to the run of the "
        "same variant and seed without faults. Late: mean MFoW of the second half of the run, whether or not faults "
        "are active then. Belief error: absolute difference between the believed and the true age of a point, averaged "
        "over points, robots and time. Longest stay: the longest time that a living robot of any run stayed in one "
        "circle of four radii and strides."
    )
    if failed:
        yield means
        yield f"**{failed} runs failed or were not valid; they are left out.**"
    else:
        valid = "Every run's verdict is valid: each loss, delay and forgery was recomputed from its random draw."
        yield f"{means}\n{valid}"
    yield from (f"![{picture}]({picture})" for picture in pictures)


def _group_sections(found: Sequence[Finding]) -> Iterator[str]:
    for group, title in GROUPS.items():
        here = [cost for cost in found if cost.condition.group == group]
        if here:
            yield f"## {title[0].upper()}{title[1:]}"
            names = dict.fromkeys(cost.condition.name for cost in here)
            order = [(name, variant) for name in names for variant in VARIANTS]
            here.sort(key=lambda cost: order.index((cost.condition.name, cost.variant)))
            yield Table(HEADS, [_finding_row(cost) for cost in here]).markdown()


def _comparison_sections(compared: Sequence[FaultComparison]) -> Iterator[str]:
    for group, title in AGAINST.items():
        rows = [
            (comparison.what, comparison.variant, _estimate_text(comparison.ratio, 3))
            for comparison in compared
            if comparison.group == group
        ]
        if rows:
            yield f"## {title[0].upper()}{title[1:]}"
            yield Table(("", "variant", "ratio"), rows).markdown()


def _finding_row(one: Finding) -> list[str]:
    cost = "-" if one.condition.name == QUIET else _estimate_text(one.cost, 3)
    share = "-" if one.delivered is None else f"{100.0 * one.delivered.mean:.1f} %"
    stay = "-" if one.stay is None else f"{one.stay:.0f}"
    numbers = (
        _estimate_text(one.mfow),
        cost,
        _estimate_text(one.late),
        share,
        _estimate_text(one.belief),
        _estimate_text(one.collisions, 0),
        stay,
    )
    return [one.condition.name, one.variant, *numbers]


def _estimate_text(found: Estimate | None, digits: int = 1) -> str:
    return with_interval(found, digits, " ± ")
