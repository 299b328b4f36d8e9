"""The world as a listener to robots that hear each other directly."""

import itertools
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.journal import End, Header
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.radio.message import Position, encode
from patrol.scenario import load_scenario
from runtime.messages.telemetry import Traffic
from runtime.net.mailbox import Mailbox
from runtime.security.keys import FleetKeys
from tests.worldsim.checks.judged import result_of
from worldsim.checks.check import CheckResult
from worldsim.checks.journal import DirectLinks
from worldsim.output.record import header_of
from worldsim.output.traffic import as_measured
from worldsim.radio.listener import Listener
from worldsim.run_record import COMPLETED, MemoryJournal
from worldsim.world import World

# Not the product's own, so that a wrong one there is noticed.
LAST_REPORTS_S = 2.0

KEYS = FleetKeys("f")
NUMBERS = {"r1": 1, "r2": 2}


class Scene:
    """A listener, what reaches it, and a clock that waiting moves on."""

    def __init__(self) -> None:
        self.time = 0.0
        self.positions: Mailbox[bytes] = Mailbox([KEYS.position(name) for name in NUMBERS], bytes, 64)
        self.telemetry = Waiting(self)
        self.listener = Listener(KEYS, NUMBERS, self.positions, self.telemetry, lambda: self.time)

    def send(self, robot: str, *frames: bytes) -> None:
        for frame in frames:
            self.positions.put(KEYS.position(robot), frame)

    def say(self, robot: str, *, incarnation: int = 1, final: bool = True, sent: int = 10, **heard: int) -> None:
        self.telemetry.put(KEYS.telemetry(robot), Traffic(incarnation, sent, heard, 1, final))


class Waiting(Mailbox[Traffic]):
    """A mailbox in which waiting passes the time of the test's clock."""

    def __init__(self, scene: Scene) -> None:
        super().__init__([KEYS.telemetry(name) for name in NUMBERS], lambda _payload: pytest.fail("undecoded"), 0, 1)
        self._scene = scene

    def get(self, timeout_s: float = 0.0) -> tuple[str, Traffic] | None:
        arrived = super().get()
        self._scene.time += 0.0 if arrived else timeout_s
        return arrived


def flood(monkeypatch: pytest.MonkeyPatch, mailbox: Mailbox[Any], send: Callable[[], None]) -> None:
    """Have another message arrive whenever one is taken; it is an error to read on and on."""
    get, taken = mailbox.get, itertools.count(1)

    def get_and_refill(timeout_s: float = 0.0) -> Any:
        assert next(taken) < 1000, "whoever floods the world keeps it from going on"
        arrived = get(timeout_s)
        send()
        return arrived

    monkeypatch.setattr(mailbox, "get", get_and_refill)
    send()


def position(number: int, k: int) -> bytes:
    return encode(Position.of(number, k, k * 0.5, Pose(1.0, 2.0, 0.0)))


def contact(k: int) -> bytes:
    return encode(Position.of_contact(k, k * 0.5, 3.0, 4.0))


def test_the_world_overhears_the_frames_of_its_tick() -> None:
    scene = Scene()
    scene.send("r1", position(1, 7), contact(7))
    scene.send("r2", position(2, 6))
    assert scene.listener.frames(7) == {1: [position(1, 7), contact(7)]}
    assert scene.listener.frames(8) == {}
    assert scene.listener.missed == {2: 1}


def test_a_robots_position_is_the_first_and_only_one_of_its_frames() -> None:
    scene = Scene()
    scene.send("r1", contact(7), position(1, 7), position(1, 7), b"junk")
    assert scene.listener.frames(7) == {1: [position(1, 7)]}
    assert scene.listener.missed == {1: 3}


def test_what_robots_say_of_their_radio_adds_up_over_their_processes() -> None:
    scene = Scene()
    scene.say("r1", sent=10, r2=3)
    scene.listener.frames(0)
    scene.say("r1", incarnation=2, sent=5, r2=1, stranger=99)
    scene.listener.frames(1)
    scene.say("r1", sent=1000, r2=1000)  # the process that is no more
    scene.say("r2", sent=20, r1=8)
    said = scene.listener.notes()["direct"]["said"]
    assert said["r1"] == {"sent": 15, "heard": {"r2": 4}, "refused": 2, "final": True}
    assert said["r2"] == {"sent": 20, "heard": {"r1": 8}, "refused": 1, "final": True}
    assert scene.time == 0.0


@pytest.mark.parametrize(("incarnation", "final"), [(2, False), (3, True)])
def test_the_counts_of_a_robot_that_was_killed_are_not_whole(incarnation: int, final: bool) -> None:
    scene = Scene()
    scene.say("r1", sent=10, final=final)
    scene.listener.frames(0)
    scene.say("r1", incarnation=incarnation, sent=5)
    said = scene.listener.notes()["direct"]["said"]
    assert (said["r1"]["sent"], said["r1"]["final"]) == (15, False)


def test_the_world_waits_a_moment_for_last_words() -> None:
    scene = Scene()
    scene.say("r1", final=False)
    notes = scene.listener.notes()["direct"]
    assert list(notes["said"]) == ["r1"]
    assert not notes["said"]["r1"]["final"]
    assert scene.time == pytest.approx(LAST_REPORTS_S)


def test_a_flood_of_frames_keeps_no_tick_open(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene()
    scene.send("r1", position(1, 7))
    flood(monkeypatch, scene.positions, lambda: scene.send("r2", b"junk"))
    assert scene.listener.frames(7) == {1: [position(1, 7)]}
    assert scene.listener.missed == {2: 1}


def test_a_flood_of_reports_keeps_neither_a_tick_nor_the_run_open(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene()

    def report() -> None:
        scene.time += 0.01
        scene.say("r1", final=False)

    flood(monkeypatch, scene.telemetry, report)
    assert scene.listener.frames(7) == {}
    began = scene.time
    assert list(scene.listener.notes()["direct"]["said"]) == ["r1"]
    assert scene.time - began == pytest.approx(LAST_REPORTS_S, abs=0.1)


def direct(**more: object) -> Mapping[str, Any]:
    robots = {"count": 2, "model": "holonomic"}
    values = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": 2.0, "robots": robots, "pace": 1.0}
    return {**values, "radio": {"via": "direct"}, **more}


@pytest.fixture(scope="module")
def header() -> Header:
    return header_of(World(prepare(load_scenario(direct()))))


@pytest.fixture
def ended(header: Header) -> Callable[..., MemoryJournal]:
    def make(said: Mapping[str, Any]) -> MemoryJournal:
        journal = MemoryJournal(header)
        journal.write(End(COMPLETED, "", {"direct": {"said": said, "missed": {"r1": 0, "r2": 1}}}))
        return journal

    return make


def says(sent: int, *, final: bool = True, **heard: int) -> dict[str, Any]:
    return {"sent": sent, "heard": heard, "refused": 0, "final": final}


def links_of(journal: MemoryJournal) -> CheckResult:
    return result_of(DirectLinks, prepare(load_scenario(direct())), journal)


def test_links_are_measured_and_not_judged(ended: Callable[..., MemoryJournal]) -> None:
    journal = ended({"r1": says(10, r2=15), "r2": says(20, r1=8)})
    check = links_of(journal)
    assert check.ok
    assert "not judged" in check.detail
    assert "23 of 30" in check.detail
    facts = {"sent": 0, "delivered": 0, "dropped": 0}
    robots = {"r1": facts, "r2": facts}
    summary = as_measured({"messages": {"frames": 29, "rejected": 0}, "robots": robots}, journal)
    assert summary["direct"] == {
        "links": {"r2 to r1": {"sent": 20, "heard": 15}, "r1 to r2": {"sent": 10, "heard": 8}},
        "heard_share": 23 / 30,
        "missed": {"r1": 0, "r2": 1},
        "unsaid": [],
    }
    assert summary["robots"]["r2"] == {"sent": 20, "delivered": 15, "dropped": None, "in_flight": None}
    assert summary["messages"]["dropped"] is None


def test_a_robot_that_has_said_nothing_is_named(ended: Callable[..., MemoryJournal]) -> None:
    journal = ended({"r1": says(10, r2=15)})
    assert links_of(journal).ok
    summary = as_measured({"messages": {}, "robots": {}}, journal)["direct"]
    assert summary["links"] == {}
    assert summary["heard_share"] is None
    assert summary["unsaid"] == ["r2"]


def test_nobody_can_have_heard_more_than_was_sent(ended: Callable[..., MemoryJournal]) -> None:
    check = links_of(ended({"r1": says(10, r2=21), "r2": says(20, r1=8)}))
    assert not check.ok
    assert check.detail == "r1 heard 21 frames of r2, which sent 20"
    killed = ended({"r1": says(10, r2=21), "r2": says(20, final=False, r1=8)})
    assert links_of(killed).ok, "what a killed robot sent last it could not say"


def test_the_world_carries_nothing() -> None:
    world = World(prepare(load_scenario(direct())))
    world.begin_tick()
    frames = {number: [position(number, 0)] for number in (1, 2)}
    assert world.exchange(frames) == {1: [], 2: []}
    record = world.end_tick({})
    assert [source for source, _ in record.frames] == [1, 2]
    assert record.deliveries == ()
    assert record.dropped == ()


DRIFT, LOSS = {"kind": "drift", "who": "one", "bias": [1, 0]}, {"kind": "loss", "rate": 0.5}


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        ({"pace": "lockstep"}, r"radio\.via.*pace is lockstep; set pace"),
        ({"faults": [DRIFT, LOSS]}, r"faults\.1.*: loss acts on frames in the ether"),
        (
            {"radio": {"via": "direct", "model": "path-loss"}},
            r"radio\.model: decides what reaches whom in the ether, and radio\.via is direct",
        ),
    ],
    ids=["lockstep", "a fault of the ether", "a model"],
)
def test_what_a_direct_radio_cannot_have_is_refused(more: dict[str, Any], problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        load_scenario(direct(**more))


def test_the_counts_of_every_process_of_a_robot_add_up() -> None:
    scene = Scene()
    for incarnation in range(1, 5):
        scene.say("r1", incarnation=incarnation, sent=10**incarnation, r2=incarnation)
        scene.listener.frames(incarnation)
    scene.say("r2")
    said = scene.listener.notes()["direct"]["said"]["r1"]
    assert said == {"sent": 11110, "heard": {"r2": 10}, "refused": 4, "final": True}
