"""The results of a benchmark as JSON, and as Markdown that goes into pages between marks.

A page keeps what people wrote: only what stands between ``<!-- bench GROUP -->`` and ``<!-- end bench -->`` is
replaced.
"""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from experiments.bench.tools.groups import GROUPS
from experiments.bench.tools.machine import Machine
from experiments.bench.tools.measure import Finding, Measured, most_of_others
from patrol.errors import BadInput
from patrol.untrusted import MIB, Kind
from patrol.yaml_text import read_text

PAGE = Kind("a page", 4 * MIB)
END = "<!-- end bench -->"
HEADS = ("what", "unit", "min", "median", "max", "readings", "ratio to ours", "")
ONE_EACH = ("what", "unit", "value", "")
"""The heads of a table in which every measure has at most one reading."""


def as_json(machine: Machine, command: str, findings: Sequence[Finding]) -> dict[str, Any]:
    """The content of a file of results.

    Args:
        machine: Where they were measured.
        command: The command line that did it.
        findings: The results.
    """
    return {
        "machine": asdict(machine),
        "command": command,
        "results": [
            {
                "group": finding.task.group,
                "name": finding.task.name,
                "failure": finding.failure,
                "others_cores": finding.others,
                "measures": [
                    {
                        "name": one.name,
                        "unit": one.unit,
                        "values": list(one.values),
                        "summary": _summary(one.values),
                        "ratio_to_ours": list(one.ratio),
                        "says": one.says,
                    }
                    for one in finding.measures
                ],
            }
            for finding in findings
        ],
    }


def cells(one: Measured) -> tuple[str, ...]:
    """A measure as the cells of a table, for each of `HEADS`.

    Args:
        one: The measure.
    """
    if not one.values:
        return (one.name, one.unit, "-", "-", "-", "0", "", one.says)
    ratio = ""
    if one.ratio:
        low, middle, high = (number(value) for value in spread(one.ratio))
        ratio = f"{middle} ({low} to {high})"
    return (one.name, one.unit, *map(number, spread(one.values)), str(len(one.values)), ratio, one.says)


def table_of(measures: Sequence[Measured]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """A table of measures that is no wider than it must be.

    Args:
        measures: At least one.

    Returns:
        Its heads and its rows.
    """
    rows = [cells(one) for one in measures]
    if all(len(one.values) < 2 for one in measures):
        return ONE_EACH, [(what, unit, value, says) for what, unit, _, value, _, _, _, says in rows]
    kept = [place for place, head in enumerate(HEADS) if head != "ratio to ours" or any(row[place] for row in rows)]
    return tuple(HEADS[place] for place in kept), [tuple(row[place] for place in kept) for row in rows]


def spread(values: Sequence[float]) -> tuple[float, float, float]:
    """The smallest, the median and the largest of some values.

    Args:
        values: At least one.
    """
    return min(values), statistics.median(values), max(values)


def number(value: float) -> str:
    """A number with three digits, or all of those before the point where there are more, and no exponent.

    Args:
        value: The number, finite.
    """
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.3g}")  # 99.96 is 100, which needs no digit after the point
    return f"{value:,.{max(0, 2 - math.floor(math.log10(abs(rounded))))}f}"


def tables(group: str, machine: Machine, command: str, findings: Sequence[Finding]) -> str:
    """The Markdown of one group: what made it, where, and a table.

    Args:
        group: Its name.
        machine: Where it was measured.
        command: The command line that did it.
        findings: The results of all groups.
    """
    return "\n".join(_lines(machine, command, [finding for finding in findings if finding.task.group == group]))


def _lines(machine: Machine, command: str, findings: Sequence[Finding]) -> Iterator[str]:
    yield f"`{command}`"
    yield ""
    for line in machine.lines:
        yield f"{line}  "
    others = most_of_others(findings)
    if others is not None:
        yield f"others' work meanwhile: up to {others:.2f} of {machine.cores} cores  "
    if doubts := machine.doubts(others):
        yield f"**{doubts[0].upper()}{doubts[1:]}**"
    yield ""
    yield f"| | {' | '.join(HEADS)} |"
    yield f"|---|{'---|' * len(HEADS)}"
    for finding in findings:
        if finding.failure:
            yield f"| {finding.task.name} | {_escaped(finding.failure)} |" + " |" * (len(HEADS) - 1)
        for place, one in enumerate(finding.measures):
            yield f"| {'' if place else finding.task.name} | {' | '.join(map(_escaped, cells(one)))} |"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|")


def check_page(path: Path, groups: Sequence[str]) -> None:
    """Find out whether a page can be filled, before anything is measured for it.

    Args:
        path: The page; it need not exist.
        groups: The groups that will be measured.

    Raises:
        BadInput: It exists, and cannot be read or marks none of the groups.
    """
    if path.exists() and not any(_marks(group).search(read_text(path, PAGE)) for group in groups):
        wanted = " or ".join(_begin(group) for group in dict.fromkeys(groups))
        raise BadInput(f"{path}: has no lines {wanted} and {END} to write between; add them, or name a new file")


def page(path: Path, machine: Machine, command: str, findings: Sequence[Finding]) -> str:
    """A page with the tables of all groups that have results.

    Args:
        path: The page. Where it exists, only its marked parts change; where it does not, all of it is new.
        machine: Where the results were measured.
        command: The command line that did it.
        findings: The results.

    Returns:
        The page's new text.

    Raises:
        BadInput: The page cannot be read.
    """
    measured = {
        group: tables(group, machine, command, findings)
        for group in GROUPS
        if any(finding.task.group == group for finding in findings)
    }
    if not path.exists():
        parts = [f"## {group[0].upper()}{group[1:]}\n\n{_marked(group, text)}\n" for group, text in measured.items()]
        return "\n".join(["# Benchmarks\n", *parts])
    return filled(read_text(path, PAGE), measured)


def filled(text: str, parts: Mapping[str, str]) -> str:
    """A page with its marked parts replaced.

    Args:
        text: The page.
        parts: Markdown by the name of its mark; those that the page does not mark are left out.
    """
    for name, part in parts.items():
        text = _marks(name).sub(_marked(name, part).replace("\\", "\\\\"), text)
    return text


def _marks(name: str) -> re.Pattern[str]:
    return re.compile(rf"{re.escape(_begin(name))}\n.*?{re.escape(END)}", re.DOTALL)


def _begin(name: str) -> str:
    return f"<!-- bench {name} -->"


def _marked(name: str, part: str) -> str:
    return f"{_begin(name)}\n\n{part}\n\n{END}"


def _summary(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    low, middle, high = spread(values)
    return {"min": low, "median": middle, "max": high, "readings": float(len(values))}
