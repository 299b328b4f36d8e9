"""The port of a radio model, and the model that a scenario names.

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
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from patrol.classes.named_class import ClassSort, NamedClass, load, raised
from patrol.errors import BadInput
from patrol.scenario.radio_spec import IDEAL, MODELS

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.scenario import Scenario


__all__ = ["ModelSetup", "OnAir", "RadioModel"]

OWN_MODEL = "model"
"""The cause, in journals, of frames that a model of one's own has lost."""


def cause_of(model: str) -> str:
    """Return the name in journals of frames that a model has lost: its own if it comes with fogwatch, else `OWN_MODEL`.

    For example, "path-loss" for the model of that name, and "model" for one of one's own.

    Args:
        model: As the scenario names it.
    """
    return model if model in MODELS else OWN_MODEL


@dataclass(frozen=True, slots=True)
class ModelSetup:
    """The options, seed and step that a model is made from.

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


RADIO_MODELS = ClassSort(
    noun="model", field="radio.model", group="fogwatch.radio_models", built_in=MODELS, call="lost(air)"
)


class Ideal:
    """Every frame gets through. The ether makes none of it: it takes a shorter path without a model."""

    def __init__(self, setup: ModelSetup) -> None:
        """Need nothing of the setup."""

    def lost(self, air: OnAir) -> NDArray[np.bool_]:
        """Lose nothing."""
        return np.zeros(air.on_the_way.shape, dtype=np.bool_)


@dataclass(frozen=True, slots=True)
class _Own:
    """A model of one's own, whose errors are told apart from ours."""

    name: str
    model: RadioModel

    def lost(self, air: OnAir) -> NDArray[np.bool_]:
        try:
            lost = np.asarray(self.model.lost(air))
        except (Exception, SystemExit) as error:
            raise raised(f"{RADIO_MODELS.field} = {self.name}", error) from error
        # Checked here, where the class can be named, and not where a wrong shape would fail.
        if lost.shape != air.on_the_way.shape or lost.dtype != np.bool_:
            returned, wanted = (f"{array.dtype} {array.shape}" for array in (lost, air.on_the_way))
            raise BadInput(f"radio.model = {self.name}: lost(air) gave {returned} in tick {air.k}; return {wanted}")
        return lost


def model_named(scenario: Scenario) -> NamedClass:
    """The radio model as a scenario names it; nothing of it is imported."""
    radio = scenario.radio
    options = radio.options if isinstance(radio.options, dict) else {}
    return NamedClass(RADIO_MODELS, radio.model, radio.model_sha256, options)


def model_class(scenario: Scenario) -> tuple[Any, Any]:
    """Find the class of a scenario's radio model."""
    kind, options = load(named := model_named(scenario))
    # Those of a built-in model were checked with the scenario.
    return kind, scenario.radio.options if named.name in MODELS else options


def model_of(scenario: Scenario, terrain: Terrain) -> RadioModel | None:
    """Make the radio model of a scenario; None where every frame gets through."""
    radio = scenario.radio
    if radio.model == IDEAL:
        return None
    kind, options = model_class(scenario)
    setup = ModelSetup(options, scenario.seed, scenario.step, terrain)
    if radio.model in MODELS:
        built_in: RadioModel = kind(setup)
        return built_in
    try:
        return _Own(radio.model, kind(setup))
    except (Exception, SystemExit) as error:
        raise raised(f"{RADIO_MODELS.field} = {radio.model}", error) from error


# The name of this module up to 1.0.0, which models of one's own import; it goes with 2.0.
sys.modules[f"{__name__}.port"] = sys.modules[__name__]
