"""The lines in which runs and plans say what robot, sensor, grid and step they hold for.

    given: differential, radius 0.2 m
    assumed: speed 4.4 m/s, sensor of 10 m (all round, stopped by walls), points of 0.1 m, steps of 0.5 s (auto)

The second line has what the scenario leaves out, for one robot or more, and no option states.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from patrol.scenario.model import Scenario
from patrol.scenario.sections import BUILT_IN_SENSORS


def assumption_lines(scenario: Scenario) -> Iterator[str]:
    """Yield a line of what a scenario states, and one of what it leaves to defaults; neither where it is empty."""
    texts = _texts(scenario)
    for word, wanted in (("given", False), ("assumed", True)):
        if chosen := [text for field, text in texts.items() if (field in scenario.assumed) is wanted]:
            yield f"{word}: {', '.join(chosen)}"


def _texts(scenario: Scenario) -> dict[str, str]:
    """Return the text of each field, such as "radius 0.3 and 1 m" for robots of two sizes."""
    roster, sensor = scenario.roster, scenario.sensor
    models = sorted({spec.model for spec in roster})
    radii, speeds = _values(spec.radius for spec in roster), _values(spec.speed for spec in roster)
    texts = {
        "robots.model": " and ".join(models),
        "robots.radius": f"radius {radii} m",
        "robots.speed": f"speed {speeds} m/s",
    }
    if "car" in models:
        turns = _values(spec.turning_radius for spec in roster if spec.model == "car")
        texts["robots.turning_radius"] = f"turning radius {turns} m"
    kind = "" if sensor.kind in BUILT_IN_SENSORS else f" {sensor.kind}"
    angle = "all round" if sensor.angle >= 360.0 else f"{sensor.angle:g} degrees ahead"
    sight = "stopped by walls" if sensor.line_of_sight else "through walls"
    texts["sensor.range"] = f"sensor{kind} of {sensor.range:g} m ({angle}, {sight})"
    texts["point"] = f"points of {scenario.point:g} m"
    texts["step"] = f"steps of {scenario.step:g} s{' (auto)' if 'step' in scenario.assumed else ''}"
    return texts


def _values(lengths: Iterable[float]) -> str:
    return " and ".join(f"{length:g}" for length in sorted(set(lengths)))
