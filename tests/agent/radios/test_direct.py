from __future__ import annotations

from agent.radios.direct import ROOM, DirectRadio
from patrol.net.keys import FleetKeys
from patrol.net.mailbox import Mailbox
from patrol.net.messages.telemetry import Traffic
from patrol.radio.message import MAX_FRAME

KEYS = FleetKeys("f")
OTHERS = {KEYS.position("r1"): 1, KEYS.position("r3"): 3}


class Clock:
    """A clock by which it is time to decide, or too late."""

    def __init__(self) -> None:
        self.in_time = True

    def tick(self) -> int | None:
        raise AssertionError("a radio does not wait for ticks")

    def decide(self) -> bool:
        return self.in_time


class Scene:
    """The radio of r2, and what it sends."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.clock = Clock()
        self.mailbox: Mailbox[bytes] = Mailbox(OTHERS, bytes, MAX_FRAME, ROOM)
        self.radio = DirectRadio(self.mailbox, self.sent.append, OTHERS, self.clock)

    def arrive(self, robot: str, *frames: bytes) -> None:
        for frame in frames:
            self.mailbox.put(KEYS.position(robot), frame)


def test_frames_go_out_and_come_in_by_sender() -> None:
    scene = Scene()
    scene.radio.send((b"position", b"contact"))
    assert scene.sent == [b"position", b"contact"]
    scene.arrive("r3", b"3a", b"3b")
    scene.arrive("r1", b"1a")
    assert scene.radio.hear() == [b"1a", b"3a", b"3b"]
    assert scene.radio.hear() == []
    assert scene.radio.traffic(2, final=True) == Traffic(2, 2, {"r1": 1, "r3": 2}, 0, final=True)


def test_what_comes_while_it_is_too_late_to_decide_is_heard_at_the_next_decision() -> None:
    scene = Scene()
    scene.clock.in_time = False
    scene.arrive("r1", b"early")
    assert scene.radio.hear() is None
    scene.clock.in_time = True
    scene.arrive("r1", b"late")
    assert scene.radio.hear() == [b"early", b"late"]


def test_of_a_senders_many_frames_the_oldest_go() -> None:
    scene = Scene()
    scene.arrive("r1", *(b"%d" % number for number in range(ROOM + 3)))
    scene.arrive("r3", b"x")
    heard = scene.radio.hear()
    assert heard is not None
    assert heard[0] == b"3"
    assert len(heard) == ROOM + 1
    traffic = scene.radio.traffic(1, final=False)
    assert (traffic.heard["r1"], traffic.refused) == (ROOM, 3)


def test_frames_of_its_own_name_and_of_strangers_are_not_heard() -> None:
    scene = Scene()
    for robot in ("r2", "nobody"):
        scene.arrive(robot, b"?")
    assert scene.radio.hear() == []
    assert scene.radio.traffic(1, final=False).refused == 2
