"""The check of policies: what passes, and one broken policy for each rule."""

import itertools
import random  # noqa: TID251 - what a policy must not use
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from pydantic import BaseModel

from agent.ports import Bearing, Intent, Place, PolicySetup, Stay, Steer
from agent.view import View
from fogwatch.testing import RuleBroken, check_policy
from patrol.errors import BadInput
from patrol.pose import Drive

EXAMPLE = Path(__file__).parents[3] / "examples" / "my_policy.py"
ONE = ("holonomic",)


class Wandering:
    """Walks by draws of the view's own."""

    def __init__(self, setup: PolicySetup) -> None:
        self.setup = setup

    def decide(self, view: View) -> Any:
        return Bearing((6.0 * view.draw(0) - 3.0,))


def broken(policy: Any, **settings: Any) -> RuleBroken:
    with pytest.raises(RuleBroken) as found:
        check_policy(policy, models=ONE, **settings)
    return found.value


def test_the_example_passes() -> None:
    report = check_policy(f"{EXAMPLE}:GreedyTarget", options={"near": 8.0}, models=("car",))
    assert report.decisions > 1000
    assert 0.0 < report.median_ms <= report.slowest_ms
    assert str(report).startswith(f"{report.decisions} decisions, median ")


@pytest.mark.parametrize("name", ["stochastic", "committed", "potential-field"])
def test_the_built_in_policies_pass(name: str) -> None:
    check_policy(name, models=ONE)


def test_a_policy_meets_what_the_check_promises() -> None:
    met: set[str] = set()

    class Probe(Wandering):
        class Options(BaseModel):
            near: float = 1.0

        def decide(self, view: View) -> Any:
            assert self.setup.options.near == 3.0
            fleet = len(view.radii)
            met.update(
                name
                for name, holds in {
                    "alone": fleet == 1,
                    "silent": fleet > 1 and len(view.peers) < fleet - 1 and view.tick > 30,
                    "wall": fleet == 1 and view.pose.x < 2.0 and view.pose.y < 2.0,
                    "nothing in view": self.setup.ground.sight.range_m == 1.0,
                    "lost": view.start is None,
                    "bumped": view.bumped,
                    "restarted": not hasattr(self, "before") and view.tick > 10,
                }.items()
                if holds
            )
            self.before = view.tick
            return super().decide(view)

    check_policy(Probe, options={"near": 3.0}, models=ONE)
    assert met == {"alone", "silent", "wall", "nothing in view", "lost", "bumped", "restarted"}


def chance(_view: View) -> float:
    return random.random()


def numpys(_view: View) -> float:
    return float(np.random.random())  # noqa: NPY002 - what a policy must not use


def clock(_view: View) -> float:
    return time.time() % 1.0


COUNT = itertools.count()


def shared(_view: View) -> float:
    return 0.001 * (next(COUNT) % 997)


@pytest.mark.parametrize("hidden", [chance, numpys, clock, shared])
def test_a_policy_that_does_not_repeat_is_named_with_its_answers(hidden: Any) -> None:
    class Hidden(Wandering):
        def decide(self, view: View) -> Any:
            return Bearing((0.5 * hidden(view) if view.tick == 7 and view.spec.name == "r2" else 1.0,))

    said = str(broken(Hidden))
    assert said.startswith(
        "a fleet (holonomic): the same scenario must give the same decisions; at tick 7, r2 answered "
    )
    assert said.count("Bearing(bearings=(0.") == 2
    assert "Use view.draw for chance" in said


def test_a_policy_that_seeds_the_common_generator_is_found() -> None:
    class Seeding(Wandering):
        def __init__(self, setup: PolicySetup) -> None:
            super().__init__(setup)
            random.seed(1)

        def decide(self, view: View) -> Any:
            return Bearing((view.time_s + random.random(),))

    assert "the same scenario must give the same decisions" in str(broken(Seeding))


ANSWERS: dict[str, Any] = {
    "returned NoneType; return Bearing, Place, Stay or Steer": None,
    "returned Bearing with bearings = nan; give a number": Bearing((float("nan"),)),
    "returned Place with x = inf; give a number": Place(float("inf"), 0.0),
    "returned a state that is no printable word": Stay(""),
    "returned Steer(Drive) for a holonomic robot; give a Velocity": Steer(Drive(1.0, 0.0)),
}


@pytest.mark.parametrize("says", ANSWERS)
def test_an_answer_that_is_no_intent_is_named_with_its_tick(says: str) -> None:
    class Wrong(Wandering):
        def decide(self, view: View) -> Any:
            return super().decide(view) if view.tick < 5 else ANSWERS[says]

    said = str(broken(Wrong))
    assert says in said
    assert "Wrong, a fleet (holonomic): it must always answer with an intent; r1: its policy failed at tick 5: " in said


def raised(error: BaseException) -> Iterator[str]:
    while error.__cause__ is not None:
        error = error.__cause__
        yield from (frame.name for frame in traceback.extract_tb(error.__traceback__))


def test_what_a_policy_raises_keeps_its_own_traceback() -> None:
    class Raising(Wandering):
        def decide(self, view: View) -> Any:
            return self.helper(view) if not view.peers and view.tick > 40 else super().decide(view)

        def helper(self, view: View) -> Intent:
            raise KeyError(view.tick)

    error = broken(Raising)
    assert "Raising, alone (holonomic)" in str(error)
    assert "its policy failed at tick 41: raised KeyError: 41 (test_policy.py:" in str(error)
    assert "helper" in list(raised(error))


def test_a_policy_that_cannot_be_made_is_named() -> None:
    class Unmade(Wandering):
        def __init__(self, setup: PolicySetup) -> None:
            raise ValueError(f"no idea of {setup.robot.spec.name}")

    error = broken(Unmade)
    assert "cannot be made for r1: ValueError: no idea of r1" in str(error)
    assert "__init__" in list(raised(error))


def test_a_policy_that_writes_into_a_grid_is_named() -> None:
    class Writing(Wandering):
        def decide(self, view: View) -> Any:
            view.fog.last_seen[0, 0] = 1
            return super().decide(view)

    assert "read-only" in str(broken(Writing))


def test_state_of_the_class_is_found() -> None:
    class Counting(Wandering):
        seen: ClassVar[list[int]] = []

        def decide(self, view: View) -> Any:
            self.seen.append(view.tick)
            return Bearing((0.001 * len(self.seen),))

    assert "keep state in self alone" in str(broken(Counting))


def test_what_is_no_policy_is_refused() -> None:
    assert "is not a class with a method decide(view)" in str(broken(int))
    assert "is not a class with a method decide(view)" in str(broken(Wandering(None)))  # type: ignore[arg-type]
    assert "has no GreedyTargt; did you mean GreedyTarget?" in str(broken(f"{EXAMPLE}:GreedyTargt"))
    with pytest.raises(BadInput, match="takes no options"):
        check_policy(Wandering, options={"near": 1}, models=ONE)


def test_a_policy_that_fails_with_a_battery_is_found() -> None:
    class Mainsfed(Wandering):
        def decide(self, view: View) -> Any:
            if view.charge is not None:
                raise NotImplementedError("no batteries here")
            return super().decide(view)

    said = str(broken(Mainsfed))
    assert "with batteries (" in said
    assert "NotImplementedError: no batteries here" in said
