"""Kernel that splits a mask into its connected parts."""

from __future__ import annotations

from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
LABELS = types.Array(types.int32, 2, "C")
LIST = types.Array(types.int32, 1, "C")
int32 = types.int32


@njit(types.int32(GRID, LABELS, LIST), cache=True, nogil=True)
def label_parts(mask, labels, work):
    """Number the connected parts of a mask 1, 2, ... in the order of their first points.

    Bodies step to 8 neighbours, diagonally only where both orthogonal neighbours are in the mask. A body that can step
    diagonally can thus also go round by one of these, so the parts are those of 4 neighbours. For
    example, two points that touch at a corner only are two parts.

    Args:
        mask: uint8 (h, w), non-zero inside.
        labels: int32 (h, w), overwritten, 0 outside the mask.
        work: int32 (h * w,), scratch.

    Returns:
        The number of parts.
    """
    height, width = mask.shape
    labels[:, :] = 0
    parts = 0
    for first_row in range(height):
        for first_col in range(width):
            if mask[first_row, first_col] == 0 or labels[first_row, first_col] != 0:
                continue
            parts += 1
            labels[first_row, first_col] = parts
            work[0] = first_row * width + first_col
            waiting = 1
            while waiting > 0:
                waiting -= 1
                row = work[waiting] // width
                col = work[waiting] - row * width
                for side in range(4):
                    r = row + (side == 0) - (side == 1)
                    c = col + (side == 2) - (side == 3)
                    if r < 0 or r >= height or c < 0 or c >= width:
                        continue
                    if mask[r, c] != 0 and labels[r, c] == 0:
                        labels[r, c] = parts
                        work[waiting] = r * width + c
                        waiting += 1
    return parts
