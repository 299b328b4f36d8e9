import math
from collections.abc import Sequence

import numpy as np
import pytest

from agent.build import Shared, build_mind
from agent.own_robot import LateClock, foreseen
from patrol.exchange import Sensed
from patrol.ground.swept_path import advance
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Drive, Pose, Twist, Velocity, is_halt
from patrol.prepare import prepare
from patrol.radio.peers import Peer
from patrol.scenario import load_scenario
from ros2.robot.fence import Fence, Other, Others

# Not the product's own, so that a wrong one there is noticed.
CARRIED_S = 1.0

RADIUS = 0.3
STEP_S = 0.5
FENCE = Fence(Terrain("t", np.ones((200, 200), dtype=np.bool_), 0.1), RADIUS, 0.2, 2.0)
HERE = Pose(5.0, 5.0, 0.0)


def other(x: float, y: float, vx: float = 0.0, vy: float = 0.0) -> Other:
    return Other(x, y, vx, vy, RADIUS, 0.0)


def test_a_velocity_follows_from_two_positions_and_ends_with_silence() -> None:
    peers = {2: Peer(10, Pose(1.0, 1.0, 0.0), 10)}
    others = Others(peers, {2: 0.4}, STEP_S)
    others.look(0.0)
    assert others.around(0.0) == (Other(1.0, 1.0, 0.0, 0.0, 0.4, 0.0),)
    peers[2] = Peer(12, Pose(2.0, 1.0, 0.0), 12)
    others.look(1.0)
    others.look(1.5)  # nothing new
    (one,) = others.around(1.6)
    assert (one.x, one.vx, one.vy, one.since_s) == pytest.approx((2.0, 1.0, 0.0, 0.6))
    assert one.distance(2.0, 1.0, 0.2) == pytest.approx(0.8)
    assert one.distance(2.0, 1.0, 99.0) == pytest.approx(CARRIED_S)
    peers[2] = Peer(112, Pose(9.0, 1.0, 0.0), 112)
    others.look(2.0)
    assert others.around(2.0)[0].speed == 0.0


@pytest.mark.parametrize("adaptive", [{"error": 1.0, "silence": 4.0}, None])
def test_the_fence_knows_where_a_steady_robot_is_that_saves_on_its_radio(adaptive: dict[str, float] | None) -> None:
    """Robot 2 goes on steadily at 1 m/s. Where the fleet predicts, it sends in every eighth tick."""
    robots = [{"name": name, "model": "holonomic", "speed": 1.0} for name in ("r1", "r2")]
    radio = {"via": "direct", "trail": 2, "adaptive": adaptive}
    raw = {"terrain": {"builtin": "open"}, "pace": "realtime", "robots": robots, "radio": radio}
    prepared = prepare(load_scenario(raw))
    mind, sending_mind = (build_mind(Shared(prepared), number) for number in (1, 2))
    clock = LateClock()
    others = Others(mind.belief.peers, mind.facts.radii, STEP_S, foreseen(mind, clock))
    sent = []
    for clock.k in range(40):
        there = Sensed(clock.k, Pose(20.0 + STEP_S * clock.k, 20.0, 0.0), clock_s=clock.k * STEP_S)
        frames = sending_mind.frames(there)
        sent += [clock.k] if frames else []
        mind.belief.hear(clock.k, Pose(5.0, 5.0, 0.0), frames)
        now_s = clock.k * STEP_S
        others.look(now_s)
        (one,) = others.around(now_s + 0.25)
        if len(sent) > 1:  # the first frame cannot say how fast its robot is
            assert (one.vx, one.vy) == pytest.approx((1.0, 0.0), abs=0.05), clock.k
            assert one.distance(there.pose.x + 0.25, there.pose.y, 0.0) < 0.1, clock.k
    assert (sent[-1] - sent[-2] == 8) == (adaptive is not None), sent


@pytest.mark.parametrize("command", [Velocity(1.0, 0.0), Twist(1.0, 0.0), Drive(1.0, 0.0)])
@pytest.mark.parametrize("blocker", [other(5.65, 5.0), other(5.9, 5.0, -1.0), other(5.6, 5.2)])
def test_nobody_drives_into_another(command: Command, blocker: Other) -> None:
    assert is_halt(FENCE.allowed(HERE, command, [blocker]))


@pytest.mark.parametrize("at", [(5.0, 5.65), (4.3, 5.0), (7.5, 5.0), (6.0, 5.0, 2.0), (7.0, 5.7, -1.0)])
def test_who_is_beside_behind_or_on_the_way_elsewhere_is_not_in_the_way(at: tuple[float, ...]) -> None:
    assert FENCE.allowed(HERE, Twist(1.0, 0.0), [other(*at)]) == Twist(1.0, 0.0)


def test_who_is_too_near_already_may_go_away_or_turn() -> None:
    touching = [other(5.5, 5.0)]
    assert FENCE.allowed(HERE, Twist(-1.0, 0.0), touching) == Twist(-1.0, 0.0)
    assert FENCE.allowed(HERE, Twist(1.0, 0.5), touching) == Twist(0.0, 0.5)
    assert FENCE.allowed(HERE, Velocity(0.0, 1.0), touching) == Velocity(0.0, 1.0)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 2.5])
def test_two_that_drive_at_each_other_stop_apart(angle: float) -> None:
    """Each knows the other by its last tick's position only, and brakes no harder than it can."""
    poses = [Pose(6.0, 8.0, 0.0), Pose(10.0 + 2.0 * math.cos(angle), 8.0 + 2.0 * math.sin(angle), math.pi + angle)]
    peers: list[dict[int, Peer]] = [{}, {}]
    others: Sequence[Others] = [Others(one, {0: RADIUS, 1: RADIUS}, STEP_S) for one in peers]
    told: list[Command] = [Twist(0.0, 0.0), Twist(0.0, 0.0)]
    nearest = math.inf
    for number in range(200):
        now_s = number * 0.05
        if number % 10 == 0:
            for me in (0, 1):
                peers[me][1 - me] = Peer(number // 10, poses[1 - me], number // 10)
                others[me].look(now_s)
        for me in (0, 1):
            allowed = FENCE.allowed(poses[me], Twist(1.0, 0.0), others[me].around(now_s))
            least = told[me].numbers[0] - 2.0 * 0.05
            told[me] = Twist(max(allowed.numbers[0], least), 0.0)
        poses = [advance(pose, command, 0.05) for pose, command in zip(poses, told, strict=True)]
        nearest = min(nearest, math.dist((poses[0].x, poses[0].y), (poses[1].x, poses[1].y)))
    assert nearest >= 2.0 * RADIUS - 0.05


@pytest.mark.parametrize("ticks", [1, 2, 4, 5, -1])
def test_a_velocity_follows_from_positions_that_are_at_most_four_ticks_apart(ticks: int) -> None:
    peers = {2: Peer(10, Pose(1.0, 2.0, 0.0), 10)}
    others = Others(peers, {2: 0.4}, STEP_S)
    others.look(0.0)
    peers[2] = Peer(10 + ticks, Pose(3.0, 1.0, 0.0), 10 + ticks)
    others.look(1.0)
    (one,) = others.around(1.0)
    moved = (2.0 / (ticks * STEP_S), -1.0 / (ticks * STEP_S)) if 0 < ticks <= 4 else (0.0, 0.0)
    assert (one.x, one.y, one.vx, one.vy, one.since_s) == pytest.approx((3.0, 1.0, *moved, 0.0))
    assert one.speed == pytest.approx(math.hypot(*moved))


@pytest.mark.parametrize(("apart_m", "drives"), [(0.71, True), (0.69, False)])
def test_bodies_keep_as_far_apart_as_both_are_wide(apart_m: float, drives: bool) -> None:
    """Radii of 0.3 and 0.4 m; it passes the other on a straight line."""
    passed = Other(HERE.x + 0.1, HERE.y + apart_m, 0.0, 0.0, 0.4, 0.0)
    assert (FENCE.allowed(HERE, Velocity(0.4, 0.0), (passed,)) == Velocity(0.4, 0.0)) is drives


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75, 1.0])
def test_one_that_crosses_at_each_quarter_of_the_time_until_it_stands_is_seen(share: float) -> None:
    """At 1 m/s it stands after 0.2 + 0.25 s, and the other 0.3 s later: 0.75 s, in which it crosses at 8 m/s."""
    crosses_s = 0.75 * share
    crossing = Other(5.0 + crosses_s, 5.0 - 8.0 * crosses_s, 0.0, 8.0, RADIUS, 0.0)
    assert FENCE.allowed(HERE, Twist(1.0, 0.0), [crossing]) != Twist(1.0, 0.0)
    slow_s = (0.2 + 0.25 * 0.125 + 0.3) * share
    crossing = Other(5.0 + 0.125 * slow_s, 5.0 - 8.0 * slow_s, 0.0, 8.0, RADIUS, 0.0)
    assert FENCE.allowed(HERE, Twist(0.125, 0.0), [crossing]) != Twist(0.125, 0.0)


@pytest.mark.parametrize("eighths", range(9))
def test_a_command_is_slowed_down_by_eighths(eighths: int) -> None:
    """At v m/s it needs 0.2 v + v^2 / 4 m, so that at 2 m/s it needs 1.4 m and at an eighth of that 0.066 m."""
    speed = 2.0 * eighths / 8.0
    free = np.ones((40, 200), dtype=np.bool_)
    free[:, 100:] = False
    fence = Fence(Terrain("t", free, 0.1), RADIUS, 0.2, 2.0)
    here = Pose(10.0 - RADIUS - 0.2 * speed - speed**2 / 4.0 - 0.02, 2.0, 0.0)
    assert fence.allowed(here, Twist(2.0, 0.0)) == Twist(speed, 0.0)


@pytest.mark.parametrize(("ahead_m", "drives"), [(3.7, True), (3.5, False)])
def test_one_that_brakes_weakly_looks_as_far_as_it_goes(ahead_m: float, drives: bool) -> None:
    """At 1 m/s it stands after 0.2 + 2.5 s, and 0.3 s more are kept: it gets within 0.6 m of one 3.6 m ahead."""
    weak = Fence(FENCE.terrain, RADIUS, 0.2, 0.2)
    allowed = weak.allowed(HERE, Twist(1.0, 0.0), [other(HERE.x + ahead_m, HERE.y)])
    assert (allowed == Twist(1.0, 0.0)) is drives
