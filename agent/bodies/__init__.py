"""Bodies: how a robot gets where its policy wants it to be.

`BODIES` maps each model to its body. To add a model, add its command to `patrol.pose`, its motion to
`patrol.ground.swept_path`, a module here and an entry in `BODIES`.
"""

from collections.abc import Callable, Mapping

from agent.bodies.car import CarBody
from agent.bodies.differential import DifferentialBody
from agent.bodies.holonomic import HolonomicBody
from agent.bodies.setup import BodySetup
from agent.ports import Body

BODIES: Mapping[str, Callable[[BodySetup], Body]] = {
    "car": CarBody,
    "differential": DifferentialBody,
    "holonomic": HolonomicBody,
}
"""The body of each model, by the model's name in the scenario."""
