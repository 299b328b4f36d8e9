"""Classes that scenarios name and that do not come with fogwatch: named to the user, then found, before a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from patrol.classes.static_check import announce
from patrol.own_sensor import allow_sensor, sensor_named
from patrol.scenario.policies import BUILT_IN
from patrol.scenario.radio_spec import MODELS
from patrol.scenario.sections import BUILT_IN_SENSORS

if TYPE_CHECKING:
    from patrol.classes.named_class import NamedClass
    from patrol.scenario import Scenario


def named_classes(scenario: Scenario, *, record: bool = False) -> Iterator[tuple[NamedClass, Callable[[], object]]]:
    """Yield policy, sensor and radio model, but for those whose settings are checked with the scenario.

    Nothing of them is imported; the function beside each finds it with its options. `record` is as for `find_classes`.
    """
    if scenario.patrol.policy not in BUILT_IN:  # else it loads much and cannot fail
        from agent.policies.found import policy_named, policy_of

        yield policy_named(scenario), lambda: policy_of(scenario)
    if scenario.sensor.kind not in BUILT_IN_SENSORS:
        yield sensor_named(scenario.sensor), lambda: allow_sensor(scenario.sensor, record=record)
    if scenario.radio.model not in MODELS:
        from worldsim.radio.models import model_class, model_named

        yield model_named(scenario), lambda: model_class(scenario)


def find_classes(scenarios: Iterable[Scenario], *, record: bool = False) -> None:
    """Name all classes of the scenarios, then find each with its options.

    With `record`, commands that read what others wrote may run their sensors from now on (`patrol.own_sensor`).
    """
    classes = [pair for scenario in scenarios for pair in named_classes(scenario, record=record)]
    announce({named.field: named for named, _ in classes}.values())
    for find_class in {repr(named): find_class for named, find_class in classes}.values():
        find_class()
