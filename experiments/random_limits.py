"""Limits of random buildings, in a file of their own, so that they are checked before any kernel is compiled."""

from __future__ import annotations

from patrol.errors import BadInput

RADII, POINTS = (0.1, 0.8), (0.05, 0.5)
"""Least and largest radius of a body and side of a point, m: buildings are 10 to 31 m long whatever the body."""


def check_building(seed: int, radius: float, point: float, shown: str = "{} =") -> None:
    """Refuse a seed, radius or point out of its limits; `radius` and `point` are in m.

    `shown` is a format for an argument's name in errors.
    """
    if seed < 0:
        raise BadInput(f"{shown.format('seed')} {seed}: expected an integer from 0")
    for name, value, (lower, upper) in (("radius", radius, RADII), ("point", point, POINTS)):
        if not lower <= value <= upper:
            raise BadInput(f"{shown.format(name)} {value:g}: expected m from {lower:g} to {upper:g}")
