"""At a pace: what holds up the world costs no robot a deadline, and the ticks find back to the clock."""

from __future__ import annotations

import pytest

from patrol.net.messages.phases import PhaseA, PhaseB, ReplyA, ToRobot
from tests.worldsim.fleet.net import NAMES, RUN, Net, heard, sensed
from worldsim.fleet.paced import COMMAND_SHARE, HELD_UP_S, PacedFleet

STEP_S = 0.5


def fleet_at_a_pace() -> tuple[Net, PacedFleet]:
    net = Net()
    net.gather()
    return net, PacedFleet(net.sessions, STEP_S)


def missed(fleet: PacedFleet) -> tuple[int, int]:
    return fleet.late_frames.total(), fleet.late_commands.total()


def test_phase_b_begins_when_all_frames_are_there() -> None:
    net, fleet = fleet_at_a_pace()
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
    net, fleet = fleet_at_a_pace()
    net.delays = {(2, 0, "A"): 0.05}
    net.deliver(3, ReplyA(1, 73, 0, RUN, (b"frame",)))
    assert fleet.phase_a(0, sensed(0, (1, 2))) == dict.fromkeys((1, 2), (b"frame",))


def test_who_begins_late_gives_the_robots_their_time_all_the_same() -> None:
    net, fleet = fleet_at_a_pace()
    fleet.phase_a(0, sensed(0))
    fleet.phase_b(0, heard())
    net.time += 0.9 * STEP_S
    net.delays = {(1, 1, "A"): 0.09, (1, 1, "B"): 0.9 * COMMAND_SHARE * STEP_S}
    fleet.phase_a(1, sensed(1))
    fleet.phase_b(1, heard())
    assert missed(fleet) == (0, 0)


def test_ticks_that_began_late_find_back_to_the_clock() -> None:
    net, fleet = fleet_at_a_pace()
    began = net.time
    for k in range(8):
        fleet.phase_a(k, sensed(k))
        fleet.phase_b(k, heard())
        net.time += 0.9 * STEP_S if k == 2 else 0.0
    assert net.time - began == pytest.approx(8 * STEP_S)
    assert missed(fleet) == (0, 0)
    assert fleet.slipped_s == 0.0


@pytest.mark.parametrize(("phase", "kind"), [("A", PhaseA), ("B", PhaseB)])
def test_a_machine_that_stands_still_costs_no_robot_a_deadline(phase: str, kind: type[ToRobot]) -> None:
    net, fleet = fleet_at_a_pace()
    still_s = 2.0 * STEP_S
    usual_s = {"A": 0.09, "B": 0.9 * STEP_S}[phase]
    net.delays = {(number, 0, phase): still_s + usual_s for number in NAMES}
    stood_still: list[float] = []

    def stand_still() -> None:
        if net.told(kind, 3) and not stood_still:
            stood_still.append(net.time)
            net.time += still_s

    fleet.meanwhile = stand_still
    fleet.phase_a(0, sensed(0))
    fleet.phase_b(0, heard())
    assert stood_still
    assert missed(fleet) == (0, 0)


def test_a_robot_that_alone_is_late_is_late() -> None:
    net, fleet = fleet_at_a_pace()
    net.delays = {(1, 0, "A"): 0.11, (2, 0, "B"): STEP_S}
    began = net.time
    fleet.phase_a(0, sensed(0))
    fleet.phase_b(0, heard())
    assert missed(fleet) == (1, 1)
    assert net.time - began == pytest.approx(STEP_S)


def test_what_the_world_does_in_the_usual_course_of_things_is_no_hold_up() -> None:
    net, fleet = fleet_at_a_pace()

    def busy() -> None:
        net.time += 0.9 * HELD_UP_S

    fleet.aside = busy
    net.mute = {1}
    began = net.time
    fleet.phase_a(0, sensed(0))
    assert net.time - began == pytest.approx(0.1)
