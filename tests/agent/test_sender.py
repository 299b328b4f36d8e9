"""Times and contents of a robot's frames, where its fleet saves on its radio."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from agent.sender import Sender, Sending
from patrol.exchange import Sensed
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.allowance import Share
from patrol.radio.message import CONTACT, decode
from patrol.radio.peers import Predictor

FIELD = Terrain("field", np.ones((40, 200), dtype=np.bool_), 1.0)
KEY = b"0123456789abcdef"
PLENTY = Share(per_tick=1e6, most=1e6, overhead=0, frame=64)
SCANT = Share(per_tick=100.0, most=400.0, overhead=0, frame=64)


def adaptive(trail: int = 2, every: int = 1, share: Share | None = None, silence: int = 8) -> Sending:
    return Sending(trail, every, share, 1.0, silence, Predictor(FIELD, every, silence))


def drive(sender: Sender, xs: Sequence[float], first: int = 0) -> dict[int, tuple[bytes, ...]]:
    """The frames along a way, by tick, without the ticks in which none is sent."""
    sent = {k: sender.frames(Sensed(k, Pose(x, 20.0, 0.0), clock_s=0.5 * k)) for k, x in enumerate(xs, start=first)}
    return {k: frames for k, frames in sent.items() if frames}


def test_without_savings_a_robot_sends_in_every_tick_with_its_whole_trail() -> None:
    xs = [10.0, 11.0, 13.0, 13.5, 14.0]
    pasts = [decode(frames[0]).past for frames in drive(Sender(1, Sending(2), None), xs).values()]
    assert pasts == [tuple((x, 20.0) for x in reversed(xs[max(0, k - 2) : k])) for k in range(5)]


def test_a_robot_that_is_where_the_others_think_sends_when_it_has_been_silent_for_long_enough() -> None:
    standing = drive(Sender(1, adaptive(), None), [10.0] * 20)
    assert list(standing) == [0, 8, 16]
    # Its first frame has no trail, so it seems to stand; from the second on they know how fast it is.
    driving = drive(Sender(1, adaptive(), None), [10.0 + 2.0 * k for k in range(20)])
    assert list(driving) == [0, 1, 9, 17]


def test_a_robot_that_turns_back_sends_when_the_prediction_is_off_by_more_than_the_error() -> None:
    there = [10.0 + 0.4 * k for k in range(9)]
    back = [there[-1] - 0.4 * k for k in range(1, 9)]
    sent = drive(Sender(1, adaptive(silence=100), None), [*there, *back])
    # The standing prediction of tick 0 is off by 1.2 m in tick 3, that of tick 3 by 1.6 m in tick 10, and so on.
    assert list(sent) == [0, 3, 10]


def test_a_trail_reaches_back_to_the_last_frame_and_has_a_step_at_least() -> None:
    xs = [10.0 + 2.0 * k for k in range(40)]
    sent = drive(Sender(1, adaptive(trail=4, every=2), None), xs)
    positions = [decode(frames[0]) for frames in sent.values()]
    assert [position.sequence for position in positions] == [0, 1, 2, 10, 18, 26, 34]
    assert [len(position.trail) for position in positions] == [0, 0, 1, 3, 3, 3, 3]
    for position in positions:
        assert [x for x, _ in position.past] == [xs[position.sequence - 2 * n - 2] for n in range(len(position.trail))]
    for before, after in pairwise(positions[2:]):
        told = {after.sequence - 2 * n for n in range(len(after.trail) + 1)} | {before.sequence}
        assert told == set(range(before.sequence, after.sequence + 1, 2)), "every second look is told"


def test_a_budget_holds_frames_back_and_longer_silence_makes_longer_trails() -> None:
    share = Share(per_tick=60.0, most=500.0, overhead=8, frame=64)
    sent = drive(Sender(1, Sending(4, 2, share), None), [10.0 + 2.0 * k for k in range(60)])
    bits = {k: 8 * (len(frames[0]) + 8) for k, frames in sent.items()}
    assert all(sum(cost for at, cost in bits.items() if at <= k) <= 60.0 * k for k in bits)
    assert sum(bits.values()) > 60.0 * 59 - 500.0, "and no more than they must be"
    assert all(len(frames) == 1 for frames in sent.values())


def test_a_trail_is_cut_to_the_longest_frame() -> None:
    share = Share(per_tick=1e6, most=1e6, overhead=0, frame=40)
    sender = Sender(1, Sending(4, 1, share), KEY)
    drive(sender, [10.0])
    sent = drive(sender, [10.0 + 1.5 * k for k in range(1, 12)], first=1)
    assert max(len(frames[0]) for frames in sent.values()) <= 40
    assert {len(decode(frames[0], KEY).trail) for frames in sent.values()} == {1}


def test_a_tick_that_was_skipped_empties_the_trail_and_not_the_budget() -> None:
    share = Share(per_tick=60.0, most=500.0, overhead=0, frame=64)
    for sending in (Sending(4, 1, share), Sending(4)):
        sender = Sender(1, sending, None)
        drive(sender, [10.0, 12.0])
        first, second = drive(sender, [30.0, 31.0], first=50).values()
        assert decode(first[0]).trail == ()
        assert decode(second[0]).past == ((30.0, 20.0),)


def seeing(sender: Sender, k: int, contacts: Sequence[tuple[float, float]]) -> tuple[bytes, ...]:
    """The frames of a robot that stands and sees intruders."""
    return sender.frames(Sensed(k, Pose(10.0, 20.0, 0.0), contacts=tuple(contacts), clock_s=0.5 * k))


def test_what_is_new_about_intruders_is_sent_at_once_with_the_position_first() -> None:
    sender, a, b = Sender(1, adaptive(), None), (5.0, 6.0), (7.0, 8.0)
    sent = [seeing(sender, k, contacts) for k, contacts in enumerate([(), (), (a,), (a,), (a, b), ()])]
    robots = [[decode(frame).robot for frame in frames] for frames in sent]
    assert robots == [[1], [], [1, CONTACT], [], [1, CONTACT, CONTACT], [1]]


def test_contacts_that_the_budget_does_not_hold_are_left_out() -> None:
    sender = Sender(1, Sending(0, 1, SCANT), None)
    sent = [seeing(sender, k, [(float(n), 6.0) for n in range(4)]) for k in range(20)]
    robots = [[decode(frame).robot for frame in frames] for frames in sent if frames]
    assert all(numbers[0] == 1 for numbers in robots)
    assert len(robots) == 4
    assert all(1 < len(numbers) < 5 for numbers in robots), "the position waits until some of them fit, but not all"


@pytest.mark.parametrize("move", [0.0, 0.25], ids=["stand", "move"])
def test_intruders_that_the_budget_cuts_are_reported_in_turn(move: float) -> None:
    sender = Sender(1, adaptive(0, share=SCANT, silence=50), None)
    told: list[float] = []
    for k in range(40):
        frames = seeing(sender, k, [(10.0 * n + move * (k % 8), 6.0) for n in range(1, 5)])
        told += [decode(frame).pose.x for frame in frames if decode(frame).robot == CONTACT]
    assert {int(x / 10.0) for x in told[:6]} == {1, 2, 3, 4}
    if move == 0.0:
        assert sorted(told) == [10.0, 20.0, 30.0, 40.0], "each once, while the others' prediction holds"


def test_a_budget_that_holds_everything_changes_nothing() -> None:
    xs = [10.0 + 0.7 * k for k in range(30)]
    assert list(drive(Sender(1, Sending(0, 1, PLENTY), None), xs)) == list(range(1, 30))
