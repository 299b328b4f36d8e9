"""The kernels: the wave and the dilatation against their rivals, one look of a sensor, one record of a journal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from experiments.bench.ours import Dilatation, Look, WholeWave
from experiments.bench.rivals import INSTALL, dilatation_rival, wave_rivals
from experiments.bench.tools.groups import KERNELS
from experiments.bench.tools.measure import Contender, Effort, Measured, Task, Unmeasured, in_turn
from patrol.ground.terrain import BoolGrid
from patrol.journal import RobotTick, Status, TickRecord, pack
from patrol.journal.decode import decode
from patrol.prepare import prepare
from patrol.scenario import load_scenario

OURS = "ours"
OURS_WITH_BENDS = "ours, with first bends"
REACH = 50
"""The paper's dilatation, 5 m, in points of 0.1 m."""
SIDE = 400
"""Of the field of the dilatation in points: what five looks of one tick change, and a window around it."""
TICK = 500


def tasks() -> list[Task]:
    """The measures of the kernels."""
    return [
        Task(KERNELS, "wave, open field of 880 x 1000 points", partial(_open_wave, bends=True)),
        Task(KERNELS, "wave, lengths alone, open field of 880 x 1000 points", partial(_open_wave, bends=False)),
        Task(KERNELS, "wave, site of 1600 x 2400 points", partial(_site_wave, bends=True)),
        Task(KERNELS, "wave, lengths alone, site of 1600 x 2400 points", partial(_site_wave, bends=False)),
        Task(KERNELS, f"dilatation, {SIDE} x {SIDE} open points", partial(_dilatation, walls=False)),
        Task(KERNELS, f"dilatation, {SIDE} x {SIDE} points with a wall", partial(_dilatation, walls=True)),
        Task(KERNELS, "a look of 10 m at 0.1 m", _look),
        Task(KERNELS, "a record of five robots, decoded", _record),
    ]


def _open_wave(effort: Effort, *, bends: bool) -> Sequence[Measured]:
    is_open = np.ones((880, 1000), dtype=np.bool_)
    is_open[[0, -1], :] = is_open[:, [0, -1]] = False
    return _wave(is_open, (440, 500), effort, bends=bends)


def _site_wave(effort: Effort, *, bends: bool) -> Sequence[Measured]:
    prepared = prepare(load_scenario({"terrain": {"builtin": "site"}, "robots": {"count": 1, "model": "holonomic"}}))
    reach = prepared.fields[1].reach
    middle = np.array(reach.shape) // 2
    places = np.argwhere(reach)
    row, col = places[int(np.argmin(np.abs(places - middle).sum(axis=1)))]
    return _wave(reach, (int(row), int(col)), effort, bends=bends)


def _wave(is_open: BoolGrid, start: tuple[int, int], effort: Effort, *, bends: bool) -> Sequence[Measured]:
    wave = WholeWave(is_open, start)
    rivals, missing = wave_rivals(is_open, start, wave.lengths())
    ours = {OURS_WITH_BENDS: Contender(wave.run)} if bends else {OURS: Contender(wave.run_lengths)}
    return [*in_turn({**ours, **rivals}, effort.repeats), *missing]


def _dilatation(effort: Effort, *, walls: bool) -> Sequence[Measured]:
    is_open = np.ones((SIDE, SIDE), dtype=np.bool_)
    if walls:
        is_open[SIDE // 2, SIDE // 8 : -SIDE // 8] = False
    ages = np.arange(SIDE * SIDE, dtype=np.int64) * 7919 % TICK
    seen = ages.reshape(is_open.shape).astype(np.int32)
    ours = Dilatation(seen, is_open, REACH, TICK)
    try:
        name, call = dilatation_rival(seen, is_open, REACH, TICK)
    except ModuleNotFoundError:
        missing = Measured("scipy.ndimage", "ms", (), says=f"not installed: {INSTALL}")
        return [*in_turn({OURS: Contender(ours.run)}, effort.repeats), missing]
    ours.run()
    if not np.array_equal(ours.dilated[is_open], call()[is_open]):
        raise Unmeasured(f"{name}: its ticks differ from ours")
    return in_turn({OURS: Contender(ours.run), name: Contender(call, "ticks equal")}, effort.repeats)


def _look(effort: Effort) -> Sequence[Measured]:
    look = Look(np.ones((600, 600), dtype=np.bool_), (300, 300), 100)
    return in_turn({OURS: Contender(look.run)}, effort.repeats, "us")


def _record(effort: Effort) -> Sequence[Measured]:
    row: tuple[Any, ...] = (Status.ALIVE, 1.5, 2.5, 0.3, 1.0, 0.1, False, "patrolling", (1.0, 2.0), 1.5, 0)
    numbers = range(1, 6)
    robots = tuple(RobotTick(number, *row) for number in numbers)
    links = tuple((source, to, 3) for source in numbers for to in numbers if to != source)
    frames = tuple((number, bytes(20)) for number in numbers)
    payload = pack(TickRecord(3, robots, frames, links, (), 9, 1.5, 100))
    return in_turn({OURS: Contender(lambda: decode(payload, len(robots)))}, effort.repeats, "us")
