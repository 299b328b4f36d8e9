"""The declarations of a metric, which documents, tables and sweeps read, and of a report's table of figures.

A metric is a field of a model in `patrol.summary.model`, annotated with a `Metric`:

    seen_share: Annotated[float | None, Metric("share of the ground that was seen", "%", "seen", digits=2)]

Its key in summary.json is the field's name, and its type is the field's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from pydantic import BaseModel

Number = float | None

REDUCTIONS: Mapping[str, Callable[[Sequence[Any]], Number]] = {
    "sum": sum,
    "mean": lambda values: sum(values) / len(values),
    "max": lambda values: max(value or 0.0 for value in values),
    "once": lambda values: values[0],
    "count": lambda values: len(values[0]),
}
"""Ways to make one number of all robots' values; "once" and "count" are for what a run has once."""


@dataclass(frozen=True, slots=True)
class Metric:
    """A number of the summary: its meaning, and how it is shown."""

    meaning: str  # one line of Markdown for the documentation
    unit: str = ""  # in which it is printed; empty for none; what is printed in "%" is stored as a share from 0 to 1
    # heading in the tables of terminal, report and comparison; empty for a number that only summary.json has
    title: str = ""
    note: str = ""
    digits: int = 1
    better: str = ""  # "lower", "higher", or empty for neither
    # a key of `REDUCTIONS`: how sweeps have it; empty for a number that depends on the machine, or says nothing of a
    # patrol
    sweep: str = ""
    # of the results of sweeps, with values as printed, such as ``dead_end_percent`` for ``dead_end_share``; empty for
    # the key, with values as stored
    column: str = ""

    @property
    def scale(self) -> float:
        """The factor between the stored and the printed value, for example 100 for a metric in "%"."""
        return 100.0 if self.unit == "%" else 1.0

    def number(self, value: Number, group: str = "") -> str:
        """Format a value as stored without its unit; None gives "-".

        For example, 0.9512 of a metric in "%" with two digits gives "95.12".

        `group` stands between groups of three digits.
        """
        return "-" if value is None else f"{self.scale * value:,.{self.digits}f}".replace(",", group)

    def text(self, value: Number, group: str = "") -> str:
        """Format a value as stored with its unit, for example "59.5 s"; None gives "-".

        `group` stands between groups of three digits.
        """
        return self.number(value, group) if value is None else f"{self.number(value, group)} {self.unit}".rstrip()

    def reduced(self, values: Sequence[Any]) -> Number:
        """Return the number in a sweep's column.

        For example, a metric that sweeps have as "mean" gives 3.0 for 2.0 and 4.0.

        `values` come robot by robot; for a metric that a run has once, they are that one value.
        """
        number = REDUCTIONS[self.sweep](values)
        return number if number is None or not self.column else self.scale * number


def metrics_of(model: type[BaseModel]) -> Iterator[tuple[str, Metric]]:
    """List the metrics of a model."""
    for key, field in model.model_fields.items():
        for metric in field.metadata:
            if isinstance(metric, Metric):
                yield key, metric


class FiguresTable(NamedTuple):
    """The figures of a feature as a table, for a report."""

    heads: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    numbers: range  # the columns that hold numbers
    text: str = ""  # stands above it
