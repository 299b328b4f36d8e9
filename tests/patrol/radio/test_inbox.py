import math
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Intake, Rules
from patrol.radio.message import SPAN, Position, RejectReason, encode
from patrol.radio.peers import columns_of, places_of

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


def verdicts(box: Box, *frames: tuple[bytes, float]) -> str:
    """Give each frame to a box at its time; return + for each that is believed, - for the others."""
    return "".join("-" if box.accept(data, now_s) is None else "+" for data, now_s in frames)


def standing(ks: range, x: float = 50.0, key: bytes | None = None) -> Iterator[tuple[bytes, float]]:
    """Frames of a robot that stands, each in its tick."""
    return ((frame(k, x, key=key), k * STEP) for k in ks)


def test_a_step_early_and_rounded_apart_a_robot_is_still_believed() -> None:
    """2.006 m in one step: sent as 10.00 and 12.01 m, and arriving at once."""
    assert verdicts(Box(roster=(2,), speed=4.012), (frame(0, 10.004), 0.5), (frame(1, 12.010), 0.5)) == "++"


def test_what_cannot_be_decoded_is_counted_by_reason() -> None:
    box = inbox(KEY)
    bad = (b"rubbish", b"x" * 1000, bytes([0x97, 9, 1, 2, 3, 4, 5, 6]), frame(0, 10.0), frame(0, 10.0, key=b"other"))
    assert verdicts(box, *((data, 0.0) for data in (*bad, frame(0, 10.0, key=KEY)))) == "-----+"
    assert reasons(box) == {RejectReason.MALFORMED: 2, RejectReason.VERSION: 1, RejectReason.TAG: 2}


@pytest.mark.parametrize(("robot", "reason"), [(1, "own"), (6, "unknown"), (65535, "unknown")])
def test_only_other_robots_of_the_roster_are_heard(robot: int, reason: str) -> None:
    box = inbox()
    assert verdicts(box, (frame(0, 10.0, robot=robot), 0.0)) == "-"
    assert reasons(box) == {RejectReason(reason): 1}


def test_a_frame_is_believed_once() -> None:
    box = inbox()
    assert verdicts(box, (frame(5, 10.0), 2.5)) == "+"
    assert verdicts(box, *((frame(sequence, 10.0), 3.0) for sequence in (5, 5, 4, 4, 0, 0, 6))) == "--+-+-+"
    assert reasons(box) == {RejectReason.OLD: 4}


def test_a_late_frame_is_believed_within_the_window_if_it_leads_to_the_newest_one() -> None:
    box = inbox()
    late = (frame(101 - SPAN, 48.0), 50.5), (frame(100 - SPAN, 48.0), 50.5)
    assert verdicts(box, (frame(100, 50.0), 50.0), *late) == "++-"
    assert reasons(box) == {RejectReason.OLD: 1}
    assert box.last(2) == (100, 50.0)
    box = inbox()  # three steps and one to spare of 2 m each, whenever it arrives
    assert verdicts(box, (frame(10, 50.0), 5.0), (frame(7, 41.9), 60.0), (frame(7, 42.0), 60.0)) == "+-+"
    assert reasons(box) == {RejectReason.TOO_FAST: 1}


def test_a_frame_is_a_repetition_until_the_window_has_passed_it() -> None:
    for later in (1, SPAN - 1, SPAN):
        box = inbox()
        first, newest = frame(100, 50.0), frame(100 + later, 50.0)
        at = (100 + later) * STEP
        assert verdicts(box, (first, 50.0), (newest, at), (first, at), (newest, at)) == "++--", later
        assert reasons(box) == {RejectReason.OLD: 2}


@pytest.mark.parametrize(("steps", "believed"), [(66, "++"), (67, "+-")])
def test_without_ticks_a_frame_may_lead_by_twice_the_time_and_a_window(steps: int, believed: str) -> None:
    assert verdicts(inbox(ahead=None), (frame(0, 10.0), 0.0), (frame(steps, 10.0), STEP)) == believed


def test_the_window_holds_64_sequences() -> None:
    """A frame that came once within it comes late and again; one sequence further back is too old for both."""
    for ago, verdict in ((62, "++-"), (63, "++-"), (64, "+--"), (65, "+--")):
        late = (frame(100 - ago, 50.0), 50.0)
        assert verdicts(inbox(), (frame(100, 50.0), 50.0), late, late) == verdict, ago
    for newer in (62, 63, 64, 65):  # a frame so much newer moves the window on, and what was in it is not lost
        first = (frame(100, 50.0), 50.0)
        come = (frame(100 + newer, 50.0), 50.0 + STEP * newer)
        assert verdicts(inbox(), first, come, (first[0], come[1])) == "++-", newer
        assert verdicts(inbox(), first, come, (frame(101, 50.0), come[1])) == ("+++" if newer < 65 else "++-"), newer


def test_the_window_outlives_a_restart_of_the_sender() -> None:
    """Its sequences go on by time; what the first process sent cannot be sent again under the second."""
    box = inbox(KEY)
    sent = [*standing(range(80, 100), key=KEY), *standing(range(120, 130), key=KEY)]
    assert verdicts(box, *sent) == "+" * 30
    assert verdicts(box, *((data, 65.0) for data, _ in sent)) == "-" * 30
    assert reasons(box) == {RejectReason.OLD: 30}


@given(st.permutations(range(40)), st.lists(st.integers(0, 39), max_size=40))
def test_whatever_the_order_each_frame_is_believed_once(order: list[int], repeated: list[int]) -> None:
    """The receiver's clock stands still; 40 frames are fewer than the window holds and than may come at once."""
    frames = [(frame(k, 50.0), 39 * STEP) for k in (*order, *repeated)]
    assert verdicts(inbox(), *frames) == "+" * 40 + "-" * len(repeated)


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
    assert verdicts(box, *standing(range(10), 10.0), (frame(20, 32.0), 10 * STEP)) == "+" * 10 + "-"
    assert reasons(box) == {RejectReason.TOO_FAST: 1}


def test_a_trail_ends_where_nobody_can_have_driven() -> None:
    box = inbox()
    trail = ((-200, 0), (-203, 0), (-100, 0))
    position = box.accept(encode(Position.of(2, 9, 4.5, Pose(50.0, 40.0, 0.0), trail)), 4.5)
    assert position is not None
    assert position.trail == ((-200, 0),)


def test_off_the_terrain_nobody_is() -> None:
    box = inbox()
    places = [(-0.1, 40.0), (100.1, 40.0), (50.0, -0.1), (50.0, 88.1), (1e6, 1e6)]
    trail = Position.of(2, 0, 0.0, Pose(1.0, 1.0, 0.0), ((-50, 0), (-60, 0)))
    assert verdicts(box, *((frame(0, x, y), 0.0) for x, y in places), (encode(trail), 0.0)) == "------"
    assert reasons(box) == {RejectReason.OUTSIDE: 6}
    edges = frame(0, 100.0, 88.0), frame(0, -0.004, 0.0, robot=3)
    assert verdicts(box, *((edge, 0.0) for edge in edges)) == "++"


@pytest.mark.parametrize(
    ("places", "believed"),
    [
        ([(0, 10.0), (1, 60.0), (2, 61.0), (3, 62.0), (4, 63.0)], "+--++"),
        ([(0, 10.0), *((k, 90.0 if k % 2 else 60.0) for k in range(1, 9))], "+--------"),
        ([(0, 10.0), *((k, 90.0 if k % 3 else 10.0) for k in range(1, 13))], "+" + "--+" * 4),
        ([(0, 10.0), (40, 95.0), (44, 95.0)], "+-+"),
    ],
    ids=["three frames in a row agree", "back and forth", "honest frames between", "after a silence it may be there"],
)
def test_a_jump_is_believed_once_three_frames_in_a_row_agree(places: list[tuple[int, float]], believed: str) -> None:
    box = inbox()
    assert verdicts(box, *((frame(k, x), k * STEP) for k, x in places)) == believed
    assert reasons(box) == {RejectReason.TOO_FAST: believed.count("-")}


def test_a_frame_repeated_does_not_make_a_jump_steady() -> None:
    assert verdicts(inbox(), (frame(0, 10.0), 0.0), *[(frame(1, 60.0), 0.5)] * 5) == "+-----"


def test_speed_is_judged_by_the_receivers_clock() -> None:
    """A sender's clock that runs an hour ahead, or claims that an hour has passed, changes nothing."""
    box = inbox()
    for k in range(10):
        ahead = Position.of(2, k, 3600.0 + k * STEP, Pose(10.0 + k, 40.0, 0.0))
        assert box.accept(encode(ahead), k * STEP) is not None
    leap = Position.of(2, 10, 7200.0, Pose(80.0, 40.0, 0.0))
    assert box.accept(encode(leap), 10 * STEP) is None
    assert reasons(box) == {RejectReason.TOO_FAST: 1}


@pytest.mark.parametrize("key", [None, KEY])
@pytest.mark.parametrize("heard", [0, 100])
def test_frames_of_ticks_to_come_never_shut_their_sender_out(key: bytes | None, heard: int) -> None:
    """With a key the frames are those of an earlier, longer run, sent again: alone or one after the other."""
    box = inbox(key)
    assert verdicts(box, *standing(range(heard), key=key)) == "+" * heard
    to_come = (1, 64, 9000, 9001, 9002, 10**6, 10**6 + 1, 10**6 + 2, 8 * 10**6)
    assert verdicts(box, *((frame(heard + later, 50.0, key=key), heard * STEP) for later in to_come)) == "-" * 9
    assert reasons(box) == {RejectReason.AHEAD: 9}
    for k, (data, now_s) in enumerate(standing(range(heard, heard + 200), key=key), heard):
        assert box.accept(data, now_s) is not None
        assert box.last(2) == (k, now_s)


@pytest.mark.parametrize("step", [0.1, 0.3, 0.5, 1.0 / 3.0, 1e-3])
def test_a_frame_of_the_receivers_own_tick_is_never_ahead(step: float) -> None:
    box = Box(roster=(2,), step=step)
    for k in (0, 1, 3, 7, 10**6 + 1, 8 * 10**6):
        assert box.accept(frame(k + 1, 10.0), k * step) is None
        assert box.accept(frame(k, 10.0), k * step) is not None


def test_at_a_pace_a_frame_a_few_ticks_ahead_makes_as_many_late_and_no_more() -> None:
    box = inbox(ahead=4)
    ahead = (frame(105, 50.0), 100 * STEP), (frame(104, 50.0), 100 * STEP)
    assert verdicts(box, *standing(range(100)), *ahead) == "+" * 100 + "-+"
    assert verdicts(box, *standing(range(100, 120))) == "+" * 4 + "-" + "+" * 15
    assert box.last(2) == (119, 119 * STEP)


def test_without_ticks_a_sender_is_heard_again_after_three_frames_and_one_that_runs_away_is_not() -> None:
    """One frame before the first, or three in a row later, with sequences that nobody has come to yet."""
    first, later, box = (inbox(ahead=None) for _ in range(3))
    assert verdicts(first, (frame(10**6, 50.0), 0.0)) == "+"
    runs_away = ((frame(10**6 + i, 50.0), 50.0) for i in range(3))
    assert verdicts(later, *standing(range(100)), *runs_away) == "+" * 100 + "--+"
    for shut in (first, later):
        assert verdicts(shut, *standing(range(100, 120)), (frame(110, 50.0), 60.0)) == "--" + "+" * 18 + "-"
    assert verdicts(box, (frame(0, 10.0), 0.0), (frame(8 * 10**6, 10.0), 0.5), (frame(2, 11.0), 1.0)) == "+-+"
    assert reasons(box) == {RejectReason.AHEAD: 1}


def test_a_stalled_network_that_catches_up_is_believed_and_shuts_nobody_out() -> None:
    """Ten seconds of frames at once: each follows the one before by no more than a step."""
    stalled = ((frame(k, 10.0 + 2.0 * k), k * STEP if k < 10 else 15.0) for k in range(30))
    assert verdicts(inbox(), *stalled) == "+" * 30
    assert verdicts(inbox(), (frame(5, 50.0), 500 * STEP), (frame(500, 50.0), 500 * STEP)) == "++"


def contact(sequence: int, x: float, y: float = 40.0, key: bytes | None = None) -> bytes:
    return encode(Position.of_contact(sequence, sequence * STEP, x, y), key)


def test_contacts_of_robots_that_are_heard_are_believed_from_everyone_and_anywhere() -> None:
    box = inbox()
    assert box.accept(frame(4, 10.0), 2.0) is not None
    found = [box.accept(contact(4, x), 2.0) for x in (90.0, 90.0, 5.0)]  # of two robots, and a second intruder far off
    assert [position and (position.robot, position.pose.x) for position in found] == [(0, 90.0), (0, 90.0), (0, 5.0)]
    assert box.accept(frame(5, 11.0), 2.5) is not None  # a contact touches no robot's position
    assert box.accept(contact(6, 70.0), 3.0) is not None  # the reporter's own frame was lost
    assert box.rejected == 0
    assert box.last(0) is None


def test_contacts_that_cannot_be_are_refused_and_counted() -> None:
    box = inbox()
    assert verdicts(box, (contact(0, 10.0), 0.0)) == "-", "before any robot was heard"
    assert reasons(box) == {RejectReason.UNKNOWN: 1}
    box = inbox(KEY)
    bad = [contact(100, 101.0, key=KEY), contact(100, 10.0, -5.0, key=KEY), contact(100, 10.0)]
    bad += [contact(100, 10.0, key=b"other"), contact(100, 10.0, key=KEY)[:-1]]
    assert verdicts(box, *((data, 50.0) for data in (frame(100, 10.0, key=KEY), *bad))) == "+-----"
    assert reasons(box) == {RejectReason.OUTSIDE: 2, RejectReason.TAG: 2, RejectReason.MALFORMED: 1}


def test_replayed_contacts_and_those_from_the_future_are_refused_and_poison_nothing() -> None:
    box = inbox()
    contacts = [contact(20, 30.0), contact(2**32 // 500 - 1, 30.0), contact(39, 30.0)]
    assert verdicts(box, *standing(range(40), 10.0), *((data, 39 * STEP) for data in contacts)) == "+" * 40 + "--+"
    assert reasons(box) == {RejectReason.OLD: 1, RejectReason.AHEAD: 1}


def test_a_contact_may_be_four_steps_older_or_newer_than_a_robot_would_send_now() -> None:
    judged = ((contact(40 + steps, 30.0), 40 * STEP) for steps in (-5, -4, 4, 5))
    box = inbox(ahead=None)
    assert verdicts(box, *standing(range(41), 10.0), *judged) == "+" * 41 + "-++-"
    assert reasons(box) == {RejectReason.OLD: 1, RejectReason.AHEAD: 1}


def trailing(k: int, x: float, *trail: tuple[int, int]) -> bytes:
    return encode(Position.of(2, k, STEP * k, Pose(x, 40.0, 0.0), trail))


def looks(intake: Intake) -> list[tuple[int, float, float]]:
    return [(tick, pose.x, pose.y) for tick, pose in intake.looks(1)]


def test_places_of_a_trail_are_as_many_ticks_apart_as_the_fleet_says_and_each_counts_once() -> None:
    intake = Box(trail_every=3).take(trailing(20, 50.0, (-600, 0), (-500, 100)), 10.0)
    assert looks(intake) == [(20, 50.0, 40.0), (17, 44.0, 40.0), (14, 39.0, 41.0)]
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
    for column, of_objects in zip(columns_of(peers), columns_of(dict(peers)), strict=True):
        assert column.tolist() == of_objects.tolist()
        assert column.dtype == of_objects.dtype
    assert [robot in peers for robot in (2, 3, 4, 9)] == [robot in expected for robot in (2, 3, 4, 9)]
    assert list(box.inboxes.peers(1).silent(1)) == [3]
    assert box.inboxes.peers(1).oldest(7) == 0
    assert box.inboxes.peers(1).lately(2).oldest(7) == 7


def test_a_contact_may_be_as_late_as_the_frames_of_any_robot() -> None:
    """Those of r2 take ten steps, those of r3 none; so do the contacts that each reports."""
    box = inbox(ahead=None)
    late = {2: 10, 3: 0}
    frames = [(frame(k - late[n], 10.0 * n, robot=n), k * STEP) for k in range(10, 41) for n in late]
    assert verdicts(box, *frames) == "+" * len(frames)
    judged = ((contact(sequence, 30.0), 40 * STEP) for sequence in (25, 26, 30, 34, 35, 36, 40, 44, 45))
    assert verdicts(box, *judged) == "-+++-+++-"
