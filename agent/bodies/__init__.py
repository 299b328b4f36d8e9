"""Bodies: how a robot gets where its policy wants it to be.

`BODIES` has the body of each model. Whoever adds a model adds its command to `patrol.pose`, its motion to
`patrol.ground.swept_path`, a file here and a line below.
"""

from collections.abc import Callable, Mapping

from agent.bodies.car import CarBody
from agent.bodies.holonomic import HolonomicBody
from agent.bodies.setup import BodySetup
from agent.ports import Body

BODIES: Mapping[str, Callable[[BodySetup], Body]] = {"car": CarBody, "holonomic": HolonomicBody}
"""The body of each model, by the scenario's word for it."""
