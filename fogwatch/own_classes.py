"""Classes that scenarios name and that do not come with fogwatch: named to the user, then found, before a run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from patrol.classes.static_check import announce
from patrol.own_sensor import allow_sensor, sensor_named
from patrol.scenario.policies import BUILT_IN
from patrol.scenario.radio_spec import MODELS
from patrol.scenario.sections import BUILT_IN_SENSORS

if TYPE_CHECKING:
    from patrol.classes.named_class import NamedClass
    from patrol.scenario import Scenario


def named_classes(scenario: Scenario) -> list[NamedClass]:
    """Return policy, sensor and radio model, but for those whose settings are checked with the scenario.

    Nothing of them is imported.
    """
    classes = []
    if scenario.patrol.policy not in BUILT_IN:  # else it loads much and cannot fail
        from agent.policies.found import policy_named

        classes.append(policy_named(scenario))
    if scenario.sensor.kind not in BUILT_IN_SENSORS:
        classes.append(sensor_named(scenario.sensor))
    if scenario.radio.model not in MODELS:
        from worldsim.radio.models import model_named

        classes.append(model_named(scenario))
    return classes


def find_classes(scenarios: Iterable[Scenario], *, record: bool = False) -> None:
    """Name all classes of the scenarios, then find each with its options.

    With `record`, commands that read what others wrote may run their sensors from now on (`patrol.own_sensor`).
    """
    by_class = {repr(named): (scenario, named) for scenario in scenarios for named in named_classes(scenario)}
    announce({named.name: named for _, named in by_class.values()}.values())
    for scenario, named in by_class.values():
        if named.sort.section == "sensor":
            allow_sensor(scenario.sensor, record=record)
        elif named.sort.section == "radio":
            from worldsim.radio.models import model_class

            model_class(scenario)
        else:
            from agent.policies.found import policy_of

            policy_of(scenario)
