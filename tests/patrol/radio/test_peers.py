from __future__ import annotations

from patrol.pose import Pose
from patrol.radio.inbox import Inbox
from patrol.radio.message import Position, encode
from patrol.radio.peers import PeerTracker

BOUNDS = (0.0, 0.0, 100.0, 88.0)


def said(k: int, x: float, *trail: tuple[int, int]) -> Position:
    return Position.of(2, k, 0.5 * k, Pose(x, 40.0, 0.0), trail)


def test_the_places_of_a_trail_are_as_many_ticks_apart_as_the_fleet_says() -> None:
    tracker = PeerTracker(trail_every=3)
    looks = list(tracker.hear(said(20, 50.0, (-600, 0), (-500, 100)), 20))
    assert [(tick, pose.x, pose.y) for tick, pose in looks] == [(20, 50.0, 40.0), (17, 44.0, 40.0), (14, 39.0, 41.0)]


def test_a_look_counts_once_also_where_trails_overlap_out_of_step() -> None:
    tracker = PeerTracker(trail_every=3)
    assert [tick for tick, _ in tracker.hear(said(20, 50.0, (-600, 0)), 20)] == [20, 17]
    assert [tick for tick, _ in tracker.hear(said(22, 52.0, (-600, 0), (-600, 0)), 22)] == [22, 19, 16]
    assert [tick for tick, _ in tracker.hear(said(23, 53.0, (-600, 0), (-600, 0)), 23)] == [23]
    assert [tick for tick, _ in tracker.hear(said(23, 53.0), 23)] == []


def test_what_was_said_last_is_kept_and_a_late_frame_does_not_replace_it() -> None:
    tracker = PeerTracker()
    newest = said(20, 50.0, (-100, 0))
    list(tracker.hear(newest, 20))
    list(tracker.hear(said(18, 48.0), 21))
    assert tracker.said == {2: newest}
    assert tracker.peers[2].sequence == 20


def test_a_step_of_a_trail_may_be_as_long_as_its_ticks() -> None:
    frames = [encode(said(k, 50.0 + k, (-590, 0), (-620, 0))) for k in (20, 24)]
    for every, left in ((1, 0), (3, 1), (4, 2)):
        box = Inbox(1, [1, 2], BOUNDS, 4.0, None, 0.5, 0, trail_every=every)
        found = [box.accept(frame, 0.5 * k) for frame, k in zip(frames, (20, 24), strict=True)]
        assert [position and len(position.trail) for position in found] == [left, left]
