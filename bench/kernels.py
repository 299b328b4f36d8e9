"""The kernels: the wave and the dilatation beside their rivals, one look of a sensor, one record of a journal."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.grounds import GROUNDS
from bench.ours import Dilatation, Look, WholeWave
from bench.rivals import DILATATION_PACKAGE, INSTALL, WAVES, Disagreement, checked_wave, dilatation_rival, version_of
from bench.runner import Bench
from patrol.ground.terrain import BoolGrid
from patrol.journal import RobotTick, Status, TickRecord, pack
from patrol.journal.decode import decode

OURS = "ours"
REACH = 50
"""The paper's dilatation, 5 m, in points of 0.1 m."""
SIDE = 400
"""Of the field of the dilatation in points: what five looks of one tick change, and a window around it."""
TICK = 500


def main() -> None:
    """Measure all kernels."""
    bench = Bench("kernels")
    rivals = {name: version for name, rival in WAVES.items() if (version := version_of(rival.package))}
    if not bench.worker:
        for name in WAVES.keys() - rivals.keys():
            print(f"{name}: not installed: {INSTALL}")
    for ground in GROUNDS:
        bench.measure(f"wave, {ground}: {OURS}, lengths alone", partial(own_wave, ground, bends=False))
        bench.measure(f"wave, {ground}: {OURS}, with first bends", partial(own_wave, ground, bends=True))
        for name, version in rivals.items():
            bench.measure(f"wave, {ground}: {name} {version}", partial(rival_wave, ground, name), WAVES[name].note)
    for walls, what in ((False, "open points"), (True, "points with a wall")):
        task = f"dilatation, {SIDE} x {SIDE} {what}"
        bench.measure(f"{task}: {OURS}", partial(own_dilatation, walls))
        if version := version_of(DILATATION_PACKAGE):
            bench.measure(f"{task}: {DILATATION_PACKAGE} {version}", partial(rival_dilatation, walls))
    bench.measure("a look of 10 m at 0.1 m", own_look)
    bench.measure("a record of five robots, decoded", own_record)
    bench.end()


def own_wave(ground: str, bends: bool) -> Callable[[], object]:
    """Return our wave over a ground.

    Args:
        ground: One of `GROUNDS`.
        bends: Whether it finds first bends too.
    """
    wave = WholeWave(*GROUNDS[ground]())
    return wave.run if bends else wave.run_lengths


def rival_wave(ground: str, name: str) -> Callable[[], object]:
    """Return a rival's wave over a ground, which has been checked against ours.

    Args:
        ground: One of `GROUNDS`.
        name: One of `WAVES`.
    """
    call, _ = checked_wave(name, *GROUNDS[ground]())
    return call


def dilatation_field(walls: bool) -> tuple[NDArray[np.int32], BoolGrid]:
    """Return when each point was seen, int32 (h, w), and whether staleness spreads over it, bool (h, w).

    Args:
        walls: Whether there is a wall.
    """
    is_open = np.ones((SIDE, SIDE), dtype=np.bool_)
    if walls:
        is_open[SIDE // 2, SIDE // 8 : -SIDE // 8] = False
    ages = np.arange(SIDE * SIDE, dtype=np.int64) * 7919 % TICK
    return ages.reshape(is_open.shape).astype(np.int32), is_open


def own_dilatation(walls: bool) -> Callable[[], object]:
    """Return our dilatation.

    Args:
        walls: Whether there is a wall.
    """
    return Dilatation(*dilatation_field(walls), REACH, TICK).run


def rival_dilatation(walls: bool) -> Callable[[], object]:
    """Return scipy's dilatation, which has been checked against ours.

    Args:
        walls: Whether there is a wall.

    Raises:
        Disagreement: Its ticks are not equal to ours.
    """
    seen, is_open = dilatation_field(walls)
    ours = Dilatation(seen, is_open, REACH, TICK)
    ours.run()
    call = dilatation_rival(seen, is_open, REACH, TICK)
    if not np.array_equal(ours.dilated[is_open], call()[is_open]):
        raise Disagreement("scipy: its ticks differ from ours")
    return call


def own_look() -> Callable[[], object]:
    """Return one look of a sensor."""
    return Look(np.ones((600, 600), dtype=np.bool_), (300, 300), 100).run


def own_record() -> Callable[[], object]:
    """Return the decoding of one tick's record."""
    row: tuple[Any, ...] = (Status.ALIVE, 1.5, 2.5, 0.3, 1.0, 0.1, False, "patrolling", (1.0, 2.0), 1.5, 0)
    numbers = range(1, 6)
    robots = tuple(RobotTick(number, *row) for number in numbers)
    links = tuple((source, to, 3) for source in numbers for to in numbers if to != source)
    frames = tuple((number, bytes(20)) for number in numbers)
    payload = pack(TickRecord(3, robots, frames, links, (), 9, 1.5, 100))
    return lambda: decode(payload, len(robots))


if __name__ == "__main__":
    main()
