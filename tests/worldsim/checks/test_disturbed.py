"""The verdict on drifts, clocks and motion faults: each is as large as configured, and a world that differs fails."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from patrol.faults.kinds import Drift
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.random import draw, gauss
from patrol.scenario import Scenario
from tests.worldsim.checks.judged import Run, checks, failures
from tests.worldsim.conftest import Lab
from worldsim.faults import Timeline
from worldsim.robots.noise import MotionNoise
from worldsim.robots.senses import Senses

Fault = dict[str, Any]
Driven = Callable[..., dict[str, str]]


def only(name: str, found: dict[str, str]) -> str:
    """The detail of the one check that failed."""
    assert list(found) == [name], found
    return found[name]


# --- senses ----------------------------------------------------------------------------------------------------------

TICKS = 60
BIAS = {"kind": "drift", "who": ["r1", "r3"], "at": 2.0, "for": 10.0, "bias": [0.5, -0.25], "growth": [0.05, 0.0]}
NOISE = {"kind": "drift", "who": "all", "noise": 0.2}
JUMPS = {"kind": "drift", "who": "r4", "bias": [1.0, 0.0], "jump": {"every": 5.0, "size": 0.5}}
BOTH = {**JUMPS, "noise": 0.1, "jump": {"every": 10.0, "size": 1.0}}
CLOCK = {"kind": "clock", "who": "r1", "at": 3.0, "offset": 4.0, "rate": 0.02}
OVER = {"kind": "drift", "who": "all", "growth": [2.0, -3.0], "noise": 0.3}


@pytest.mark.parametrize(
    "faults", [(BIAS,), (NOISE,), (JUMPS,), (BOTH,), (CLOCK,), (OVER,), (BIAS, BOTH, CLOCK, NOISE)]
)
@pytest.mark.parametrize("seed", [1, 2])
def test_senses_as_wrong_as_asked_for_are_valid(run: Run, faults: tuple[Fault, ...], seed: int) -> None:
    assert failures(run(*faults, seed=seed, ticks=200)) == {}


def test_a_process_started_anew_knows_nothing_of_earlier_noise(run: Run) -> None:
    early, late = ({**NOISE, "at": at, "for": lasts} for at, lasts in ((2.0, 18.0), (50.0, 1.0)))
    restart = {"kind": "restart", "who": "r2", "at": 30.0}
    assert failures(run(early, restart, late, ticks=120)) == {}


@pytest.mark.parametrize("fault", [BIAS, NOISE, JUMPS, BOTH])
def test_a_drift_that_does_nothing_fails(run: Run, monkeypatch: pytest.MonkeyPatch, fault: Fault) -> None:
    monkeypatch.setattr(Senses, "pose", lambda _self, _number, _k, true: true)
    assert only("senses", failures(run(fault, ticks=120)))


TOLD = Senses.pose


@pytest.mark.parametrize(
    ("sense", "wrong", "fault", "says"),
    [
        (
            "clock",
            lambda _self, _number, k: k * 0.5,
            CLOCK,
            "r1 reports the time 3 s in tick 6, but its clock shows 7 s",
        ),
        ("pose", lambda self, number, k, true: TOLD(self, number + 1, k, true), BIAS, "r1 is told of ("),
        (
            "pose",
            lambda _self, _number, k, true: Pose(true.x + k, true.y - 1.5 * k, true.heading),
            {**OVER, "noise": 0.0},
            "off the terrain",
        ),
        (
            "pose",
            lambda self, number, k, true: TOLD(self, number, k, Pose(true.x, true.y, true.heading + math.pi / 2)),
            BIAS,
            "heading",
        ),
    ],
    ids=["a clock that does nothing", "another's drift", "off the terrain", "turned"],
)
def test_other_senses_fail(
    run: Run, monkeypatch: pytest.MonkeyPatch, sense: str, wrong: Any, fault: Fault, says: str
) -> None:
    monkeypatch.setattr(Senses, sense, wrong)
    assert says in only("senses", failures(run(fault)))


def bent(factor: float) -> Callable[..., None]:
    """Make senses that take the scenario's jumps for so many times longer ones."""
    good = Senses.__init__

    def make(self: Senses, scenario: Scenario, _timeline: Timeline, terrain: Terrain) -> None:
        (drift,) = scenario.faults
        assert isinstance(drift, Drift)
        assert drift.jump
        jump = drift.jump.model_copy(update={"size": factor * drift.jump.size})
        other = scenario.model_copy(update={"faults": (drift.model_copy(update={"jump": jump}),)})
        good(self, other, Timeline(other), terrain)

    return make


@pytest.mark.parametrize("fault", [JUMPS, BOTH])
@pytest.mark.parametrize("factor", [0.0, 0.5, 1.5])
def test_jumps_of_another_size_fail(run: Run, monkeypatch: pytest.MonkeyPatch, fault: Fault, factor: float) -> None:
    monkeypatch.setattr(Senses, "__init__", bent(factor))
    assert "after 1 jump of" in only("senses", failures(run(fault, ticks=120)))


@pytest.mark.parametrize(("factor", "shift"), [(0.5, 0.0), (2.0, 0.0), (1.0, 0.5), (0.0, 0.0)])
def test_noise_of_another_size_or_with_a_bias_fails(
    run: Run, monkeypatch: pytest.MonkeyPatch, factor: float, shift: float
) -> None:
    monkeypatch.setattr("worldsim.robots.senses.gauss", lambda *of: factor * gauss(*of) + shift)
    assert only("senses", failures(run(NOISE, ticks=200)))


# --- motion ----------------------------------------------------------------------------------------------------------

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
def driven(lab: Lab) -> Driven:
    """The failed checks of a run of three slow robots that drive at random under some faults."""

    def of(*faults: Fault, ticks: int = 400, speed: float = 0.8) -> dict[str, str]:
        models: list[Fault] = [{"model": "car", "turning_radius": 2.0}, {"model": "differential"}]
        robots = [{**model, "radius": 0.4, "speed": speed} for model in [*models, {"model": "holonomic"}]]
        starts = [(3.0, 3.0, 0.0), (6.0, 10.0, 1.0), (14.0, 7.0, 0.0)]
        world = lab.world(robots, starts, duration=0.5 * ticks, faults=list(faults))
        found = checks((world, lab.run(world)))
        assert {"motion", "moves", "bodies apart"} <= set(found)
        return {name: check.detail for name, check in found.items() if not check.ok}

    return of


@pytest.mark.parametrize(
    "faults", [(SPEED,), (VEER,), (TURNING,), (JITTER,), (SLIP,), (ALL,), (EXTREME,), (SPEED, SLIP, DEATH, BACK)]
)
@pytest.mark.parametrize("speed", [0.8, 4.4])
def test_motion_as_uneven_as_configured_is_valid(driven: Driven, faults: tuple[Fault, ...], speed: float) -> None:
    """At 4.4 m/s robots drive into walls and each other all the time: none gets into them."""
    assert driven(*faults, speed=speed) == {}


@pytest.mark.parametrize("fault", [SPEED, VEER, TURNING])
@pytest.mark.parametrize(("factor", "shift"), [(0.5, 0.0), (3.0, 0.0), (1.0, 1.0)])
def test_motion_noise_of_another_size_or_with_a_bias_fails(
    driven: Driven, monkeypatch: pytest.MonkeyPatch, fault: Fault, factor: float, shift: float
) -> None:
    monkeypatch.setattr("worldsim.robots.noise.gauss", lambda *of: factor * gauss(*of) + shift)
    assert "half of them are expected" in only("motion", driven(fault))


@pytest.mark.parametrize(
    "bend", [lambda share: share**3, lambda share: 0.5 + 0.3 * (share - 0.5)], ids=["lower", "narrower"]
)
def test_another_jitter_fails(driven: Driven, monkeypatch: pytest.MonkeyPatch, bend: Callable[[float], float]) -> None:
    monkeypatch.setattr("worldsim.robots.noise.draw", lambda *of: bend(draw(*of)))
    assert "half of them are expected" in only("motion", driven(JITTER))


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_another_share_of_slips_fails(driven: Driven, monkeypatch: pytest.MonkeyPatch, factor: float) -> None:
    monkeypatch.setattr("worldsim.robots.noise.draw", lambda *of: factor * draw(*of))
    assert "f1 let bodies slip in" in only("motion", driven(SLIP, ticks=800))


def test_motion_that_is_not_disturbed_fails(driven: Driven, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MotionNoise, "driven", lambda _self, _k, commands: commands)
    assert "half of them are expected" in only("motion", driven(SPEED))


def test_other_draws_than_those_of_the_seed_fail(driven: Driven, monkeypatch: pytest.MonkeyPatch) -> None:
    """The size is right, so only the recomputed moves tell."""
    disturbed = MotionNoise.driven
    calls = iter(range(10**6))
    monkeypatch.setattr(MotionNoise, "driven", lambda self, _k, commands: disturbed(self, next(calls), commands))
    assert list(driven(SPEED)) == ["moves"]
