"""The radio model that a scenario names. Only what carries frames comes here; no command that reads a run does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from patrol.classes.named_class import ClassSort, NamedClass, find, options_of, raised
from patrol.errors import BadInput
from patrol.scenario.radio_spec import IDEAL, MODELS
from worldsim.radio.models.port import ModelSetup, OnAir, RadioModel

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.scenario import Scenario

RADIO_MODELS = ClassSort(
    noun="model",
    field="radio.model",
    group="fogwatch.radio_models",
    built_in=MODELS,
    call="lost(air)",
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
        if lost.shape != air.on_the_way.shape or lost.dtype != np.bool_:
            given, wanted = (f"{what.dtype} {what.shape}" for what in (lost, air.on_the_way))
            raise BadInput(f"radio.model = {self.name}: lost(air) gave {given} in tick {air.k}; return {wanted}")
        return lost


def model_named(scenario: Scenario) -> NamedClass:
    """The radio model as a scenario names it; nothing of it is imported."""
    radio = scenario.radio
    options = radio.options if isinstance(radio.options, dict) else {}
    return NamedClass(RADIO_MODELS, radio.model, radio.model_sha256, options)


def model_class(scenario: Scenario) -> tuple[Any, Any]:
    """Find the class of a scenario's radio model."""
    named, options = model_named(scenario), scenario.radio.options
    kind = find(named)
    if named.name not in MODELS:  # those of a built-in model were checked with the scenario
        options = options_of(named, kind)
    return kind, options


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
