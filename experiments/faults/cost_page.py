"""The page of the faults experiment, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from experiments.faults.cost import AGAINST, GROUPS, QUIET, VARIANTS, FaultComparison, FaultSetup, Finding
from experiments.sweeps.stats import Estimate
from experiments.sweeps.texttable import markdown_table

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
    parts = (*_head(setup, command, computing_s, failed, pictures), *_comparisons(compared), *_groups(found))
    return "\n".join([*parts, ""])


def _head(setup: FaultSetup, command: str, computing_s: float, failed: int, pictures: Sequence[str]) -> Iterator[str]:
    yield "# What faults cost"
    yield ""
    yield f"Made by `{command}`: {computing_s / 60.0:.0f} min of computing time on one core."
    yield ""
    where = f"`{setup.terrain}`, {setup.robots} robots, {setup.duration:g} s, points of {setup.point:g} m"
    yield f"{where}, seeds {', '.join(map(str, setup.seeds))}; all other settings have their defaults:"
    yield "cars that follow the paper's final algorithm and give way (`patrol.give_way`), without and with claims"
    yield "(`patrol.options.separation: claims`)."
    for name, value in setup.settings.items():
        yield f"Set in every run: `{name}: {value}`."
    yield ""
    yield (
        "Numbers are means over the seeds ± half their 95 % interval. Cost: mean MFoW as a ratio to the run of the "
        "same variant and seed without faults. Late: mean MFoW of the second half of the run, whether or not faults "
        "are active then. Belief error: absolute difference between the believed and the true age of a point, averaged "
        "over points, robots and time. Longest stay: the longest time that a living robot of any run stayed in one "
        "circle of four radii and strides."
    )
    if failed:
        yield ""
        yield f"**{failed} runs failed or were not valid; they are left out.**"
    else:
        yield "Every run's verdict is valid: each loss, delay and forgery was recomputed from its random draw."
    for picture in pictures:
        yield ""
        yield f"![{picture}]({picture})"


def _groups(found: Sequence[Finding]) -> Iterator[str]:
    for group, title in GROUPS.items():
        here = [cost for cost in found if cost.condition.group == group]
        if here:
            yield ""
            yield f"## {title[0].upper()}{title[1:]}"
            yield ""
            names = dict.fromkeys(cost.condition.name for cost in here)
            order = [(name, variant) for name in names for variant in VARIANTS]
            here.sort(key=lambda cost: order.index((cost.condition.name, cost.variant)))
            yield from markdown_table(HEADS, [_row(cost) for cost in here])


def _comparisons(compared: Sequence[FaultComparison]) -> Iterator[str]:
    for group, title in AGAINST.items():
        here = [comparison for comparison in compared if comparison.group == group]
        if here:
            yield ""
            yield f"## {title[0].upper()}{title[1:]}"
            yield ""
            rows = [[ratio.what, ratio.variant, _text(ratio.ratio, 3)] for ratio in here]
            yield from markdown_table(("", "variant", "ratio"), rows)


def _row(one: Finding) -> list[str]:
    cost = "-" if one.condition.name == QUIET else _text(one.cost, 3)
    share = "-" if one.delivered is None else f"{100.0 * one.delivered.mean:.1f} %"
    stay = "-" if one.stay is None else f"{one.stay:.0f}"
    numbers = (_text(one.mfow), cost, _text(one.late), share, _text(one.belief), _text(one.collisions, 0), stay)
    return [one.condition.name, one.variant, *numbers]


def _text(found: Estimate | None, digits: int = 1) -> str:
    if found is None:
        return "-"
    return f"{found.mean:.{digits}f}" + ("" if found.half is None else f" ± {found.half:.{digits}f}")
