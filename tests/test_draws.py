"""Draws for different things are independent: every purpose has a case here, or names the test that has it.

A case collects what draws make, through the ports of the code that draws: a row for each robot, quantity, axis or
fault, a column for each tick or seed. Rows must have their distribution, and no row may tell anything of another, or a
column of the next.
"""

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.chance import Chance
from patrol.changing.ground import ChangingFootprint
from patrol.ground.terrain import Terrain
from patrol.journal import Status
from patrol.pose import Command, Drive, Pose, Twist, Velocity, is_halt
from patrol.prepare import prepare, sensor_footprint
from patrol.radio.message import decode
from patrol.random import Draws, Purpose
from patrol.scenario import load_scenario
from ros2.sim.odometry import DriftingOdometry, Errors
from worldsim.faults import Timeline
from worldsim.radio.forging import Forger
from worldsim.robots.closures import Closures
from worldsim.robots.noise import MotionNoise
from worldsim.robots.senses import Senses

TICKS = 1500
ROOM = Terrain("room", np.ones((15, 20), dtype=np.bool_), 1.0)
DEVIATIONS = 5.0
"""Chance alone deviates by so much once in 1.7 million comparisons."""

Rows = dict[str, list[float] | NDArray[np.float64]]

MIND = "of minds, all by `Chance`: the case POLICY draws for every purpose"
SEQUENCE = "a sequence of `Draws`: the case NEMESIS"
ELSEWHERE: dict[Purpose, str] = {
    Purpose.ETHER: "tests/worldsim/checks/test_air.py",
    Purpose.RADIO: "drawn again, draw for draw: tests/worldsim/checks/test_path_loss.py, tests/worldsim/radio",
    **dict.fromkeys((Purpose.RANDOM_MOVE, Purpose.GIVE_WAY, Purpose.UNSTUCK, Purpose.TIES, Purpose.PLAN), MIND),
    **dict.fromkeys((Purpose.CHAOS, Purpose.STRANGER), SEQUENCE),
    Purpose.INFILTRATION: "a number for each place of its question: test_random.py",
}


def uniform(low: float, high: float) -> Callable[[float], float]:
    """The distribution function of a uniform draw."""
    return lambda x: min(max((x - low) / (high - low), 0.0), 1.0)


NORMAL = NormalDist().cdf


def size_of(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of draws from their median."""
    return np.abs(row - np.median(row))


def problems(rows: Rows, distribution: Callable[[float], float] | None = None) -> list[str]:
    """Faults of rows of draws; nothing where they are independent and spread as they should."""
    found = []
    table = {name: np.array(row, dtype=np.float64) for name, row in rows.items()}
    for name, row in table.items():
        if distribution is not None:
            steps = np.arange(row.size + 1) / row.size
            expected = np.array([distribution(x) for x in np.sort(row)])
            apart = max(np.abs(steps[1:] - expected).max(), np.abs(steps[:-1] - expected).max())
            if apart > 2.7 / math.sqrt(row.size):
                found.append(f"{name} is spread otherwise, by {apart:.3f}")
        for other, others in table.items():
            for lag in (0, 1, 2) if other != name else (1, 2):
                for what, of in (("", np.asarray), ("the size of ", size_of)):
                    first, second = of(row)[: row.size - lag], of(others)[lag:]
                    likeness = abs(float(np.corrcoef(first, second)[0, 1]))
                    if not likeness < DEVIATIONS / math.sqrt(first.size):
                        found.append(f"{what}{name} tells of {other} {lag} later: {likeness:.2f}")
    return found


def scenario(seed: int = 1, count: int = 3, model: str = "car", **more: Any) -> Any:
    robots = {"count": count, "model": model}
    return load_scenario({"terrain": {"builtin": "open"}, "point": 2.0, "seed": seed, "robots": robots, **more})


def test_every_purpose_has_a_case() -> None:
    cases = {name.removeprefix("test_draws_of_").upper() for name in globals() if name.startswith("test_draws_of_")}
    assert {purpose.name for purpose in Purpose} - {purpose.name for purpose in ELSEWHERE} == cases


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda rows: {**rows, "c": rows["a"]}, "a tells of c 0 later"),
        (lambda rows: {**rows, "c": 1.0 - rows["a"]}, "the size of a tells of c 0 later"),
        (lambda rows: {**rows, "c": np.roll(rows["a"], 1)}, "a tells of c 1 later"),
        (lambda rows: {**rows, "c": np.repeat(rows["a"][: TICKS // 2], 2)}, "c tells of c 1 later"),
        (lambda rows: {**rows, "c": np.abs(rows["a"] - 0.5) * 2.0 * rows["b"] / rows["b"].max()}, "c is spread"),
        (lambda rows: {**rows, "c": 0.5 * rows["a"]}, "c is spread otherwise"),
    ],
)
def test_what_depends_is_found(wrong: Callable[[Any], Rows], words: str) -> None:
    rng = np.random.default_rng(4)
    rows: Rows = {"a": rng.random(TICKS), "b": rng.random(TICKS)}
    assert problems(rows, uniform(0.0, 1.0)) == []
    assert any(problem.startswith(words) for problem in problems(wrong(rows), uniform(0.0, 1.0)))


def motion(*faults: dict[str, Any]) -> Callable[[int, Command], list[Command]]:
    """The commands that bodies of three robots obey in each tick under motion faults."""
    made = scenario(model="differential", faults=[{"kind": "motion", "who": "all", **fault} for fault in faults])
    noise = MotionNoise(made, Timeline(made))
    return lambda number, command: [noise.driven(k, {number: command})[number] for k in range(TICKS)]


def test_draws_of_motion() -> None:
    drive = motion({"speed": 0.1, "turning": 0.1, "veer": 0.1})
    rows: Rows = {}
    for number in (1, 2, 3):
        straight, bent = (drive(number, Drive(1.0, curvature)) for curvature in (0.0, 1.0))
        veers = [of.curvature for of in straight if isinstance(of, Drive)]
        rows[f"r{number} speed"] = [(of.speed_mps - 1.0) / 0.1 for of in straight]
        rows[f"r{number} veer"] = [veer / 0.1 for veer in veers]
        rows[f"r{number} turning"] = [
            (of.curvature - veer - 1.0) / 0.1 for of, veer in zip(bent, veers, strict=True) if isinstance(of, Drive)
        ]
    assert problems(rows, NORMAL) == []
    twice = motion({"speed": 0.1}, {"speed": 0.1, "jitter": {"size": 0.2}})
    once = motion({"speed": 0.1})
    first = np.array([of.speed_mps for of in once(1, Twist(1.0, 0.0))])
    both = np.array([of.speed_mps for of in twice(1, Twist(1.0, 0.0))])
    assert problems({"the first fault": first, "the second fault": both / first}) == []


def test_slips_and_jitter_are_independent() -> None:
    """Slips and jitter last for two ticks; what a slip leaves of the jitter is spread as all of it."""
    drive = motion({"jitter": {"size": 0.4, "every": 1.0}, "slip": {"rate": 0.3, "every": 1.0}})
    slips: Rows = {}
    for number in (1, 2, 3):
        done = drive(number, Velocity(1.0, 0.0))[::2]
        slips[f"r{number} slips"] = [float(is_halt(of)) for of in done]
        assert abs(np.mean(slips[f"r{number} slips"]) - 0.3) < DEVIATIONS * math.sqrt(0.21 / len(done))
        shares = [of.speed_mps for of in done if not is_halt(of)]
        assert problems({f"r{number} jitter": shares}, uniform(0.6, 1.4)) == []
    assert problems(slips) == []
    shaken = motion({"jitter": {"size": 0.4}})
    jitter = {f"r{number}": [of.speed_mps for of in shaken(number, Velocity(1.0, 0.0))] for number in (1, 2, 3)}
    assert problems({**jitter}, uniform(0.6, 1.4)) == []


def test_draws_of_senses() -> None:
    field = Terrain("field", np.ones((400, 400), dtype=np.bool_), 1.0)
    faults = [{"kind": "drift", "who": "all", "noise": 0.5}] * 2 + [
        {"kind": "drift", "who": "all", "jump": {"every": 0.5, "size": 2.0}}
    ]
    here = Pose(200.0, 200.0, 0.0)

    def offset(of: Pose) -> tuple[float, float]:
        return of.x - here.x, of.y - here.y

    def places(*kinds: int) -> dict[int, NDArray[np.float64]]:
        made = scenario(faults=[faults[kind] for kind in kinds])
        senses = Senses(made, Timeline(made), field)
        return {n: np.array([offset(senses.pose(n, k, here)) for k in range(TICKS)]) for n in (1, 2, 3)}

    one, two, jumps = places(0), places(0, 1), places(2)
    noise = {f"r{n} {axis}": of[:, i] / 0.5 for n, of in one.items() for i, axis in enumerate("xy")}
    noise |= {f"r{n} second {axis}": (of - one[n])[:, i] / 0.5 for n, of in two.items() for i, axis in enumerate("xy")}
    assert problems({**noise}, NORMAL) == []
    ways = {n: np.diff(of[: TICKS // 4], axis=0) for n, of in jumps.items()}
    inland = {n: way for n, way in ways.items() if np.allclose(np.hypot(*way.T), 2.0)}
    assert len(inland) >= 2
    bearings = {f"r{n}": [math.atan2(y, x) for x, y in way] for n, way in inland.items()}
    assert problems({**bearings}, uniform(-math.pi, math.pi)) == []


def test_draws_of_spoof() -> None:
    made = scenario(faults=[{"kind": "spoof", "as": ["r1", "r2"], "payload": "random"}] * 2)
    timeline = Timeline(made)
    forger = Forger(made, timeline, ROOM, Senses(made, timeline, ROOM), None)
    statuses, poses = dict.fromkeys((1, 2, 3), Status.ALIVE), dict.fromkeys((1, 2, 3), Pose(5.0, 5.0, 0.0))
    frames = [[decode(of.frame).pose for of in forger.forge(k, {}, statuses, poses)] for k in range(TICKS)]
    across = {f"{i} x": [of[i].x / 20.0 for of in frames] for i in range(4)}
    up = {f"{i} y": [of[i].y / 15.0 for of in frames] for i in range(4)}
    assert problems({**across, **up}, uniform(0.0, 1.0)) == []


def test_draws_of_ground() -> None:
    boxes = [[(x, 40), (x + 4, 40), (x + 4, 44), (x, 44)] for x in (20, 40, 60)]
    rates = {"closes": 0.7, "opens": 0.7}
    made = scenario(closures=[{"name": f"c{i}", "polygon": box, **rates} for i, box in enumerate(boxes)])
    prepared = prepare(made)
    closures, footprint = Closures(prepared, Timeline(made)), sensor_footprint(made, prepared.terrain)
    assert isinstance(footprint, ChangingFootprint)
    turns: dict[str, list[float]] = {f"c{i}": [] for i in range(3)}
    for k in range(TICKS):
        turned = {event.detail for event in closures.tick(k, {}, footprint)}
        for name, row in turns.items():
            row.append(float(name in turned))
    assert problems({**turns}) == []
    assert all(abs(np.mean(row) + math.expm1(-0.35)) < DEVIATIONS * math.sqrt(0.21 / TICKS) for row in turns.values())


def test_draws_of_start() -> None:
    rows: dict[str, list[float]] = {f"r{n} {what}": [] for n in (1, 2, 3) for what in ("x", "y", "heading")}
    for seed in range(250):
        for number, pose in enumerate(prepare(scenario(seed, model="holonomic")).starts, 1):
            for what in ("x", "y", "heading"):
                rows[f"r{number} {what}"].append(getattr(pose, what))
    assert problems({**rows}) == []


def test_draws_of_fault() -> None:
    """The robot that each of three faults acts on, seed by seed."""
    faults = [*[{"kind": "silence", "who": "one"}] * 2, {"kind": "loss", "rate": 0.5, "from": "one"}]
    entries = [Timeline(scenario(seed, 8, faults=faults)).entries for seed in range(400)]
    rows = {f"{i}": [float((of[i].who or of[i].sources)[0]) for of in entries] for i in range(3)}
    assert problems({**rows}) == []
    assert all(
        np.bincount(np.array(row, dtype=int))[1:].min() > 50 - DEVIATIONS * math.sqrt(50) for row in rows.values()
    )


def test_draws_of_odometry() -> None:
    errors = Errors(noise_m=1.0, noise_rad=0.01, found_m=1.0, found_rad=0.01)
    rows: dict[str, list[float]] = {}
    for number in (1, 2):
        odometry = DriftingOdometry(Pose(0.0, 0.0, 0.0), errors, (1, number))
        said, found = [], []
        for _ in range(TICKS):
            odometry.localise()
            said.append(odometry.say())
            found.append(odometry.found)
        for what, poses in (("said", said), ("found", found)):
            rows |= {f"r{number} {what} {axis}": [getattr(of, axis) for of in poses] for axis in ("x", "y")}
            rows[f"r{number} {what} heading"] = [of.heading / 0.01 for of in poses]
    assert problems({**rows}, NORMAL) == []


@pytest.mark.parametrize("key", [None, b"k" * 32])
def test_draws_of_policy(key: bytes | None) -> None:
    """Of robots, of incarnations, of purposes, and of questions in one tick; and those of the whole fleet."""
    chance = Chance(7, key)
    things = [(1, 1, Purpose.POLICY, 0), (1, 1, Purpose.POLICY, 1), (1, 1, Purpose.RANDOM_MOVE, 0)]
    things += [(2, 1, Purpose.POLICY, 0), (1, 2, Purpose.POLICY, 0), (2, 2, Purpose.UNSTUCK, 0)]
    rows: Rows = {
        f"{number}.{incarnation} {purpose.name} {index}": [
            chance.of_robot(number, incarnation)(purpose, k, index) for k in range(TICKS)
        ]
        for number, incarnation, purpose, index in things
    }
    rows["fleet"] = [chance.draw(Purpose.PLAN, k) for k in range(TICKS)]
    rows["another fleet"] = [Chance(8, key).draw(Purpose.PLAN, k) for k in range(TICKS)]
    assert problems(rows, uniform(0.0, 1.0)) == []


def test_draws_of_nemesis() -> None:
    def row(*what: int) -> list[float]:
        draws = Draws(*what)
        return [draws.share() for _ in range(TICKS)]

    rows: Rows = {f"{seed} {slot}": row(seed, Purpose.NEMESIS, slot) for seed in (1, 2) for slot in (0, 1)}
    assert problems({**rows, "chaos": row(1, Purpose.CHAOS, 0)}, uniform(0.0, 1.0)) == []
