"""The verdict on motion faults: each is as large as configured, and a world that does otherwise is detected."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from patrol.random import draw, gauss
from worldsim.robots.noise import MotionNoise
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from tests.worldsim.conftest import Lab
    from worldsim.verdict.judge import Verdict

SPEED = {"kind": "motion", "who": "all", "speed": 0.3}
VEER = {"kind": "motion", "who": "all", "veer": 0.2}
TURNING = {"kind": "motion", "who": "all", "turning": 0.3}
JITTER = {"kind": "motion", "who": "all", "jitter": {"size": 0.4}}
SLIP = {"kind": "motion", "who": ["r1", "r3"], "slip": {"rate": 0.3, "every": 1.0}, "at": 5.0}
ALL = {**SPEED, "turning": 0.5, "veer": 0.1, "jitter": {"size": 0.4, "every": 2.0}, "slip": {"rate": 0.2}}
EXTREME = {**SPEED, "speed": 1.0, "turning": 1.0, "veer": 1.0, "slip": {"rate": 0.5}}
DEATH = {"kind": "kill", "who": "r2", "at": 20.0, "wreck": "removed"}
BACK = {"kind": "restart", "who": "r2", "at": 40.0}


@pytest.fixture
def judged(lab: Lab) -> Callable[..., Verdict]:
    """The verdict on a run of three slow robots that drive at random under some faults."""

    def of(*faults: dict[str, Any], ticks: int = 400, seed: int = 1, speed: float = 0.8) -> Verdict:
        slow: dict[str, Any] = {"radius": 0.4, "speed": speed}
        models: list[dict[str, Any]] = [
            {"model": "car", "turning_radius": 2.0},
            {"model": "differential"},
            {"model": "holonomic"},
        ]
        robots = [{**model, **slow} for model in models]
        starts = [(3.0, 3.0, 0.0), (6.0, 10.0, 1.0), (14.0, 7.0, 0.0)]
        world = lab.world(robots, starts, duration=0.5 * ticks, seed=seed, faults=list(faults))
        return judge(lab.run(world), {}, world.prepared)

    return of


def motion(verdict: Verdict) -> str:
    """What is wrong with the motion, and with nothing else."""
    assert [check.name for check in verdict.failed] == ["motion"], verdict.failed
    return verdict.failed[0].detail


@pytest.mark.parametrize(
    "faults", [(SPEED,), (VEER,), (TURNING,), (JITTER,), (SLIP,), (ALL,), (EXTREME,), (SPEED, SLIP, DEATH, BACK)]
)
@pytest.mark.parametrize("speed", [0.8, 4.4])
def test_motion_as_uneven_as_configured_is_valid(judged: Any, faults: tuple[dict[str, Any], ...], speed: float) -> None:
    """At 4.4 m/s robots drive into walls and each other all the time: none gets into them."""
    verdict = judged(*faults, speed=speed)
    assert verdict.valid, verdict.failed
    assert {"motion", "moves", "bodies apart"} <= {check.name for check in verdict.checks}


def test_a_run_without_motion_faults_is_not_asked(judged: Any) -> None:
    assert "motion" not in {check.name for check in judged(DEATH, ticks=60).checks}


@pytest.mark.parametrize("fault", [SPEED, VEER, TURNING])
@pytest.mark.parametrize(("factor", "shift"), [(0.5, 0.0), (3.0, 0.0), (1.0, 1.0)])
def test_noise_of_another_size_or_with_a_bias_fails(
    judged: Any, monkeypatch: pytest.MonkeyPatch, fault: dict[str, Any], factor: float, shift: float
) -> None:
    monkeypatch.setattr("worldsim.robots.noise.gauss", lambda *of: factor * gauss(*of) + shift)
    assert "half of them are expected" in motion(judged(fault))


@pytest.mark.parametrize(
    "bend", [lambda share: share**3, lambda share: 0.5 + 0.3 * (share - 0.5)], ids=["lower", "narrower"]
)
def test_another_jitter_fails(judged: Any, monkeypatch: pytest.MonkeyPatch, bend: Callable[[float], float]) -> None:
    monkeypatch.setattr("worldsim.robots.noise.draw", lambda *of: bend(draw(*of)))
    assert "half of them are expected" in motion(judged(JITTER))


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_another_share_of_slips_fails(judged: Any, monkeypatch: pytest.MonkeyPatch, factor: float) -> None:
    monkeypatch.setattr("worldsim.robots.noise.draw", lambda *of: factor * draw(*of))
    assert "f1 let bodies slip in" in motion(judged(SLIP, ticks=800))


def test_motion_that_is_not_disturbed_fails(judged: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MotionNoise, "driven", lambda _self, _k, commands: commands)
    assert "half of them are expected" in motion(judged(SPEED))


def test_other_draws_than_those_of_the_seed_fail(judged: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The size is right, so only the recomputed moves tell."""
    driven = MotionNoise.driven
    calls = iter(range(10**6))
    monkeypatch.setattr(MotionNoise, "driven", lambda self, _k, commands: driven(self, next(calls), commands))
    verdict = judged(SPEED)
    assert [check.name for check in verdict.failed] == ["moves"]
