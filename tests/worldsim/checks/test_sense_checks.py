"""The verdict on drifts and clocks: each does what its numbers say, and a world that does otherwise is found out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest

from patrol.faults.kinds import Drift
from patrol.pose import Pose
from patrol.random import gauss
from worldsim.faults import Timeline
from worldsim.robots.senses import Senses
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from collections.abc import Callable

    from patrol.ground.terrain import Terrain
    from patrol.scenario import Scenario
    from tests.worldsim.conftest import Lab
    from worldsim.verdict.judge import Verdict

BIAS = {"kind": "drift", "who": ["r1", "r3"], "at": 2.0, "for": 10.0, "bias": [0.5, -0.25], "growth": [0.05, 0.0]}
NOISE = {"kind": "drift", "who": "all", "noise": 0.2}
JUMPS = {"kind": "drift", "who": "r4", "bias": [1.0, 0.0], "jump": {"every": 5.0, "size": 0.5}}
BOTH = {**JUMPS, "noise": 0.1, "jump": {"every": 10.0, "size": 1.0}}
CLOCK = {"kind": "clock", "who": "r1", "at": 3.0, "offset": 4.0, "rate": 0.02}
OVER = {"kind": "drift", "who": "all", "growth": [2.0, -3.0], "noise": 0.3}


@pytest.fixture
def judged(lab: Lab) -> Callable[..., Verdict]:
    """The verdict on a run with some faults, none of which befalls frames."""

    def of(*faults: dict[str, Any], ticks: int = 60, **more: Any) -> Verdict:
        world = lab.patrol(ticks=ticks, faults=list(faults), **more)
        return judge(lab.run(world), {}, world.prepared)

    return of


def senses(verdict: Verdict) -> str:
    """What is wrong with the senses, and with nothing else."""
    assert [check.name for check in verdict.failed] == ["senses"], verdict.failed
    return verdict.failed[0].detail


@pytest.mark.parametrize(
    "faults", [(BIAS,), (NOISE,), (JUMPS,), (BOTH,), (CLOCK,), (OVER,), (BIAS, BOTH, CLOCK, NOISE)]
)
@pytest.mark.parametrize("seed", [1, 2])
def test_senses_as_wrong_as_asked_for_are_valid(judged: Any, faults: tuple[dict[str, Any], ...], seed: int) -> None:
    verdict = judged(*faults, seed=seed, ticks=200)
    assert verdict.valid, verdict.failed


@pytest.mark.parametrize("fault", [BIAS, NOISE, JUMPS, BOTH])
def test_a_drift_that_does_nothing_fails(judged: Any, monkeypatch: pytest.MonkeyPatch, fault: dict[str, Any]) -> None:
    monkeypatch.setattr(Senses, "pose", lambda _self, _number, _k, true: true)
    assert senses(judged(fault, ticks=120))


def test_a_clock_that_does_nothing_fails(judged: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Senses, "clock", lambda _self, _number, k: k * 0.5)
    assert senses(judged(CLOCK)) == "r1 reports the time 3 s in tick 6, but its clock shows 7 s"


def test_a_drift_of_somebody_else_fails(judged: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    told = Senses.pose
    monkeypatch.setattr(Senses, "pose", lambda self, number, k, true: told(self, number + 1, k, true))
    assert senses(judged(BIAS)).startswith("r1 reports the place (")


def bent(factor: float) -> Callable[..., None]:
    """What makes senses that take the scenario's jumps for so many times longer ones."""
    good = Senses.__init__

    def make(self: Senses, scenario: Scenario, timeline: Timeline, terrain: Terrain) -> None:
        (drift,) = scenario.faults
        assert isinstance(drift, Drift)
        assert drift.jump
        jump = drift.jump.model_copy(update={"size": factor * drift.jump.size})
        other = scenario.model_copy(update={"faults": (drift.model_copy(update={"jump": jump}),)})
        good(self, other, Timeline(other), terrain)
        del timeline

    return make


@pytest.mark.parametrize("fault", [JUMPS, BOTH])
@pytest.mark.parametrize("factor", [0.0, 0.5, 1.5])
def test_jumps_of_another_size_fail(
    judged: Any, monkeypatch: pytest.MonkeyPatch, fault: dict[str, Any], factor: float
) -> None:
    monkeypatch.setattr(Senses, "__init__", bent(factor))
    assert "after 1 jump of" in senses(judged(fault, ticks=120))


@pytest.mark.parametrize(("factor", "shift"), [(0.5, 0.0), (2.0, 0.0), (1.0, 0.5), (0.0, 0.0)])
def test_noise_of_another_size_or_with_a_bias_fails(
    judged: Any, monkeypatch: pytest.MonkeyPatch, factor: float, shift: float
) -> None:
    monkeypatch.setattr("worldsim.robots.senses.gauss", lambda *of: factor * gauss(*of) + shift)
    assert senses(judged(NOISE, ticks=200))


def test_a_pose_that_is_told_off_the_terrain_fails(judged: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def unbounded(_self: Senses, _number: int, k: int, true: Pose) -> Pose:
        return Pose(true.x + 2.0 * 0.5 * k, true.y - 3.0 * 0.5 * k, true.heading)

    monkeypatch.setattr(Senses, "pose", unbounded)
    assert "off the terrain" in senses(judged({**OVER, "noise": 0.0}))


def test_a_told_heading_is_true(judged: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    told = Senses.pose

    def turned(self: Senses, number: int, k: int, true: Pose) -> Pose:
        pose = told(self, number, k, true)
        return Pose(pose.x, pose.y, pose.heading + math.pi / 2)

    monkeypatch.setattr(Senses, "pose", turned)
    assert "heading" in senses(judged(BIAS))
