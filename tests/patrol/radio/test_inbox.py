from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Intake, Rules
from patrol.radio.message import SPAN, Position, RejectReason, encode
from patrol.radio.peers import places_of, ticks_of

SPEED = 4.0
STEP = 0.5
BOUNDS = (0.0, 0.0, 100.0, 88.0)
KEY = b"fleet"


class Box:
    """Listener 1 of robots 1 to 5, frame by frame; times are its own, in s."""

    def __init__(self, **rules: Any) -> None:
        self.rules = Rules(**{"roster": (1, 2, 3, 4, 5), "bounds": BOUNDS, "speed": SPEED, "step": STEP, **rules})
        self.inboxes = Inboxes([1], self.rules)

    def take(self, data: bytes, now_s: float) -> Intake:
        tick = round(now_s / self.rules.step)
        assert math.isclose(tick * self.rules.step, now_s)
        return self.inboxes.hear(tick, {1: [data]})

    def accept(self, data: bytes, now_s: float) -> Position | None:
        return next(iter(self.take(data, now_s).positions(1)), None)

    def last(self, robot: int) -> tuple[int, float] | None:
        """Sequence and time of the newest frame."""
        peer = self.inboxes.peers(1).get(robot)
        return None if peer is None else (peer.sequence, peer.tick * self.rules.step)

    @property
    def rejected(self) -> int:
        return self.inboxes.rejected(1)


def inbox(key: bytes | None = None, ahead: int | None = 0) -> Box:
    return Box(key=key, ahead=ahead)


def frame(sequence: int, x: float, y: float = 40.0, robot: int = 2, key: bytes | None = None) -> bytes:
    return encode(Position.of(robot, sequence, sequence * STEP, Pose(x, y, 0.0)), key)


def reasons(box: Box) -> dict[RejectReason, int]:
    return {reason: count for reason, count in box.inboxes.counts(1).items() if count}


def test_a_robot_at_full_speed_is_believed() -> None:
    box = inbox()
    believed = [box.accept(frame(k, 10.0 + SPEED * STEP * k), k * STEP) for k in range(40)]
    assert [position and (position.robot, position.sequence) for position in believed] == [(2, k) for k in range(40)]
    assert box.rejected == 0
    assert box.last(2) == (39, 39 * STEP)
    assert box.last(3) is None


@given(st.lists(st.tuples(st.floats(-math.pi, math.pi), st.floats(0.0, 1.0)), min_size=1, max_size=30))
def test_rounding_never_makes_an_honest_robot_too_fast(moves: list[tuple[float, float]]) -> None:
    box = inbox()
    x, y = 50.0, 44.0
    for k, (heading, share) in enumerate(moves):
        x = min(max(x + SPEED * STEP * share * math.cos(heading), 0.0), 100.0)
        y = min(max(y + SPEED * STEP * share * math.sin(heading), 0.0), 88.0)
        # Arrives together with the one before, or a step late.
        box.accept(frame(k, x, y), (k + k % 2) * STEP)
    assert box.rejected == 0


def test_a_step_early_and_rounded_apart_a_robot_is_still_believed() -> None:
    """2.006 m in one step: sent as 10.00 and 12.01 m, and arriving at once."""
    box = Box(roster=(2,), speed=4.012)
    assert box.accept(frame(0, 10.004), 0.5) is not None
    assert box.accept(frame(1, 12.010), 0.5) is not None


def test_what_cannot_be_decoded_is_counted_by_reason() -> None:
    box = inbox(KEY)
    assert box.accept(b"rubbish", 0.0) is None
    assert box.accept(b"x" * 1000, 0.0) is None
    assert box.accept(bytes([0x97, 9, 1, 2, 3, 4, 5, 6]), 0.0) is None
    assert box.accept(frame(0, 10.0), 0.0) is None
    assert box.accept(frame(0, 10.0, key=b"other"), 0.0) is None
    assert reasons(box) == {RejectReason.MALFORMED: 2, RejectReason.VERSION: 1, RejectReason.TAG: 2}
    assert box.accept(frame(0, 10.0, key=KEY), 0.0) is not None


@pytest.mark.parametrize(("robot", "reason"), [(1, "own"), (6, "unknown"), (65535, "unknown")])
def test_only_other_robots_of_the_roster_are_heard(robot: int, reason: str) -> None:
    box = inbox()
    assert box.accept(frame(0, 10.0, robot=robot), 0.0) is None
    assert reasons(box) == {RejectReason(reason): 1}


def test_a_frame_is_believed_once() -> None:
    box = inbox()
    assert box.accept(frame(5, 10.0), 2.5) is not None
    for sequence in (5, 4, 0):
        assert (box.accept(frame(sequence, 10.0), 3.0) is None) == (sequence == 5)
        assert box.accept(frame(sequence, 10.0), 3.0) is None
    assert reasons(box) == {RejectReason.OLD: 4}
    assert box.accept(frame(6, 10.0), 3.0) is not None


def test_a_late_frame_is_believed_within_the_window_and_moves_nobody() -> None:
    box = inbox()
    assert box.accept(frame(100, 50.0), 50.0) is not None
    assert box.accept(frame(101 - SPAN, 48.0), 50.5) is not None
    assert box.accept(frame(100 - SPAN, 48.0), 50.5) is None
    assert reasons(box) == {RejectReason.OLD: 1}
    assert box.last(2) == (100, 50.0)


def test_a_late_frame_must_lead_to_the_newest_one() -> None:
    """Three steps and one to spare of 2 m each, whenever it arrives."""
    box = inbox()
    assert box.accept(frame(10, 50.0), 5.0) is not None
    assert box.accept(frame(7, 41.9), 60.0) is None
    assert box.accept(frame(7, 42.0), 60.0) is not None
    assert reasons(box) == {RejectReason.TOO_FAST: 1}


def test_the_window_outlives_a_restart_of_the_sender() -> None:
    """Its sequences go on by time; what the first process sent cannot be sent again under the second."""
    box = inbox(KEY)
    first = [frame(k, 10.0, key=KEY) for k in range(80, 100)]
    second = [frame(k, 10.0, key=KEY) for k in range(120, 130)]
    for k, data in [*zip(range(80, 100), first, strict=True), *zip(range(120, 130), second, strict=True)]:
        assert box.accept(data, k * STEP) is not None
    assert [box.accept(data, 65.0) for data in (*first, *second)] == [None] * 30
    assert reasons(box) == {RejectReason.OLD: 30}


@given(st.permutations(range(40)), st.lists(st.integers(0, 39), max_size=40))
def test_whatever_the_order_each_frame_is_believed_once(order: list[int], repeated: list[int]) -> None:
    """The receiver's clock stands still; 40 frames are fewer than the window holds and than may come at once."""
    box = inbox()
    heard = [box.accept(frame(k, 50.0), 39 * STEP) for k in (*order, *repeated)]
    assert [position is not None for position in heard] == [*([True] * 40), *([False] * len(repeated))]


@given(st.lists(st.integers(0, 12), min_size=30, max_size=30), st.integers(0, 2**32 - 100), st.booleans())
def test_delays_never_make_an_honest_robot_too_fast(delays: list[int], start: int, knows_ticks: bool) -> None:
    """At full speed; the first frame is the quickest, and frames overtake each other."""
    box = inbox(ahead=0 if knows_ticks else None)
    began = start if knows_ticks else 0
    arrivals = sorted((k + (delays[k] if k else 0), k) for k in range(30))
    for arrival, k in arrivals:
        position = Position.of(2, start + k, k * STEP, Pose(10.0 + SPEED * STEP * k, 40.0, 0.0))
        assert box.accept(encode(position), (began + arrival) * STEP) is not None
    assert box.rejected == 0


def test_a_claimed_delay_buys_no_speed() -> None:
    """Without one of its own frames having been late, a robot cannot be where only a late one could."""
    box = inbox(ahead=None)
    for k in range(10):
        assert box.accept(frame(k, 10.0), k * STEP) is not None
    assert box.accept(frame(20, 32.0), 10 * STEP) is None
    assert reasons(box) == {RejectReason.TOO_FAST: 1}


def test_a_trail_ends_where_nobody_can_have_driven() -> None:
    box = inbox()
    trail = ((-200, 0), (-203, 0), (-100, 0))
    position = box.accept(encode(Position.of(2, 9, 4.5, Pose(50.0, 40.0, 0.0), trail)), 4.5)
    assert position is not None
    assert position.trail == ((-200, 0),)


def test_each_sender_has_a_sequence_of_its_own() -> None:
    box = inbox()
    assert box.accept(frame(5, 10.0, robot=2), 2.5) is not None
    assert box.accept(frame(3, 90.0, robot=3), 2.5) is not None
    assert box.accept(frame(4, 90.0, robot=3), 2.5) is not None


@pytest.mark.parametrize(("x", "y"), [(-0.1, 40.0), (100.1, 40.0), (50.0, -0.1), (50.0, 88.1), (1e6, 1e6)])
def test_off_the_terrain_nobody_is(x: float, y: float) -> None:
    box = inbox()
    assert box.accept(frame(0, x, y), 0.0) is None
    assert reasons(box) == {RejectReason.OUTSIDE: 1}


def test_on_the_edge_of_the_terrain_one_may_be() -> None:
    box = inbox()
    assert box.accept(frame(0, 100.0, 88.0), 0.0) is not None
    assert box.accept(frame(0, -0.004, 0.0, robot=3), 0.0) is not None


def test_nobodys_trail_leaves_the_terrain() -> None:
    box = inbox()
    assert box.accept(encode(Position.of(2, 0, 0.0, Pose(1.0, 1.0, 0.0), ((-50, 0), (-60, 0)))), 0.0) is None
    assert reasons(box) == {RejectReason.OUTSIDE: 1}


def test_a_jump_is_believed_once_three_frames_in_a_row_agree() -> None:
    box = inbox()
    assert box.accept(frame(0, 10.0), 0.0) is not None
    assert box.accept(frame(1, 60.0), 0.5) is None
    assert box.accept(frame(2, 61.0), 1.0) is None
    assert box.accept(frame(3, 62.0), 1.5) is not None
    assert box.accept(frame(4, 63.0), 2.0) is not None
    assert reasons(box) == {RejectReason.TOO_FAST: 2}


def test_a_jump_back_and_forth_is_not_believed() -> None:
    box = inbox()
    assert box.accept(frame(0, 10.0), 0.0) is not None
    for k in range(1, 9):
        assert box.accept(frame(k, 90.0 if k % 2 else 60.0), k * STEP) is None
    assert reasons(box) == {RejectReason.TOO_FAST: 8}


def test_honest_frames_between_jumps_start_the_count_anew() -> None:
    box = inbox()
    assert box.accept(frame(0, 10.0), 0.0) is not None
    for k in range(1, 13):
        honest = k % 3 == 0
        believed = box.accept(frame(k, 10.0 if honest else 90.0), k * STEP)
        assert (believed is not None) == honest


def test_a_frame_repeated_does_not_make_a_jump_steady() -> None:
    box = inbox()
    assert box.accept(frame(0, 10.0), 0.0) is not None
    for _ in range(5):
        assert box.accept(frame(1, 60.0), 0.5) is None


def test_after_a_silence_a_robot_may_be_anywhere_it_could_have_reached() -> None:
    box = inbox()
    assert box.accept(frame(0, 10.0), 0.0) is not None
    assert box.accept(frame(40, 95.0), 20.0) is None
    assert box.accept(frame(44, 95.0), 22.0) is not None
    assert reasons(box) == {RejectReason.TOO_FAST: 1}


def test_speed_is_judged_by_the_receivers_clock() -> None:
    """A sender's clock that runs an hour ahead, or claims that an hour has passed, changes nothing."""
    box = inbox()
    for k in range(10):
        ahead = Position.of(2, k, 3600.0 + k * STEP, Pose(10.0 + k, 40.0, 0.0))
        assert box.accept(encode(ahead), k * STEP) is not None
    leap = Position.of(2, 10, 7200.0, Pose(80.0, 40.0, 0.0))
    assert box.accept(encode(leap), 10 * STEP) is None
    assert reasons(box) == {RejectReason.TOO_FAST: 1}


KEYS = pytest.mark.parametrize("key", [None, KEY])
"""With a key the frames are those of an earlier, longer run, sent again."""


@KEYS
@pytest.mark.parametrize("heard", [0, 100])
def test_frames_of_ticks_to_come_never_shut_their_sender_out(key: bytes | None, heard: int) -> None:
    """Whether they come before its first frame or later, at its own place, alone or one after the other."""
    box = inbox(key)
    for k in range(heard):
        assert box.accept(frame(k, 50.0, key=key), k * STEP) is not None
    for later in (1, 64, 9000, 9001, 9002, 10**6, 10**6 + 1, 10**6 + 2, 8 * 10**6):
        assert box.accept(frame(heard + later, 50.0, key=key), heard * STEP) is None
    assert reasons(box) == {RejectReason.AHEAD: 9}
    for k in range(heard, heard + 200):
        assert box.accept(frame(k, 50.0, key=key), k * STEP) is not None
        assert box.last(2) == (k, k * STEP)


@pytest.mark.parametrize("step", [0.1, 0.3, 0.5, 1.0 / 3.0, 1e-3])
def test_a_frame_of_the_receivers_own_tick_is_never_ahead(step: float) -> None:
    box = Box(roster=(2,), step=step)
    for k in (0, 1, 3, 7, 10**6 + 1, 8 * 10**6):
        assert box.accept(frame(k + 1, 10.0), k * step) is None
        assert box.accept(frame(k, 10.0), k * step) is not None


def test_at_a_pace_a_frame_a_few_ticks_ahead_makes_as_many_late_and_no_more() -> None:
    box = inbox(ahead=4)
    for k in range(100):
        assert box.accept(frame(k, 50.0), k * STEP) is not None
    assert box.accept(frame(105, 50.0), 100 * STEP) is None
    assert box.accept(frame(104, 50.0), 100 * STEP) is not None
    believed = [box.accept(frame(k, 50.0), k * STEP) for k in range(100, 120)]
    assert [k for k, position in enumerate(believed, 100) if position is None] == [104]
    assert box.last(2) == (119, 119 * STEP)


def test_a_frame_held_up_for_minutes_shuts_nobody_out() -> None:
    box = inbox()
    assert box.accept(frame(5, 50.0), 500 * STEP) is not None
    assert box.accept(frame(500, 50.0), 500 * STEP) is not None
    assert box.rejected == 0


def test_who_knows_no_ticks_hears_a_sender_again_after_three_frames() -> None:
    """One frame before the first, or three in a row later, with sequences that nobody has come to yet."""
    first = inbox(ahead=None)
    assert first.accept(frame(10**6, 50.0), 0.0) is not None
    later = inbox(ahead=None)
    for k in range(100):
        assert later.accept(frame(k, 50.0), k * STEP) is not None
    assert [later.accept(frame(10**6 + i, 50.0), 50.0) is not None for i in range(3)] == [False, False, True]
    for box in (first, later):
        believed = [box.accept(frame(k, 50.0), k * STEP) is not None for k in range(100, 120)]
        assert believed == [False] * 2 + [True] * 18
        assert box.accept(frame(110, 50.0), 60.0) is None


def test_who_knows_no_ticks_refuses_a_single_sequence_that_runs_away() -> None:
    box = inbox(ahead=None)
    assert box.accept(frame(0, 10.0), 0.0) is not None
    assert box.accept(frame(8 * 10**6, 10.0), 0.5) is None
    assert reasons(box) == {RejectReason.AHEAD: 1}
    assert box.accept(frame(2, 11.0), 1.0) is not None


def test_a_stalled_network_that_catches_up_is_believed() -> None:
    """Ten seconds of frames at once: each follows the one before by no more than a step."""
    box = inbox()
    for k in range(10):
        assert box.accept(frame(k, 10.0 + 2.0 * k), k * STEP) is not None
    for k in range(10, 30):
        assert box.accept(frame(k, 10.0 + 2.0 * k), 15.0) is not None
    assert box.rejected == 0


def test_a_restarted_sender_is_heard_at_once() -> None:
    box = inbox()
    assert box.accept(frame(100, 10.0), 50.0) is not None
    assert box.accept(frame(140, 10.0), 70.0) is not None
    assert box.rejected == 0


@given(st.lists(st.binary(max_size=70), max_size=30))
def test_hostile_bytes_are_only_ever_counted(frames: list[bytes]) -> None:
    box = inbox()
    believed = [box.accept(data, float(k)) for k, data in enumerate(frames)]
    assert sum(position is not None for position in believed) + box.rejected == len(frames)


def contact(sequence: int, x: float, y: float = 40.0, key: bytes | None = None) -> bytes:
    return encode(Position.of_contact(sequence, sequence * STEP, x, y), key)


def test_contacts_of_robots_that_are_heard_are_believed_from_everyone_and_anywhere() -> None:
    box = inbox()
    assert box.accept(frame(4, 10.0), 2.0) is not None
    found = [box.accept(contact(4, x), 2.0) for x in (90.0, 90.0, 5.0)]  # of two robots, and a second intruder far off
    assert [position and (position.robot, position.pose.x) for position in found] == [(0, 90.0), (0, 90.0), (0, 5.0)]
    assert box.accept(contact(6, 70.0), 3.0) is not None  # the reporter's own frame was lost
    assert box.rejected == 0
    assert box.last(0) is None


def test_a_contact_before_anybody_was_heard_is_refused() -> None:
    box = inbox()
    assert box.accept(contact(0, 10.0), 0.0) is None
    assert reasons(box) == {RejectReason.UNKNOWN: 1}


def test_contacts_that_cannot_be_are_refused_and_counted() -> None:
    box = inbox(KEY)
    assert box.accept(frame(100, 10.0, key=KEY), 50.0) is not None
    assert box.accept(contact(100, 101.0, key=KEY), 50.0) is None
    assert box.accept(contact(100, 10.0, -5.0, key=KEY), 50.0) is None
    assert box.accept(contact(100, 10.0), 50.0) is None
    assert box.accept(contact(100, 10.0, key=b"other"), 50.0) is None
    assert box.accept(contact(100, 10.0, key=KEY)[:-1], 50.0) is None
    assert reasons(box) == {RejectReason.OUTSIDE: 2, RejectReason.TAG: 2, RejectReason.MALFORMED: 1}


def test_replayed_contacts_and_those_from_the_future_are_refused_and_poison_nothing() -> None:
    box = inbox()
    for k in range(40):
        assert box.accept(frame(k, 10.0), k * STEP) is not None
    replayed = contact(20, 30.0)
    assert box.accept(replayed, 39 * STEP) is None
    assert box.accept(contact(2**32 // 500 - 1, 30.0), 39 * STEP) is None
    assert box.accept(contact(39, 30.0), 39 * STEP) is not None
    assert reasons(box) == {RejectReason.OLD: 1, RejectReason.AHEAD: 1}


def test_a_contact_touches_nobodys_position() -> None:
    box = inbox()
    assert box.accept(frame(4, 10.0), 2.0) is not None
    assert box.accept(contact(4, 90.0), 2.0) is not None
    assert box.accept(frame(5, 11.0), 2.5) is not None
    assert box.rejected == 0


def trailing(k: int, x: float, *trail: tuple[int, int]) -> bytes:
    return encode(Position.of(2, k, STEP * k, Pose(x, 40.0, 0.0), trail))


def looks(intake: Intake) -> list[tuple[int, float, float]]:
    return [(tick, pose.x, pose.y) for tick, pose in intake.looks(1)]


def test_the_places_of_a_trail_are_as_many_ticks_apart_as_the_fleet_says() -> None:
    intake = Box(trail_every=3).take(trailing(20, 50.0, (-600, 0), (-500, 100)), 10.0)
    assert looks(intake) == [(20, 50.0, 40.0), (17, 44.0, 40.0), (14, 39.0, 41.0)]


def test_a_look_counts_once_also_where_trails_overlap_out_of_step() -> None:
    box = Box(trail_every=3)
    assert [look[0] for look in looks(box.take(trailing(20, 50.0, (-600, 0)), 10.0))] == [20, 17]
    assert [look[0] for look in looks(box.take(trailing(22, 52.0, (-600, 0), (-600, 0)), 11.0))] == [22, 19, 16]
    assert [look[0] for look in looks(box.take(trailing(23, 53.0, (-600, 0), (-600, 0)), 11.5))] == [23]
    assert looks(box.take(trailing(23, 53.0), 11.5)) == []


def test_what_was_said_last_is_kept_and_a_late_frame_does_not_replace_it() -> None:
    box = Box()
    assert box.accept(trailing(20, 50.0, (-100, 3), (-100, 0)), 10.0) is not None
    late = box.take(trailing(18, 48.0), 10.5)
    assert looks(late) == []  # the trail has told of it
    said = box.inboxes.peers(1).said(2)
    assert (said.sequence, said.pose, said.trail) == (20, Pose(50.0, 40.0, 0.0), ((-100, 3),))


def test_a_step_of_a_trail_may_be_as_long_as_its_ticks() -> None:
    frames = [trailing(k, 50.0 + k, (-590, 0), (-620, 0)) for k in (20, 24)]
    for every, left in ((1, 0), (3, 1), (4, 2)):
        box = Box(trail_every=every)
        found = [box.accept(data, STEP * k) for data, k in zip(frames, (20, 24), strict=True)]
        assert [position and len(position.trail) for position in found] == [left, left]


def test_whoever_listens_no_more_has_forgotten_all_and_nobody_else_has() -> None:
    inboxes = Inboxes([1, 3], Rules((1, 2, 3), BOUNDS, SPEED))
    inboxes.hear(0, {number: [frame(0, 10.0), frame(0, 10.0)] for number in (1, 3)})
    inboxes.clear(1)
    assert (dict(inboxes.peers(1)), inboxes.rejected(1)) == ({}, 0)
    assert (list(inboxes.peers(3)), inboxes.rejected(3)) == ([2], 1)
    assert inboxes.hear(1, {1: [frame(0, 10.0)]}).looks(1) == [(1, Pose(10.0, 40.0, 0.0))]


@pytest.mark.parametrize(("since", "expected"), [(0, [3, 4]), (1, [4]), (2, [])])
def test_peers_are_those_heard_since_a_tick_with_their_places(since: int, expected: list[int]) -> None:
    box = Box()
    for tick, robot, x in ((0, 3, 3.25), (1, 4, 40.5)):
        assert box.accept(frame(tick, x, 10.0 + x / 4.0, robot=robot), tick * STEP) is not None
    peers = box.inboxes.peers(1, since)
    assert list(peers) == expected
    assert places_of(peers).tolist() == [[peer.pose.x, peer.pose.y] for peer in peers.values()]
    assert ticks_of(peers).tolist() == ticks_of(dict(peers)).tolist() == [peer.tick for peer in peers.values()]
    assert [robot in peers for robot in (2, 3, 4, 9)] == [robot in expected for robot in (2, 3, 4, 9)]
    assert list(box.inboxes.peers(1).silent(1)) == [3]
    assert box.inboxes.peers(1).oldest(7) == 0
    assert box.inboxes.peers(1).lately(2).oldest(7) == 7
