"""The window of a scenario's path method. Methods are imported where they are used, as each has kernels of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.routes.path_window import PathWindow
from agent.routes.wave import Wave

if TYPE_CHECKING:
    from patrol.regions.split import RegionSplit


def window_of(
    paths: str,
    sizes: tuple[int, int, int],
    scratch: dict[str, PathWindow],
    patrolled: NDArray[np.bool_],
    regions: RegionSplit | None,
) -> PathWindow:
    """Return the window of a path method, shared where possible.

    Args:
        paths: Name of the path method.
        sizes: The terrain's height and width, and the window's span, in points.
        scratch: Windows made so far.
        patrolled: bool (h, w), for straight paths.
        regions: For paths through regions.

    Raises:
        ValueError: Paths through regions without regions.
    """
    key = f"{paths} {sizes}"
    make: Callable[[], PathWindow] = partial(Wave, *sizes)
    # A window holds a reference to the object whose id is in its key, so no other object can get that id.
    if paths == "regions":
        if regions is None:
            raise ValueError("paths through regions need a split")
        from agent.routes.region_paths import Regions

        key, make = f"{key} {id(regions.parts)}", partial(Regions, *sizes, regions)
    elif paths == "straight":
        from agent.routes.straight import Straight

        key, make = f"{key} {id(patrolled)}", partial(Straight, *sizes, patrolled)
    if key not in scratch:
        scratch[key] = make()
    return scratch[key]
