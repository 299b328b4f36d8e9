"""Small masks, and fields with blocks and posts."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

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
