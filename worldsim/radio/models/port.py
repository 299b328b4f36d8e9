"""The port of radio models: what a model gets to know, and what it decides.

A model is made once for a run, and asked once in each tick about all frames that no fault has dropped. For example, a
radio that reaches 40 m and then loses every second frame:

    class Halving:
        def __init__(self, setup):
            self._seed = setup.seed

        def lost(self, air):
            lost = np.zeros(air.on_the_way.shape, dtype=bool)
            for frame, receiver in np.argwhere(air.on_the_way):
                to = air.receivers[receiver]
                if air.distance(frame, receiver) > 40.0:
                    what = air.source[frame], to, air.sequence[frame]
                    lost[frame, receiver] = draw(self._seed, Purpose.RADIO, *what) < 0.5
            return lost
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from patrol.scenario.radio_spec import MODELS

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose

__all__ = ["ModelSetup", "OnAir", "RadioModel"]

OWN_MODEL = "model"
"""The cause, in journals, of frames that a model of one's own has lost."""


def cause_of(model: str) -> str:
    """How journals name what a model has lost: its own name if it comes with fogwatch, else `OWN_MODEL`.

    Args:
        model: As the scenario names it.
    """
    return model if model in MODELS else OWN_MODEL


@dataclass(frozen=True, slots=True)
class ModelSetup:
    """What a model is made from.

    Attributes:
        options: The scenario's `radio.options`, as the class's `Options` if it has such a pydantic model; else empty.
        seed: The scenario's. Draw with `patrol.random.draw(seed, Purpose.RADIO, ...)`, so that the fate of a frame
            depends on no other draw, and a run can be repeated.
        step: s per tick.
        terrain: The ground, with its walls.
    """

    options: Any
    seed: int
    step: float
    terrain: Terrain


@dataclass(frozen=True, slots=True)
class OnAir:
    """The frames of one tick on their way, with f frames and r receivers.

    Attributes:
        k: The tick.
        frames: The bytes of each.
        origin: int64 (f,), the robot from whose radio each comes; 0 for a stranger's, whose place is unknown.
        source: int64 (f,), its sender in the journal; `patrol.journal.records.FORGED` for a forged one.
        sequence: int64 (f,), its number in the journal, different for each frame of a source.
        receivers: int64 (r,), numbers of the receivers, ascending.
        on_the_way: bool (f, r), the links on which no fault has dropped the frame.
        poses: The true ones of all robots that are there, by number, m and rad.
    """

    k: int
    frames: list[bytes]
    origin: NDArray[np.int64]
    source: NDArray[np.int64]
    sequence: NDArray[np.int64]
    receivers: NDArray[np.int64]
    on_the_way: NDArray[np.bool_]
    poses: Mapping[int, Pose]

    def distance(self, frame: int, receiver: int) -> float:
        """Measure how far a frame has to go.

        Args:
            frame: Its place among the frames.
            receiver: The receiver's place among the receivers.

        Returns:
            m; NaN for a stranger's frame.
        """
        origin = int(self.origin[frame])
        if origin not in self.poses:
            return math.nan
        a, b = self.poses[origin], self.poses[int(self.receivers[receiver])]
        return math.hypot(a.x - b.x, a.y - b.y)


class RadioModel(Protocol):
    """A radio model, made from a `ModelSetup`."""

    def lost(self, air: OnAir) -> NDArray[np.bool_]:
        """Say which frames do not get through.

        Args:
            air: The frames of a tick; ticks come in order.

        Returns:
            bool (f, r); only those on their way count.
        """
