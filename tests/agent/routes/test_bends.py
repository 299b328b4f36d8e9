"""First bends on large grounds: by rows, by runs, and when by which. What they are: `test_wave.py`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.routes import wave as wave_module
from agent.routes.ground import Ground
from agent.routes.kernels.bends import follow
from agent.routes.kernels.bends_by_rows import take_over
from agent.routes.kernels.wave import SETTLED, STATUS
from agent.routes.wave import Wave
from patrol.ground.terrain import Terrain

Bools = NDArray[np.bool_]

BY_ROWS = 2**20
"""Work for which every map of these tests can be done row by row."""


def methods_used(patch: pytest.MonkeyPatch) -> list[str]:
    """A list to which every wave adds how it finds bends from now on: by rows or by runs."""
    used: list[str] = []

    def by_rows(*given: Any) -> bool:
        used.append("rows")
        return bool(take_over(*given))

    def by_runs(*given: Any) -> None:
        used.append("runs")
        follow(*given)

    patch.setattr(wave_module, "take_over", by_rows)
    patch.setattr(wave_module, "follow", by_runs)
    return used


@pytest.mark.parametrize("gap", [2, 7])
@pytest.mark.parametrize("work", [0, 20_000, BY_ROWS])
def test_bends_of_winding_paths_are_the_same_however_they_are_found(
    gap: int, work: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through a labyrinth whose paths turn up and down many times, and with too little room at first."""
    is_open = np.random.default_rng(gap).random((400, 700)) >= 0.1
    for number, col in enumerate(range(gap, 700, 40)):
        is_open[:, col] = False
        is_open[slice(0, gap) if number % 2 else slice(400 - gap, 400), col] = True
    is_open[200, 350] = True
    ground = Ground(Terrain("t", is_open, 1.0), is_open)
    wave, by_runs = Wave(400, 700, 9000), Wave(400, 700, 9000)
    ways = {0: {"runs"}, 20_000: {"rows", "runs"}, BY_ROWS: {"rows"}}
    for window, worth in ((by_runs, 0), (wave, work)):
        monkeypatch.setattr(Wave, "_worth", lambda *_, worth=worth: worth)
        used = methods_used(monkeypatch)
        window.begin(ground, 201, 351)
        for limit in (5000, 40_000, 900_000):
            window.extend(limit)
        assert set(used) == ways[worth]
    known = by_runs.state & STATUS == SETTLED
    assert np.array_equal(known, wave.state & STATUS == SETTLED)
    assert known.sum() > 50_000
    assert np.array_equal(by_runs.bend[known], wave.bend[known])


def test_only_paths_that_fill_much_of_a_box_are_looked_at_row_by_row(monkeypatch: pytest.MonkeyPatch) -> None:
    is_open = np.ones((900, 900), dtype=np.bool_)
    hall, cell = (450, 450), (200, 200)
    is_open[150:251, [150, 250]] = is_open[[150, 250], 150:251] = False
    ground = Ground(Terrain("t", is_open, 1.0), is_open)
    wave = Wave(900, 900, 900)
    used = methods_used(monkeypatch)

    def by(start: tuple[int, int], *limits: int) -> list[str]:
        used.clear()
        wave.begin(ground, start[0] + 1, start[1] + 1)
        for limit in limits:
            wave.extend(limit)
        return list(used)

    assert by(hall, 90_000) == ["rows"]
    assert by(hall, 3000) == ["runs"]  # few points
    assert by(cell, 90_000) == ["runs"]  # few points in a large box
    # Only what was not found run by run before would have to be found so.
    assert by(hall, 3000, 90_000, 90_050) == ["runs", "rows", "rows"]


def speckled() -> Bools:
    is_open = np.random.default_rng(6).random((700, 700)) >= 0.02
    is_open[350, 350] = True
    return is_open


def corridors(every: int) -> Bools:
    """Side by side, joined at alternate ends."""
    is_open = np.ones((700, 700), dtype=np.bool_)
    for number, col in enumerate(range(10, 700, every)):
        is_open[1:, col] = is_open[:-1, col] = False
        is_open[0 if number % 2 else -1, col] = True
    return is_open


@pytest.mark.parametrize(
    ("is_open", "expected"),
    [(speckled(), {"runs"}), (corridors(5), {"runs"}), (corridors(40), {"rows", "runs"})],
    ids=["many small obstacles", "narrow and winding", "winding"],
)
def test_row_by_row_gives_way_to_run_by_run_and_takes_no_more_memory(
    is_open: Bools, expected: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = {}
    for name, worth in (("chosen", Wave._worth), ("runs", lambda *_: 0)):
        monkeypatch.setattr(Wave, "_worth", worth)
        used = methods_used(monkeypatch)
        wave = Wave(700, 700, 700)
        wave.begin(Ground(Terrain("t", is_open, 1.0), is_open), 351, 351)
        wave.extend(10**7)
        taken[name] = wave._lists.nbytes
        # With too little room at first, the wave begins anew, and finds bends again.
        assert set(used) == (expected if name == "chosen" else {"runs"})
    assert taken["chosen"] == taken["runs"]
