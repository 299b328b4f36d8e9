"""The check that every class of one's own that a sweep's scenarios name can be used, before any run is made."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.own_sensor import allow_sensor
from patrol.scenario.policies import BUILT_IN
from patrol.scenario.radio_spec import MODELS

if TYPE_CHECKING:
    from experiments.sweeps.plan import Plan


def check_classes(plan: Plan) -> None:
    """Find every policy, sensor and radio model of one's own, with its options, before any run is made."""
    own = {
        repr((run.scenario.patrol.policy, run.scenario.patrol.options)): run.scenario
        for run in plan.runs
        if run.scenario.patrol.policy not in BUILT_IN
    }
    if own:
        from agent.policies.found import policy_of

        for scenario in own.values():
            policy_of(scenario)
    for sensor in {repr(run.scenario.sensor): run.scenario.sensor for run in plan.runs}.values():
        allow_sensor(sensor)
    scenarios = (run.scenario for run in plan.runs if run.scenario.radio.model not in MODELS)
    models = {repr((scenario.radio.model, scenario.radio.options)): scenario for scenario in scenarios}
    if models:
        from worldsim.radio.models import model_class

        for scenario in models.values():
            model_class(scenario)
