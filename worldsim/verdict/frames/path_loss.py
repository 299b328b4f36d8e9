"""The verdict's check of the radio model `path-loss`, by true places and draws of its own.

The formulas are those of `worldsim/radio/path_loss.py`, computed a second time link by link, without its code
and kernels. Where a line grazes a wall the number of walls is not sure, and so the powers are not: everything is
computed as the least and the greatest that it can be, and a frame is judged where both lead to the same.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from patrol.random import Purpose, draw, gauss
from patrol.scenario.radio_spec import PATH_LOSS, PathLossRadio
from worldsim.verdict.common.check import Check
from worldsim.verdict.common.faults import NO_ROBOT, forgers_of
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.frames.airborne import fates, origins_of
from worldsim.verdict.frames.reach import Place, Sightlines

if TYPE_CHECKING:
    from patrol.journal.records import TickRecord
    from worldsim.radio.ether import Link
    from worldsim.verdict.common.check import JudgedRun, Readings

ROUNDING_DB = 1e-6
"""Margins are this much less and more sure than computed, dB."""

_SHADOWING, _MOMENT, _RECEPTION = range(3)
"""Purposes of draws, after the seed and `Purpose.RADIO`: (window, sender, receiver), (source, sequence), (source,
receiver, sequence)."""

Span = tuple[float, float]
"""The least and the greatest that a number can be."""


class PathLossAsAsked(Check):
    """Frames that got through were received by the model's formula and draws, and frames that it lost were not."""

    name = "path loss"
    of_ether = True
    needs = (RobotsThere,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        radio = run.prepared.scenario.radio
        assert isinstance(radio, PathLossRadio)
        self._options = radio.options
        self._names = run.senders
        self._seed = run.prepared.scenario.seed
        self._step = run.step
        self._sightlines = Sightlines(run.prepared.terrain)
        self._forgers = forgers_of(run.timeline)
        self._shadowing: dict[tuple[int, int], float] = {}
        self._places: dict[int, Place] = {}
        self._powers: dict[tuple[int, int], Span] = {}
        self._window = self._lost = self._judged = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the world carried frames by this model."""
        return super().applies(run) and run.prepared.scenario.radio.model == PATH_LOSS

    def _tick(self, record: TickRecord) -> None:
        self._places = {row.number: (row.x, row.y) for row in record.robots}
        self._powers = {}
        redraw = self._options.redraw
        window = 0 if redraw is None else math.floor(record.k * self._step / redraw + 1e-9)
        if window != self._window:
            self._window = window
            self._shadowing.clear()
        through = [
            (origin, link, why)
            for origin, link, why in fates(record, self._forgers)
            if origin != NO_ROBOT and why in ("", PATH_LOSS)
        ]
        disturbs = self._disturbing(record, [link for _, link, _ in through])
        for origin, link, why in through:
            least, greatest = self._margin(origin, link[1], disturbs.get(link, []))
            drawn = draw(self._seed, Purpose.RADIO, _RECEPTION, *link)
            self._lost += why == PATH_LOSS
            self._judged += 1
            if why == PATH_LOSS and drawn < self._chance(least - ROUNDING_DB):
                self._wrong(link, record.k, "was lost by path loss and should have been received")
            elif not why and drawn >= self._chance(greatest + ROUNDING_DB):
                self._wrong(link, record.k, "got through and should have been lost by path loss")

    def _good(self) -> str:
        return f"{self._lost} of {self._judged} frames were lost by path loss, as recomputed"

    def _disturbing(self, record: TickRecord, through: list[Link]) -> dict[Link, list[int]]:
        """Find the robots whose frames overlap a frame at a receiver; the receiver itself where it was sending."""
        airtime = self._options.airtime
        if airtime == 0.0:
            return {}
        begins = {
            (source, sequence): (self._step * draw(self._seed, Purpose.RADIO, _MOMENT, source, sequence), origin)
            for (source, sequence), origin in origins_of(record, self._forgers).items()
        }
        reached: dict[tuple[int, int], set[int]] = {}
        for source, to, sequence in through:
            reached.setdefault((source, sequence), set()).add(to)
        by_moment = sorted((*begins[frame], frame) for frame in reached)
        overlapping: dict[tuple[int, int], list[tuple[int, tuple[int, int]]]] = {}
        for place, (moment, origin, frame) in enumerate(by_moment):
            for next_moment, other, following in by_moment[place + 1 :]:
                if next_moment - moment >= airtime:
                    break
                if origin != other:
                    overlapping.setdefault(frame, []).append((other, following))
                    overlapping.setdefault(following, []).append((origin, frame))
        return {
            (source, to, sequence): [
                other for other, frame in overlapping[source, sequence] if other == to or to in reached[frame]
            ]
            for source, to, sequence in through
            if (source, sequence) in overlapping
        }

    def _margin(self, origin: int, to: int, disturbing: list[int]) -> Span:
        """Return by how much a receiver has more than it needs, dB."""
        options = self._options
        needs = options.sensitivity - options.noise
        noise = 10.0 ** (options.noise / 10.0)
        powers = [self._power(other, to) for other in disturbing]
        loud = [noise + math.fsum(10.0 ** (power[side] / 10.0) for power in powers) for side in (0, 1)]
        least, greatest = self._power(origin, to)
        return least - 10.0 * math.log10(loud[1]) - needs, greatest - 10.0 * math.log10(loud[0]) - needs

    def _power(self, origin: int, to: int) -> Span:
        """Return the power that a robot receives from another, dBm; its own is what it sends with."""
        options = self._options
        if origin == to:
            return options.power, options.power
        if (origin, to) not in self._powers:
            a, b = self._places[origin], self._places[to]
            clear = options.power - options.reference - 10.0 * options.exponent * math.log10(max(math.dist(a, b), 1.0))
            walls = self._sightlines.crossings(a, b) if options.wall > 0.0 else (0, 0)
            for link in ((origin, to), (to, origin)):
                level = clear - options.shadowing * self._drawn(*link)
                self._powers[link] = level - options.wall * walls[1], level - options.wall * walls[0]
        return self._powers[origin, to]

    def _drawn(self, origin: int, to: int) -> float:
        link = origin, to
        if link not in self._shadowing:
            self._shadowing[link] = gauss(self._seed, Purpose.RADIO, _SHADOWING, self._window, *link)
        return self._shadowing[link]

    def _chance(self, margin: float) -> float:
        """Return the probability with which a frame is received."""
        edge = self._options.edge
        if edge == 0.0:
            return float(margin >= 0.0)
        return 0.5 * (1.0 + math.tanh(0.5 * margin / edge))

    def _wrong(self, link: Link, k: int, problem: str) -> None:
        source, to, _ = link
        names = self._names
        self._fail(f"a frame from {names.get(source, source)} to {names.get(to, to)} of tick {k} {problem}")
