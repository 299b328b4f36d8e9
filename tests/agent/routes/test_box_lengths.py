"""Boxes hold the path lengths that the wave of the whole terrain gives."""

from __future__ import annotations

import pytest

from agent.routes.box_lengths import ROOM, BoxWave, box_around
from agent.routes.ground import Ground
from agent.routes.path_window import FAR
from agent.routes.wave import Wave
from tests.agent.plans import cluttered


@pytest.mark.parametrize("seed", range(5))
def test_a_box_holds_the_lengths_of_paths_that_do_not_leave_it(seed: int) -> None:
    terrain = cluttered(seed, (60, 70), 40)
    ground, wave = Ground(terrain, terrain.passable), Wave(60, 70, 70)
    starts, limit = [(3, 4), (2, 66)], 2000
    whole = wave.lengths_from(ground, 4, 5, [(row + 1, col + 1) for row, col in starts], limit)
    lengths = BoxWave().lengths(ground, starts, (0, 26, 0, 70), limit)
    for row in range(24):
        for col in range(70):
            known = int(lengths.cell[row - lengths.row0, col - lengths.col0])
            length = known >> 1 if 0 < known <= 2 * limit + 1 else FAR
            assert length == whole[row + 1, col + 1]


def test_a_wave_that_needs_more_room_takes_it() -> None:
    terrain = cluttered(1, (400, 400), 0)
    ground, starts = Ground(terrain, terrain.passable), [(row, col) for row in range(0, 400, 4) for col in (0, 399)]
    many = [(row, col) for row in range(0, 400, 4) for col in range(0, 400, 4)]
    assert len(many) > ROOM
    lengths = BoxWave().lengths(ground, [*starts, *many], (0, 400, 0, 400), 10_000)
    assert lengths.length(1, 1) == 141
    assert lengths.length(0, 399) == 0


def test_a_box_ends_where_the_terrain_does() -> None:
    assert box_around((5, 30), 10, (40, 35)) == (0, 16, 20, 35)
