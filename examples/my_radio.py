"""A radio model of one's own: robots hear each other up to `reach` metres, and every second frame beyond.

    fogwatch run yards --set radio.model=./examples/my_radio.py:Halving --set radio.options.reach=30

docs/radio.md says what a model gets to know and what it may answer.
"""

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from patrol.random import Purpose, draw
from worldsim.radio.models import ModelSetup, OnAir


class Halving:
    """Loses half of the frames that have far to go."""

    class Options(BaseModel):
        """The fields of `radio.options`."""

        model_config = ConfigDict(extra="forbid")
        reach: float = Field(40.0, gt=0, description="m, up to which every frame is heard")

    def __init__(self, setup: ModelSetup) -> None:
        self._reach = setup.options.reach
        self._seed = setup.seed

    def lost(self, air: OnAir) -> NDArray[np.bool_]:
        """Mark the frames that do not get through, by a draw of their own for each link."""
        lost = np.zeros(air.on_the_way.shape, dtype=np.bool_)
        for frame, receiver in np.argwhere(air.on_the_way).tolist():
            if air.distance(frame, receiver) > self._reach:
                values = air.source[frame], air.receivers[receiver], air.sequence[frame]
                lost[frame, receiver] = draw(self._seed, Purpose.RADIO, *values) < 0.5
        return lost
