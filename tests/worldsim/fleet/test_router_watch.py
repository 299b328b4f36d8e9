"""A router that stands still is no reason to lose a robot; one that answers is none to wait."""

from collections.abc import Callable

from patrol.journal import Status
from runtime.messages.phases import ReplyA
from runtime.messages.session import RETURN_S
from tests.worldsim.fleet.net import NAMES, RUN, Net, sensed, tick
from worldsim.fleet.lockstep import LockstepFleet
from worldsim.fleet.paced import PacedFleet
from worldsim.fleet.router_watch import RouterWatch

# Not the product's own, so that a wrong one there is noticed.
EVERY_S = 1.0
SETTLING_S = 2.0
SILENT_S = 1.0


class Router:
    """A router that is silent for a while, as a clock says."""

    def __init__(self, now: Callable[[], float]) -> None:
        self.now = now
        self.connected = True
        self.silent = (0.0, 0.0)
        self.asked: list[float] = []
        self.said: list[str] = []
        self.watch = RouterWatch(lambda: self.connected, self.echo, now, self.said.append)

    def echo(self) -> Callable[[], bool]:
        asked = self.now()
        self.asked.append(asked)
        return lambda: not self.silent[0] <= asked < self.silent[1] or self.now() >= self.silent[1]


def test_it_is_asked_now_and_then_and_believed_silent_only_after_a_while() -> None:
    time = [100.0]
    router = Router(lambda: time[0])
    for _ in range(50):
        assert router.watch.answers()
        time[0] += 0.1
    assert 5 <= len(router.asked) <= 6
    router.silent = (time[0], time[0] + 20.0)
    began = time[0]
    answered = []
    while time[0] < began + 21.0:
        answered.append(router.watch.answers())
        time[0] += 0.1
    assert all(answered[: round(SILENT_S / 0.1) - 1])
    assert not any(answered[round((SILENT_S + EVERY_S) / 0.1) + 1 : 199])
    assert answered[-1]
    assert 18.0 < router.watch.silent_s < 21.0
    assert [line.partition(" for ")[0] for line in router.said[:2]] == 2 * ["the router has not answered"]
    assert router.said[-1].startswith("the router answers again, after ")
    assert len(router.said) == 3


def test_it_has_settled_some_time_after_its_return() -> None:
    time = [100.0]
    router = Router(lambda: time[0])
    assert router.watch.settled()
    router.connected = False
    assert not router.watch.settled()
    time[0] += 2.0
    router.connected = True
    assert router.watch.answers()
    assert not router.watch.settled()
    time[0] += SETTLING_S
    assert router.watch.settled()
    assert router.said == []  # it was away for less than is worth a line


def fleet_with(net: Net) -> tuple[LockstepFleet, Router]:
    net.gather()
    router = Router(lambda: net.time)
    return LockstepFleet(net.sessions, 10.0, router.watch), router


def test_in_lockstep_the_world_waits_for_a_silent_router_and_for_nobody_longer_than_the_deadline() -> None:
    net = Net()
    fleet, router = fleet_with(net)
    began = net.time
    router.silent = (began, began + 60.0)
    net.mute = {2}
    net.deliver(2, ReplyA(1, 72, 0, RUN, (b"frame",)), 65.0)
    assert list(fleet.phase_a(0, sensed(0))) == [1, 2, 3]
    assert fleet.lost() == []
    assert router.said[0].startswith("the router has not answered")
    assert fleet.notes()["router_silent_s"] > 50.0
    net.mute = {3}
    began = net.time
    assert list(fleet.phase_a(1, sensed(1))) == [1, 2]
    assert 10.0 <= net.time - began < 11.0
    assert [(number, status) for number, status, _ in fleet.lost()] == [(3, Status.LOST)]


def test_a_token_that_goes_with_the_router_loses_nobody() -> None:
    net = Net()
    net.gather()
    router = Router(lambda: net.time)
    net.connected = False
    object.__setattr__(net.wire, "connected", router.watch.settled)
    fleet = PacedFleet(net.sessions, 0.5, router=router.watch)
    began = net.time
    router.silent = (began, began + 12.0)
    net.mute = set(NAMES)
    for number in NAMES:  # a stopped router reports all of this once it goes on
        net.presence(number, False, 12.1)
        net.presence(number, True, 13.0)
    k = 0
    while net.time < began + 20.0:
        tick(fleet, k)
        assert fleet.lost() == []
        k += 1
    assert set(fleet.notes()["late_commands"].values()) == {k}
    net.presence(1, False)
    gone: list[int] = []
    while not gone and net.time < began + 40.0:
        tick(fleet, k)
        gone = [number for number, _, _ in fleet.lost()]
        k += 1
    assert gone == [1]
    assert net.time < began + 20.0 + RETURN_S + 3.0


def test_the_time_of_all_its_silences_counts() -> None:
    time = [100.0]
    router = Router(lambda: time[0])
    for lasts in (2.0, 3.0):
        router.connected = False
        assert not router.watch.answers()
        time[0] += lasts
        router.connected = True
        assert router.watch.answers()
        time[0] += 5.0
    assert router.watch.silent_s == 5.0
