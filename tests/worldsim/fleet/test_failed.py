"""Robots whose minds cannot go on: lost with their own reason, in lockstep and at a pace."""

from __future__ import annotations

import pytest

from patrol.journal import Status
from patrol.messages.phases import Failed, Stop
from tests.worldsim.fleet.net import NAMES, RUN, Net, fleet_of, heard, sensed
from worldsim.fleet.paced import PacedFleet


@pytest.mark.parametrize("phase", ["A", "B"])
def test_who_cannot_go_on_is_lost_at_once_with_its_reason(phase: str) -> None:
    net = Net()
    fleet = fleet_of(net)
    net.mute = {2}
    net.deliver(2, Failed(1, 72, 3, RUN, "its policy failed at tick 3: no idea"), 0.2)
    began = net.time
    answers = fleet.phase_a(3, sensed(3)) if phase == "A" else fleet.phase_b(3, heard())
    assert list(answers) == [1, 3]
    assert net.time - began < 1.0
    assert fleet.lost() == [(2, Status.LOST, "its policy failed at tick 3: no idea")]
    assert fleet.lost() == []
    (stop,) = net.told(Stop, 2)
    assert isinstance(stop, Stop)
    assert (stop.reason, stop.orderly) == ("left out: its policy failed at tick 3: no idea", False)


def test_a_failure_of_another_process_is_not_the_robots_own() -> None:
    net = Net()
    fleet = fleet_of(net)
    net.deliver(2, Failed(1, 99, 3, RUN, "another instance"))
    net.deliver(2, Failed(2, 72, 3, RUN, "another incarnation"))
    assert list(fleet.phase_a(3, sensed(3))) == [1, 2, 3]
    assert fleet.lost() == []
    assert net.refused["stranger"] == 2


def test_a_robot_that_has_failed_may_come_again_as_another_process() -> None:
    net = Net()
    fleet = fleet_of(net)
    net.deliver(2, Failed(1, 72, 3, RUN, "no idea"))
    fleet.phase_a(3, sensed(3))
    net.sessions.end(2)
    assert net.sessions.failed(NAMES) == {}


def test_at_a_pace_too_who_cannot_go_on_is_lost_with_its_reason() -> None:
    net = Net()
    net.gather()
    fleet = PacedFleet(net.sessions, 0.5)
    net.mute = {2}
    net.deliver(2, Failed(1, 72, 0, RUN, "its policy failed at tick 0: no idea"), 0.2)
    net.deliver(3, Failed(1, 99, 0, RUN, "another instance"), 0.2)
    fleet.phase_a(0, sensed(0))
    fleet.phase_b(0, heard())
    assert fleet.lost() == [(2, Status.LOST, "its policy failed at tick 0: no idea")]
    (stop,) = net.told(Stop, 2)
    assert isinstance(stop, Stop)
    assert stop.reason == "left out: its policy failed at tick 0: no idea"
    fleet.phase_a(1, sensed(1, (1, 3)))
    fleet.phase_b(1, heard((1, 3)))
    assert fleet.lost() == []
