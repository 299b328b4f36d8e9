"""How far apart robots count, and which positions are late."""

from __future__ import annotations

from agent.robots.direct import APART, REMEMBERED, Skew
from patrol.pose import Pose
from patrol.radio.message import Position, encode

STEP_S = 0.5


def frame(number: int, k: int) -> bytes:
    return encode(Position.of(number, k, STEP_S * k, Pose(1.0, 2.0, 0.0)))


def test_robots_that_count_alike_give_no_cause_for_a_word() -> None:
    skew = Skew({2: "r2", 3: "r3"}, STEP_S)
    for k in range(20):
        skew.hear(k, [frame(2, k), frame(3, max(0, k - APART))])
    assert skew.ticks == {"r2": 0, "r3": -APART}
    assert skew.complaint() is None


def test_robots_that_count_differently_are_named() -> None:
    skew = Skew({2: "r2", 3: "r3", 4: "r4"}, STEP_S)
    for k in range(10, 10 + REMEMBERED):
        skew.hear(k, [frame(2, k + 5), frame(3, k - 3), frame(4, k)])
    assert skew.ticks == {"r2": 5, "r3": -3, "r4": 0}
    said = skew.complaint()
    assert said is not None
    assert said.startswith("ticks differ: r2 is 5 ticks ahead, r3 is 3 ticks behind, so positions are refused")


def test_a_few_frames_say_nothing_and_late_ones_do_not_count() -> None:
    skew = Skew({2: "r2"}, STEP_S)
    for k in range(10, 10 + REMEMBERED - 1):
        skew.hear(k, [frame(2, k + 9)])
    assert skew.ticks == {}
    assert skew.complaint() is None
    held_up = Skew({2: "r2"}, STEP_S)
    for k in range(100, 100 + REMEMBERED):
        held_up.hear(k, [frame(2, k if k % 3 else k - 50)])
    assert held_up.ticks == {"r2": 0}


def test_strangers_contacts_and_junk_say_nothing() -> None:
    skew = Skew({2: "r2"}, STEP_S)
    contact = encode(Position.of_contact(90, 45.0, 1.0, 2.0))
    for k in range(2 * REMEMBERED):
        skew.hear(k, [frame(7, k + 50), contact, b"junk", b""])
    assert skew.ticks == {}
