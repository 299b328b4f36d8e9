import pytest

from agent.robots.direct import ROOM, DirectRadio, Skew
from patrol.pose import Pose
from patrol.radio.message import Position, encode
from runtime.messages.telemetry import Traffic
from runtime.net.mailbox import FrameMailbox
from runtime.reporting.vitals import DROPPED, Vitals
from runtime.security.keys import FleetKeys
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
APART = 2
REMEMBERED = 9

KEYS = FleetKeys("f")
STEP_S = 0.5
OTHERS = {KEYS.position("r1"): 1, KEYS.position("r3"): 3}


def frame_of(number: int, k: int, key: bytes | None = None) -> bytes:
    return encode(Position.of(number, k, k * STEP_S, Pose(1.0, 1.0, 0.0)), key)


class Clock:
    """A clock by which it is time to decide, or too late."""

    def __init__(self) -> None:
        self.in_time = True
        self.k = 0

    def tick(self) -> int | None:
        raise AssertionError("a radio does not wait for ticks")

    def decide(self) -> bool:
        return self.in_time


class Scene:
    """The radio of r2, and what it sends."""

    def __init__(self, key: bytes | None = None) -> None:
        self.sent: list[bytes] = []
        self.clock = Clock()
        self.mailbox = FrameMailbox(OTHERS, ROOM)
        skew = Skew({1: "r1", 3: "r3"}, STEP_S, key)
        self.radio = DirectRadio(self.mailbox, self.sent.append, OTHERS, self.clock, skew)

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
    heard = present(scene.radio.hear())
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


def test_what_the_network_has_held_up_for_long_is_not_heard() -> None:
    scene, vitals = Scene(), Vitals()
    scene.radio.show(vitals)
    for k in range(20):
        scene.clock.k = k
        if not 10 <= k < 18:
            scene.arrive("r1", frame_of(1, k))
        if k == 18:
            scene.arrive("r1", *(frame_of(1, held_up) for held_up in range(10, 18)))
        heard = scene.radio.hear()
        if k == 18:
            assert heard == [frame_of(1, in_time) for in_time in (18, 14, 15, 16, 17)]
    traffic = scene.radio.traffic(1, final=False)
    assert (traffic.heard["r1"], traffic.refused) == (16, 4)
    assert vitals.read()[DROPPED] == {"late": 4}


def test_a_robot_whose_clock_is_behind_is_heard() -> None:
    scene = Scene()
    for k in range(20, 40):
        scene.clock.k = k
        scene.arrive("r1", frame_of(1, k - 20))
        assert scene.radio.hear() == [frame_of(1, k - 20)]
    assert scene.radio.skew.ticks == {"r1": -20}


@pytest.mark.parametrize(("key", "forged"), [(None, 1), (b"secret" * 4, 20)])
def test_forged_frames_of_ticks_to_come_make_no_other_late(key: bytes | None, forged: int) -> None:
    """With a key not even many do."""
    scene = Scene(key)
    for k in range(100):
        scene.clock.k = k
        if k % 10 == 3:
            scene.arrive("r1", *(frame_of(1, 10**6 + again) for again in range(forged)))
        scene.arrive("r1", frame_of(1, k, key))
        heard = present(scene.radio.hear())
        assert heard[-1] == frame_of(1, k, key)


def test_a_robot_is_not_heard_under_another_s_key() -> None:
    scene = Scene()
    contact = encode(Position.of_contact(0, 0.0, 1.0, 2.0))
    scene.arrive("r1", frame_of(3, 0), frame_of(2, 0), contact, frame_of(1, 0))
    assert scene.radio.hear() == [contact, frame_of(1, 0)]
    assert scene.mailbox.refused == {"forged": 2}


# --- how far apart robots count, and which positions are late --------------------------------------------------------


def test_robots_that_count_alike_give_no_cause_for_a_word() -> None:
    skew = Skew({2: "r2", 3: "r3"}, STEP_S)
    for k in range(20):
        skew.hear(k, [frame_of(2, k), frame_of(3, max(0, k - APART))])
    assert skew.ticks == {"r2": 0, "r3": -APART}
    assert skew.complaint() is None


def test_robots_that_count_differently_are_named() -> None:
    skew = Skew({2: "r2", 3: "r3", 4: "r4"}, STEP_S)
    for k in range(10, 10 + REMEMBERED):
        skew.hear(k, [frame_of(2, k + 5), frame_of(3, k - 3), frame_of(4, k)])
    assert skew.ticks == {"r2": 5, "r3": -3, "r4": 0}
    said = present(skew.complaint())
    assert said.startswith("ticks differ: r2 is 5 ticks ahead, r3 is 3 ticks behind, so positions are refused")


def test_a_few_frames_say_nothing_and_late_ones_do_not_count() -> None:
    skew = Skew({2: "r2"}, STEP_S)
    for k in range(10, 10 + REMEMBERED - 1):
        skew.hear(k, [frame_of(2, k + 9)])
    assert skew.ticks == {}
    assert skew.complaint() is None
    held_up = Skew({2: "r2"}, STEP_S)
    for k in range(100, 100 + REMEMBERED):
        held_up.hear(k, [frame_of(2, k if k % 3 else k - 50)])
    assert held_up.ticks == {"r2": 0}
    forged = Skew({2: "r2"}, STEP_S)
    for k in range(100, 100 + REMEMBERED):
        forged.hear(k, [frame_of(2, k if k % 3 else k + 50)])
    assert forged.ticks == {"r2": 0}


def test_strangers_contacts_and_junk_say_nothing() -> None:
    skew = Skew({2: "r2"}, STEP_S)
    contact = encode(Position.of_contact(90, 45.0, 1.0, 2.0))
    for k in range(2 * REMEMBERED):
        skew.hear(k, [frame_of(7, k + 50), contact, b"junk", b""])
    assert skew.ticks == {}


def test_frames_that_have_waited_for_a_robot_that_skips_ticks_say_nothing_but_for_the_last() -> None:
    skew, missed = Skew({2: "r2"}, STEP_S), 20
    for k in range(0, 40 * missed, missed):
        assert not any(skew.hear(k, [frame_of(2, max(0, k - waited)) for waited in range(missed)[::-1]]))
    assert skew.ticks == {"r2": 0}
    assert skew.late == 0


@pytest.mark.parametrize("jump", [3, 1000])
def test_no_frame_is_late_after_the_own_clock_was_set(jump: int) -> None:
    skew = Skew({2: "r2"}, STEP_S)
    for k in range(100):
        skew.hear(k, [frame_of(2, k)])
    for k in range(100 + jump, 200 + jump):
        assert skew.hear(k, [frame_of(2, k - jump)]) == [False]
    assert skew.ticks == {"r2": -jump}


def test_leads_count_on_from_where_the_robot_itself_counts_on() -> None:
    skew = Skew({2: "r2", 3: "r3"}, STEP_S)
    for k in range(REMEMBERED):
        skew.hear(k, [frame_of(2, k + 100), frame_of(3, k + 40)])
    skew.advance(100)
    skew.hear(REMEMBERED + 100, [frame_of(2, REMEMBERED + 100), frame_of(3, REMEMBERED + 40)])
    assert skew.ticks == {"r2": 0, "r3": -60}
