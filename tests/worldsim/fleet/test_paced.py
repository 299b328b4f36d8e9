"""At a pace: what holds up the world costs no robot a deadline and is counted, and the ticks find back to the clock."""

import pytest

from patrol.exchange import Reply
from patrol.pose import Velocity
from runtime.messages.phases import ReplyA, ReplyB
from tests.worldsim.fleet.net import NAMES, RUN, heard, paced, sensed, tick
from worldsim.fleet.paced import PacedFleet

# Not the product's own, so that a wrong one there is noticed.
COMMAND_SHARE = 0.5
LOOK_S = 0.005
WAKING_S = 0.002

STEP_S = 0.5


def run(fleet: PacedFleet, ticks: int) -> None:
    for k in range(ticks):
        tick(fleet, k)


def missed(fleet: PacedFleet) -> tuple[int, int]:
    return fleet.late_frames.total(), fleet.late_commands.total()


def test_phase_b_begins_when_all_frames_are_there() -> None:
    net, fleet = paced()
    began = net.time
    net.delays = {(3, 0, "A"): 0.03}
    fleet.phase_a(0, sensed(0))
    assert net.time - began == pytest.approx(0.03)
    net.mute = {2}
    fleet.phase_b(0, heard())
    fleet.phase_a(1, sensed(1))
    assert net.time - began == pytest.approx(STEP_S + 0.1)
    assert fleet.late_frames == {2: 1}


def test_a_robot_that_was_not_asked_answers_for_no_other() -> None:
    net, fleet = paced()
    net.delays = {(2, 0, "A"): 0.05}
    net.deliver(3, ReplyA(1, 73, 0, RUN, (b"frame",)))
    assert fleet.phase_a(0, sensed(0, (1, 2))) == dict.fromkeys((1, 2), (b"frame",))


def test_who_begins_late_gives_the_robots_their_time_all_the_same() -> None:
    net, fleet = paced()
    tick(fleet, 0)
    net.time += 0.9 * STEP_S
    net.delays = {(1, 1, "A"): 0.09, (1, 1, "B"): 0.9 * COMMAND_SHARE * STEP_S}
    tick(fleet, 1)
    assert missed(fleet) == (0, 0)


def test_ticks_that_began_late_find_back_to_the_clock() -> None:
    net, fleet = paced()
    began = net.time
    for k in range(8):
        tick(fleet, k)
        net.time += 0.9 * STEP_S if k == 2 else 0.0
    assert net.time - began == pytest.approx(8 * STEP_S)
    assert missed(fleet) == (0, 0)
    assert fleet.slipped_s == 0.0


@pytest.mark.parametrize("step_s", [0.5, 0.05])
@pytest.mark.parametrize("phase", ["A", "B"])
@pytest.mark.parametrize("steps", [0.1, 0.5, 0.99])
def test_a_machine_that_stands_still_costs_no_robot_a_deadline(phase: str, step_s: float, steps: float) -> None:
    net, fleet = paced(step_s)
    usual_s = {"A": 0.09, "B": 0.85}[phase] * step_s
    net.delays = {(number, 0, phase): usual_s for number in NAMES}
    net.stands_still.append((net.time + 0.5 * usual_s, steps * step_s))
    run(fleet, 1)
    assert missed(fleet) == (0, 0)
    assert fleet.held_up_s == fleet.longest_held_up_s == pytest.approx(steps * step_s, abs=LOOK_S + WAKING_S)
    assert fleet.notes()["held_up_s"] == fleet.held_up_s


def test_robots_have_a_step_again_at_most() -> None:
    net, fleet = paced()
    for _ in range(3):
        net.stands_still.append((net.time + 0.2, 0.9 * STEP_S))
    net.mute = {2}
    began = net.time
    run(fleet, 1)
    assert fleet.held_up_s == fleet.longest_held_up_s == pytest.approx(STEP_S)
    assert net.time - began < 4.0 * STEP_S


def test_what_is_counted_as_held_up_is_no_usual_delay() -> None:
    net, fleet = paced()
    for look in range(20):
        net.stands_still.append((net.time + 0.01 * look, 0.9 * WAKING_S))
    run(fleet, 1)
    assert fleet.held_up_s == 0.0


@pytest.mark.parametrize("busy_s", [0.015, 0.025, 0.06, 0.2])
def test_a_tick_ends_however_busy_the_world_is(busy_s: float) -> None:
    net, fleet = paced()

    def busy() -> None:
        net.time += busy_s

    fleet.meanwhile = busy
    net.mute = {1}
    began = net.time
    run(fleet, 4)
    assert net.time - began <= 4 * (STEP_S + busy_s)
    assert missed(fleet) == (4, 4)
    assert fleet.held_up_s == 0.0


@pytest.mark.parametrize("aside_s", [0.04, 0.2])
def test_what_comes_while_the_world_is_busy_is_there_in_time_and_who_is_mute_slows_nobody(aside_s: float) -> None:
    net, fleet = paced()

    def busy() -> None:
        net.time += aside_s

    fleet.aside = busy
    net.mute = {1}
    net.delays = {(2, k, "A"): 0.9 * max(0.1, aside_s) for k in range(20)}
    began = net.time
    run(fleet, 20)
    assert net.time - began == pytest.approx(20 * STEP_S)
    assert (fleet.late_frames, fleet.late_commands) == ({1: 20}, {1: 20})
    assert fleet.slipped_s == fleet.held_up_s == 0.0


def test_a_robot_that_floods_the_world_keeps_no_tick_open() -> None:
    net, fleet = paced()
    began = net.time
    net.delays = {(2, 0, "B"): 1.2 * STEP_S}
    fleet.phase_a(0, sensed(0))
    for letter in range(1500):
        net.deliver(1, ReplyB(1, 71, 0, RUN, Reply(Velocity(0.0, 0.0), "patrolling", None, 2.0, 0)), 0.0005 * letter)
    fleet.phase_b(0, heard())
    assert net.time - began < 1.1 * STEP_S
    assert fleet.late_commands == {2: 1}


def test_a_robot_that_alone_is_late_is_late() -> None:
    net, fleet = paced()
    net.delays = {(1, 0, "A"): 0.11, (2, 0, "B"): STEP_S}
    began = net.time
    tick(fleet, 0)
    assert missed(fleet) == (1, 1)
    assert net.time - began == pytest.approx(STEP_S)


def test_a_hold_up_counts_for_its_own_tick_and_a_slip_once() -> None:
    net, fleet = paced()
    net.mute = {2}
    for k in range(4):
        net.stands_still.append((net.time + 0.02, 0.4 * STEP_S))
        tick(fleet, k)
    near = LOOK_S + WAKING_S
    assert fleet.longest_held_up_s == pytest.approx(0.4 * STEP_S, abs=near)
    assert fleet.held_up_s == pytest.approx(4 * 0.4 * STEP_S, abs=4 * near)
    net, fleet = paced()
    tick(fleet, 0)
    net.time += 3.0 * STEP_S
    began = net.time
    tick(fleet, 1)
    slipped_s = fleet.slipped_s
    assert slipped_s == pytest.approx(3.0 * STEP_S)
    for k in range(2, 6):
        tick(fleet, k)
    assert fleet.slipped_s == slipped_s
    assert net.time - began == pytest.approx(5 * STEP_S)
