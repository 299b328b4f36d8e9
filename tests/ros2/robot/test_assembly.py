"""A robot that is driven by velocities gets its own sizes, speeds and times, each in its place."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from patrol.errors import BadInput
from ros2.robot import driver
from ros2.robot.driver import assemble

# Not the product's own, so that a wrong one there is noticed.
REACTION_S = 0.1

PARTS = ("Shown", "Diagnostics", "Fence", "Others", "Response", "Governor", "VelocitySteering", "GoalSteering")


class Robot:
    def start(self) -> Robot:
        return self

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


def made(patch: pytest.MonkeyPatch, **changed: Any) -> dict[str, tuple[Any, ...]]:
    """Put a robot together, and return the arguments of each part by its name."""
    found: dict[str, tuple[Any, ...]] = {}

    def record(name: str, result: Any) -> Any:
        def make(*arguments: Any) -> Any:
            found[name] = arguments
            return result

        return make

    for part in PARTS:
        patch.setattr(driver, part, record(part, SimpleNamespace(part=part, watch=lambda _: None, close=None)))
    patch.setattr(driver, "Ros2Robot", record("Ros2Robot", Robot()))
    patch.setattr(driver, "rest_before_pause", lambda *_: None)
    settings = {"drive": "velocity", "margin": 0.2, "rate_hz": 20.0, "braking": 0.8, "acceleration": 0.7, **changed}
    spec = SimpleNamespace(number=1, name="anna", radius=0.6, speed=2.0, model="differential", limits="its limits")
    site = SimpleNamespace(
        spec=spec, terrain="terrain", fog=None, step=0.25, factor=3.0, peers="peers", radii="radii", no_tick=None,
        foreseen="foreseen", clock="clock", orders=lambda: "orders",
    )  # fmt: skip
    hardware: Any = SimpleNamespace(link=None, settings=SimpleNamespace(**settings), stamp_ns=lambda: 0)
    scenario: Any = SimpleNamespace(roster=[spec], radio=SimpleNamespace(forget_after=9.0))
    process: Any = SimpleNamespace(
        log="log", closing=SimpleNamespace(callback=lambda _: None), supervision=SimpleNamespace(counts=False)
    )
    rivals: Any = "rivals"
    assemble(site, hardware, scenario, rivals, process, shows_map=False)  # type: ignore[arg-type]
    return found


def test_fence_response_and_governor_know_the_robots_body_brakes_and_times(monkeypatch: pytest.MonkeyPatch) -> None:
    found = made(monkeypatch)
    assert found["Fence"] == ("terrain", pytest.approx(0.5), pytest.approx(0.1 + REACTION_S), 0.8)
    assert found["Response"] == (0.6, pytest.approx(2.5))
    assert found["Others"] == ("peers", "radii", 0.25, "foreseen")
    model, limits, acceleration, hold_s, fence = found["Governor"]
    assert (model, limits, acceleration, fence.part) == ("differential", "its limits", 0.7, "Fence")
    assert hold_s == 1.5 * 0.25
    _, governor, peers, response = found["VelocitySteering"]
    assert (governor.part, peers.part, response.part) == ("Governor", "Others", "Response")
    _, steering, clock, step, _, orders, log, objections = found["Ros2Robot"]
    assert (steering.part, clock, step, orders, log) == ("VelocitySteering", "clock", 0.25, "orders", "log")
    assert objections == ["rivals", response]


def test_nav2_is_given_goals_and_judges_the_rest_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    found = made(monkeypatch, drive="nav2")
    assert "GoalSteering" in found
    assert not {"Fence", "Response", "Governor", "VelocitySteering"} & set(found)
    assert found["Ros2Robot"][-1] == ["rivals"]


@pytest.mark.parametrize(
    ("changed", "words"),
    [({"margin": 0.6}, "--margin 0.6: anna's radius of 0.6 m holds it"), ({"drive": "ackermann"}, "anna is diff")],
)
def test_settings_that_do_not_fit_the_body_are_refused(
    changed: dict[str, Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BadInput, match=words):
        made(monkeypatch, **changed)
