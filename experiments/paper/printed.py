"""The data of the paper: its Tables 2 to 8 as printed, the settings of each cell, and its claims.

`paper.yaml` beside this file holds the data. It also holds, in words, what is assumed where the paper leaves something
open; that is shown with every table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from pydantic import TypeAdapter

from patrol.errors import BadInput, did_you_mean
from patrol.files.yaml_text import parse_yaml

MFOW = "mfow_mean_s"
"""Name of the paper's score among a run's metrics."""


@dataclass(frozen=True, slots=True)
class PaperTable:
    """One of the paper's tables."""

    title: str
    assumed: tuple[str, ...]  # what is assumed where the paper leaves something open
    settings: Mapping[str, object]  # in all its cells, by dotted field of the scenario
    rows: Mapping[str, Mapping[str, object]]  # what each row sets, by its name
    over: str  # what the columns vary, in words
    field: str  # what the columns vary in the scenario
    columns: tuple[int | str, ...]  # the field's values
    # by metric and row, a value for each column; None where the paper prints words or nothing
    printed: Mapping[str, Mapping[str, tuple[float | None, ...]]]


@dataclass(frozen=True, slots=True)
class Side:
    """Some cells of one row, one side of a claim."""

    table: int
    row: str
    columns: tuple[int | str, ...]
    metric: str = MFOW


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the paper: the values of one side are lower than those of the other."""

    says: str
    lower: Side
    higher: Side


@dataclass(frozen=True, slots=True)
class Paper:
    """The data of the paper."""

    settings: Mapping[str, object]  # in every cell, by dotted field of the scenario
    tables: Mapping[int, PaperTable]  # by number
    claims: Mapping[str, Claim]  # by name

    def table(self, number: int) -> PaperTable:
        """Return a table."""
        if number not in self.tables:
            raise BadInput(f"table {number}: no such table; choose from {min(self.tables)} to {max(self.tables)}")
        return self.tables[number]

    def claim(self, name: str) -> Claim:
        """Return a claim."""
        if name not in self.claims:
            raise BadInput(f"claim {name}: no such claim; {did_you_mean(name, list(self.claims))}")
        return self.claims[name]


@cache
def paper() -> Paper:
    """Return the data of the paper, read once."""
    text = files("experiments.paper").joinpath("paper.yaml").read_text(encoding="utf-8")
    return TypeAdapter(Paper).validate_python(parse_yaml(text, "paper.yaml"))
