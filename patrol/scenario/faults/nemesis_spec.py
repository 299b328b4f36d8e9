"""The scenario's section about its nemesis; `patrol.scenario.nemesis` draws the faults."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, Tag

from patrol.scenario.faults.nemesis_draws import DRAWN
from patrol.values.section import Section, wrong
from patrol.values.types import NotNegative, Positive, Seed, at_least, by_shape, expecting

MOST_FAULTS = 1000
"""A nemesis of more intervals than this is refused."""
QUIET = 1.0 / 3.0
"""Share of the run that is quiet at its end by default."""

if TYPE_CHECKING:
    KindName = str
else:
    KindName = Literal[tuple(DRAWN)]
_KINDS = f"all, or a list of kinds of faults: {', '.join(DRAWN)}"
Kinds = Annotated[
    Annotated[Literal["all"], expecting(_KINDS), Tag("=single")]
    | Annotated[
        tuple[Annotated[KindName, expecting(f"one of {', '.join(DRAWN)}")], ...],
        Field(json_schema_extra={"minItems": 1}),
        at_least(1, "kinds of faults"),
        Tag("=list"),
    ],
    by_shape(_KINDS),
]


class NemesisSpec(Section):
    """Random faults, written out as concrete ones when the scenario is loaded."""

    kinds: Kinds = Field("all", description="all, or a list of kinds of faults")
    interval: Positive = Field(description="s, length of an interval; one fault begins in each")
    seed: Seed | None = Field(None, description="random seed of the faults; null: the scenario's")
    quiet: NotNegative | None = Field(None, description="s without faults at the end; null: a third of the run")


def room_for(spec: NemesisSpec, step: float, ticks: int) -> tuple[int, float]:
    """Return the tick at which a nemesis's quiet window begins, and the length of an interval in ticks.

    The part of the run before that tick is left for faults.
    """
    quiet = ticks * QUIET if spec.quiet is None else spec.quiet / step
    end = min(math.floor(ticks - quiet + 1e-9), ticks - 1)
    if end < 1:
        problem = f"leaves no room for faults in a run of {ticks * step:g} s; give less, or a longer run"
        raise wrong("nemesis.quiet", problem, spec.quiet)
    if spec.interval < step:
        raise wrong("nemesis.interval", f"shorter than one step of {step:g} s; give more", spec.interval)
    if (faults := math.ceil(end * step / spec.interval)) > MOST_FAULTS:
        raise wrong("nemesis.interval", f"makes {faults} faults, at most {MOST_FAULTS} fit; give more", spec.interval)
    return end, spec.interval / step
