"""A fleet's ticks counted by the robot itself."""

import pytest

from agent.robots.clock import KeptClock, epoch_of
from patrol.pose import Pose
from patrol.radio.message import Position, encode
from runtime.messages.phases import PHASE_B_SHARE

# Not the product's own, so that a wrong one there is noticed.
SAY_AGAIN_S = 10.0

STEP_S, EPOCH_S = 0.5, 1000.0


class Day:
    """A clock that only waiting moves, and the time at which to leave."""

    def __init__(self, now: float = EPOCH_S, ends: float = 1e9) -> None:
        self.now = now
        self.ends = ends
        self.said: list[str] = []
        self.clock = KeptClock(STEP_S, EPOCH_S, lambda: self.now, self.leave, self.said.append)

    def leave(self, seconds: float) -> bool:
        self.now = min(self.now + seconds, max(self.now, self.ends))
        return self.now >= self.ends


def frame(number: int, k: int) -> bytes:
    return encode(Position.of(number, k, STEP_S * k, Pose(1.0, 2.0, 0.0)))


def test_ticks_begin_by_the_shared_clock_one_after_the_other() -> None:
    day = Day(EPOCH_S - 3.0)
    for k in range(5):
        assert day.clock.tick() == k
        assert day.now == pytest.approx(EPOCH_S + STEP_S * k)
        assert day.clock.decide()
        assert day.now == pytest.approx(EPOCH_S + STEP_S * (k + PHASE_B_SHARE))


def test_who_comes_late_begins_with_the_tick_that_it_is() -> None:
    day = Day(EPOCH_S + 60.2)
    assert day.clock.tick() == 120
    day.now = EPOCH_S + 75.4
    assert day.clock.tick() == 150


def test_a_tick_never_comes_twice_even_when_the_clock_is_set_back() -> None:
    day = Day(EPOCH_S + 60.0)
    ticks = [day.clock.tick()]
    day.now -= 30.0
    ticks += [day.clock.tick(), day.clock.tick()]
    assert ticks == [120, 121, 122]
    assert day.now == pytest.approx(EPOCH_S + 61.0)


def test_a_clock_that_was_set_back_is_said_again_and_again_until_a_tick_comes() -> None:
    day = Day(EPOCH_S + 60.0)
    assert (day.clock.tick(), day.clock.why) == (120, "")
    day.now -= 600.0
    assert day.clock.tick() == 121
    waits = [float(line.split(" for ")[1].split(" s;")[0]) for line in day.said]
    assert waits == pytest.approx([600.5 - SAY_AGAIN_S * count for count in range(60)], abs=0.51)
    assert day.said[0] == "the clock was set back, so no tick comes for 600 s; set it right"
    assert day.clock.why == ""


def test_a_clock_that_is_set_right_again_is_noticed_before_the_time_has_passed() -> None:
    day = Day(EPOCH_S + 60.0)
    day.clock.tick()
    day.now -= 600.0
    day.ends = day.now + 3 * SAY_AGAIN_S
    assert day.clock.tick() is None
    day.now, day.ends = EPOCH_S + 65.0, 1e9
    assert day.clock.tick() == 130


def test_a_tick_that_is_over_is_too_late_to_decide_on() -> None:
    day = Day()
    assert day.clock.tick() == 0
    day.now += STEP_S
    assert not day.clock.decide()
    assert day.clock.tick() == 1
    assert day.clock.decide()


def test_who_is_to_leave_neither_waits_nor_decides() -> None:
    day = Day(ends=EPOCH_S + 0.55)
    assert day.clock.tick() == 0
    assert day.clock.decide()
    assert day.clock.tick() == 1
    assert not day.clock.decide()
    assert day.clock.tick() is None
    assert day.now == pytest.approx(EPOCH_S + 0.55)


def test_a_position_tells_when_tick_0_was() -> None:
    assert epoch_of(frame(2, 40), EPOCH_S + 20.0, STEP_S) == pytest.approx(EPOCH_S)
    assert epoch_of(encode(Position.of_contact(40, 20.0, 1.0, 2.0)), EPOCH_S, STEP_S) is None
    assert epoch_of(b"junk", EPOCH_S, STEP_S) is None


def test_long_ticks_are_no_clock_that_was_set_back() -> None:
    day = Day()
    clock = KeptClock(30.0, EPOCH_S, lambda: day.now, day.leave, day.said.append)
    for k in range(4):
        assert clock.tick() == k
    assert day.said == []
    day.now -= 2.0
    assert clock.tick() == 4
    assert day.said, "the clock was set back by more than a second"
