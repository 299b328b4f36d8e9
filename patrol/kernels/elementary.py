"""Kernels of elementary functions that give the same numbers on every x86-64 processor.

numpy has versions of its own for processors with AVX-512, which differ from the C library's in the last bit. That is
enough to turn a robot at a sector's border, and so to change a whole run. These call the C library, one number at a
time. Use them for whatever a trace depends on; `np.sqrt`, `np.hypot` and `np.floor` are the same everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, cast

import numpy as np
from numba import float64, vectorize
from numpy.typing import NDArray

if TYPE_CHECKING:
    from numba.core.typing.templates import Signature

Elementary = Callable[..., NDArray[np.float64]]
"""Takes numbers, or arrays of any shape that fit each other."""


def _compile_elementary(signature: Signature) -> Callable[[Callable[..., float]], Elementary]:
    compiled = vectorize([signature], cache=True)  # type: ignore[no-untyped-call]
    return cast("Callable[[Callable[..., float]], Elementary]", compiled)


@_compile_elementary(float64(float64))
def exp(x: float) -> float:
    """Return e to the power of x."""
    return math.exp(x)


@_compile_elementary(float64(float64))
def log10(x: float) -> float:
    """Return the decimal logarithm of x."""
    return math.log10(x)


@_compile_elementary(float64(float64, float64))
def power(base: float, exponent: float) -> float:
    """Return a base to the power of an exponent.

    For example, ``power(2.0, 3.0)`` is 8.0.
    """
    return math.pow(base, exponent)


@_compile_elementary(float64(float64, float64))
def arctan2(y: float, x: float) -> float:
    """Return the bearing of (x, y) from the origin, rad, in [-pi, pi].

    For example, ``arctan2(1.0, 1.0)`` is pi / 4.
    """
    return math.atan2(y, x)
