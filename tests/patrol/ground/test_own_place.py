"""A robot's own place: jitter is filtered, and all else is left as localisation says it."""

import math
import statistics

import pytest

from patrol.ground.own_place import OwnPlace
from patrol.ground.swept_path import advance
from patrol.pose import Command, Drive, Pose, Twist, Velocity, halted
from patrol.random import Purpose, gauss

STEP_S = 0.25
DRIVES: dict[str, tuple[Command, ...]] = {
    "holonomic": (Velocity(1.0, 0.0), Velocity(0.0, 0.7), Velocity(0.0, 0.0)),
    "differential": (Twist(0.8, 0.5), Twist(0.0, -1.0), Twist(0.5, 0.0)),
    "car": (Drive(2.0, 0.1), Drive(-1.0, -0.2), Drive(1.0, 0.0)),
}


def noise(k: int, axis: int, size_m: float) -> float:
    return size_m * gauss(7, Purpose.SENSES, k, axis)


def errors(
    drive: tuple[Command, ...], jitter_m: float, slip_m: float = 0.0, jump_m: float = 0.0
) -> list[tuple[float, float]]:
    """The errors (m) of localisation and of the filter in 400 ticks; the body slips, and localisation jumps at 200."""
    own, true, last = OwnPlace(STEP_S), Pose(3.0, 4.0, 0.3), halted("holonomic")
    off = []
    for k in range(400):
        shift = jump_m if k >= 200 else 0.0
        said = Pose(true.x + noise(k, 0, jitter_m) + shift, true.y + noise(k, 1, jitter_m), true.heading)
        pose = own.take(k, said, last, bumped=False)
        assert pose.heading == said.heading
        off.append(tuple(math.hypot(at.x - true.x - shift, at.y - true.y) for at in (said, pose)))
        last = drive[k // 9 % len(drive)]
        moved = advance(true, last, STEP_S)
        true = Pose(moved.x + noise(k, 2, slip_m), moved.y + noise(k, 3, slip_m), moved.heading)
    return [(said, filtered) for said, filtered in off]


def rms(off: list[float]) -> float:
    return math.sqrt(statistics.fmean(x * x for x in off))


@pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES)
@pytest.mark.parametrize("jitter_m", [0.02, 0.2])
def test_jitter_is_filtered_by_the_robots_own_motion(drive: tuple[Command, ...], jitter_m: float) -> None:
    said, filtered = zip(*errors(drive, jitter_m)[100:], strict=True)
    assert rms(list(filtered)) < 0.25 * rms(list(said))


@pytest.mark.parametrize(("jitter_m", "slip_m"), [(0.0, 0.0), (0.0, 0.05), (0.02, 0.05)])
def test_what_is_no_jitter_is_taken_to_the_bit(jitter_m: float, slip_m: float) -> None:
    assert all(said == filtered for said, filtered in errors(DRIVES["holonomic"], jitter_m, slip_m))


def test_a_body_that_moves_a_little_otherwise_is_not_lost() -> None:
    said, filtered = zip(*errors(DRIVES["differential"], 0.1, 0.01)[100:], strict=True)
    assert rms(list(filtered)) < 0.6 * rms(list(said))


@pytest.mark.parametrize("jump_m", [1.0, 0.5])
def test_a_jump_is_believed_from_its_second_tick_on(jump_m: float) -> None:
    off = errors(DRIVES["holonomic"], 0.05, jump_m=jump_m)
    assert off[200][1] > 0.5 * jump_m  # left out: it may be one wrong fix
    assert max(filtered for _, filtered in off[201:]) < 0.25
    assert rms([filtered for _, filtered in off[260:]]) < 0.5 * rms([said for said, _ in off[260:]])


def test_one_wrong_fix_is_left_out() -> None:
    own, last = OwnPlace(STEP_S), Velocity(0.0, 0.0)
    for k in range(100):
        own.take(k, Pose(noise(k, 0, 0.05), noise(k, 1, 0.05), 0.0), last, bumped=False)
    wrong = own.take(100, Pose(3.0, 0.0, 0.0), last, bumped=False)
    assert math.hypot(wrong.x, wrong.y) < 0.05


def test_a_move_that_was_cancelled_is_not_expected() -> None:
    own = OwnPlace(STEP_S)
    poses = [own.take(k, Pose(noise(k, 0, 0.05), 0.0, 0.0), Velocity(1.0, 0.0), bumped=True) for k in range(200)]
    assert max(abs(pose.x) for pose in poses[100:]) < 0.05


def test_after_a_tick_that_is_left_out_all_begins_anew() -> None:
    ticks = [*range(100), *range(101, 140)]
    one, other = OwnPlace(STEP_S), OwnPlace(STEP_S)
    said = {k: Pose(noise(k, 0, 0.05), noise(k, 1, 0.05), 0.0) for k in ticks}
    halt = Velocity(0.0, 0.0)
    late = [one.take(k, said[k], halt, bumped=False) for k in ticks][100:]
    assert late == [other.take(k, said[k], halt, bumped=False) for k in ticks[100:]]
