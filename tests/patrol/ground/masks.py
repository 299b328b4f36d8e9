"""Small masks, fields with blocks and posts, and lines of sight by their definition."""

import math
from fractions import Fraction

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from patrol.ground.footprint import View
from patrol.ground.terrain import BoolGrid

masks = hnp.arrays(np.bool_, st.tuples(st.integers(1, 14), st.integers(1, 14)), elements=st.integers(0, 9).map(bool))


def random_map(seed: int, height: int = 34, width: int = 40) -> BoolGrid:
    """A field with a few blocks and single posts."""
    rng = np.random.default_rng(seed)
    passable = np.ones((height, width), dtype=np.bool_)
    for _ in range(rng.integers(2, 9)):
        row, col = rng.integers(0, height), rng.integers(0, width)
        passable[row : row + rng.integers(1, 9), col : col + rng.integers(1, 9)] = False
    passable[rng.integers(0, height, 5), rng.integers(0, width, 5)] = False
    return passable


def on_terrain(view: View, shape: tuple[int, int]) -> BoolGrid:
    """A view's mask laid over the whole terrain."""
    seen = np.zeros(shape, dtype=np.bool_)
    rows, cols = np.nonzero(view.mask)
    rows, cols = rows + view.row0, cols + view.col0
    inside = (rows >= 0) & (rows < shape[0]) & (cols >= 0) & (cols < shape[1])
    seen[rows[inside], cols[inside]] = True
    return seen


def line_is_free(passable: BoolGrid, a: tuple[int, int], b: tuple[int, int], lenient: bool) -> bool:
    """Return whether the line between two points' centres passes every row (or, if it is flat, column) on its way.

    Exactly between two points it passes with one of the two free if lenient, and needs both otherwise.
    """
    (r0, c0), (r1, c1) = a, b
    if abs(c1 - c0) > abs(r1 - r0):
        return line_is_free(passable.T, (c0, r0), (c1, r1), lenient)
    steps = abs(r1 - r0)
    for step in range(1, steps):
        across = Fraction((c1 - c0) * step, steps) + c0
        row = r0 + (step if r1 > r0 else -step)
        touched = {math.floor(across + Fraction(1, 2)), math.ceil(across - Fraction(1, 2))}
        free = [bool(passable[row, col]) for col in touched]
        if not (any(free) if lenient else all(free)):
            return False
    return True
