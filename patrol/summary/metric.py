"""The declaration of a metric: everything that documents, tables and sweeps need to know of it.

A metric is a field of a model in `patrol.summary.model`, annotated with a `Metric`:

    seen_share: Annotated[float | None, Metric("share of the ground that was seen", "%", "seen", digits=2)]

Its key in summary.json is the field's name, and its type is the field's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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
    """A number of the summary: its meaning, and how it is shown.

    Attributes:
        meaning: One line of Markdown for the documentation.
        unit: Unit in which it is printed; empty for none. What is printed in "%" is stored as a share from 0 to 1.
        title: Heading in the tables of the terminal, the report and the comparison; empty for a number that only
            summary.json has.
        note: Remark beside the value in the report.
        digits: Decimals that are printed.
        better: Which of two values is better: "lower", "higher", or empty for neither.
        sweep: A key of `REDUCTIONS`: how sweeps have it; empty for a number that depends on the machine, or says
            nothing of a patrol.
        column: Name of its column in the results of sweeps, whose values are as printed, for example
            ``dead_end_percent`` for ``dead_end_share``; empty for the key, with values as stored.
    """

    meaning: str
    unit: str = ""
    title: str = ""
    note: str = ""
    digits: int = 1
    better: str = ""
    sweep: str = ""
    column: str = ""

    @property
    def scale(self) -> float:
        """The factor between the stored and the printed value."""
        return 100.0 if self.unit == "%" else 1.0

    def number(self, value: Number, group: str = "") -> str:
        """Format a value without its unit.

        Args:
            value: The value as stored; None gives "-".
            group: Stands between groups of three digits.
        """
        return "-" if value is None else f"{self.scale * value:,.{self.digits}f}".replace(",", group)

    def text(self, value: Number, group: str = "") -> str:
        """Format a value with its unit, for example "59.5 s".

        Args:
            value: The value as stored; None gives "-".
            group: Stands between groups of three digits.
        """
        return self.number(value, group) if value is None else f"{self.number(value, group)} {self.unit}".rstrip()

    def reduced(self, values: Sequence[Any]) -> Number:
        """Return the number in a sweep's column.

        Args:
            values: The values, robot by robot; of a metric that a run has once, this one.
        """
        number = REDUCTIONS[self.sweep](values)
        return number if number is None or not self.column else self.scale * number


def metrics_of(model: type[BaseModel]) -> Iterator[tuple[str, Metric]]:
    """List the metrics of a model.

    Args:
        model: A model of `patrol.summary.model`.

    Yields:
        The keys with their metrics, in the order of summary.json.
    """
    for key, field in model.model_fields.items():
        for metric in field.metadata:
            if isinstance(metric, Metric):
                yield key, metric
