"""Beliefs that begin anew, and all that each robot sees and hears, from the records of ticks."""

from collections.abc import Sequence
from typing import cast

import pytest

from monitor.observation.listener import BeliefFollower, Listener
from patrol.journal.records import FORGED, RobotTick, Status, TickRecord, frame_sequence
from patrol.pose import Pose
from patrol.radio.message import Position, encode

ALIVE, PAUSED, DEAD = Status.ALIVE, Status.PAUSED, Status.DEAD
LOST, ABSENT, LEFT = Status.LOST, Status.ABSENT, Status.LEFT


class Ears:
    """Notes what a listener is told."""

    def __init__(self, number: int, looks: list[tuple[int, int, Pose]], heard: list[tuple[int, int, list[bytes]]]):
        self._number, self._looks, self._heard = number, looks, heard

    def look(self, tick: int, pose: Pose) -> None:
        self._looks.append((self._number, tick, pose))

    def hear(self, tick: int, frames: Sequence[bytes]) -> None:
        self._heard.append((self._number, tick, list(frames)))


class Fleet:
    """Robots 1 to 3, and what their listeners were told; robot 4 is not followed."""

    def __init__(self, kept_ticks: int = 3) -> None:
        self.made: list[int] = []
        self.looks: list[tuple[int, int, Pose]] = []
        self.heard: list[tuple[int, int, list[bytes]]] = []
        self.follower = BeliefFollower([1, 2, 3], self._make, kept_ticks)
        self.made.clear()

    def _make(self, number: int) -> Listener:
        self.made.append(number)
        return cast(Listener, Ears(number, self.looks, self.heard))

    def tick(
        self,
        k: int,
        *,
        status: dict[int, Status] | None = None,
        frames: Sequence[tuple[int, bytes]] = (),
        deliveries: Sequence[tuple[int, int, int]] = (),
        ended: Sequence[int] = (),
    ) -> None:
        """One tick; the robots stand at (their number, k)."""
        told = status or {}
        rows = tuple(
            RobotTick(n, told.get(n, ALIVE), float(n), float(k), 0.5, 0.0, 0.0, False, "", None, None, None)
            for n in range(1, 5)
        )
        self.follower.tick(TickRecord(k, rows, tuple(frames), deliveries, (), 0, 0.0, 0), ended)

    def hearing(self, k: int) -> dict[int, list[bytes]]:
        return {number: frames for number, tick, frames in self.heard if tick == k and frames}


@pytest.mark.parametrize(
    ("before", "after", "anew"),
    [
        *((gone, back, True) for gone in (DEAD, LOST, ABSENT, LEFT) for back in (ALIVE, PAUSED)),
        *((gone, gone, False) for gone in (DEAD, LOST, ABSENT, LEFT)),
        *((here, then, False) for here in (ALIVE, PAUSED) for then in (ALIVE, PAUSED, DEAD, LOST, LEFT)),
    ],
)
def test_who_returns_knows_nothing(before: Status, after: Status, anew: bool) -> None:
    fleet = Fleet()
    fleet.tick(0, status={2: before})
    fleet.made.clear()
    fleet.tick(1, status={2: after})
    assert fleet.made == ([2] if anew else [])
    fleet.tick(2, status={2: after})
    assert fleet.made == ([2] if anew else [])
    assert {number for number, tick, _ in fleet.looks if tick == 1} == {1, 3, *([2] if after is ALIVE else [])}
    assert {number for number, tick, _ in fleet.heard if tick == 1} == {1, 3, *([2] if after is ALIVE else [])}


@pytest.mark.parametrize("status", [ALIVE, PAUSED, DEAD])
def test_a_mind_that_ended_knows_nothing(status: Status) -> None:
    fleet = Fleet()
    fleet.tick(0, status={3: status})
    fleet.tick(1, status={3: status}, ended=[3, 4])
    assert fleet.made == [3]


def test_a_frame_reaches_whom_it_was_delivered_to_once_for_each_copy_in_order() -> None:
    fleet = Fleet()
    frames = [(1, b"1a"), (1, b"1b"), (2, b"2a"), (FORGED, b"fa"), (4, b"4a")]
    first, second = frame_sequence(0, 0), frame_sequence(0, 1)
    sent = [(2, 1, first), (1, 2, second), (1, 2, first), (1, 2, first), (FORGED, 3, first), (4, 3, first)]
    fleet.tick(0, frames=frames, deliveries=[*sent, (1, 4, first), (2, 3, second)])
    assert fleet.hearing(0) == {1: [b"2a"], 2: [b"1b", b"1a", b"1a"], 3: [b"fa", b"4a"]}


@pytest.mark.parametrize(("kept", "late"), [(1, 0), (3, 2), (4, 3)])
def test_late_frames_are_found_for_as_many_ticks_as_are_kept(kept: int, late: int) -> None:
    fleet = Fleet(kept)
    fleet.tick(0, frames=[(1, b"old")])
    for k in range(1, 6):
        fleet.tick(k, frames=[(1, b"new")], deliveries=[(1, 2, frame_sequence(0, 0))])
    assert [k for k in range(1, 6) if fleet.hearing(k)] == list(range(1, late + 1))
    assert all(fleet.hearing(k) == {2: [b"old"]} for k in range(1, late + 1))


def test_a_robot_looks_from_where_it_says_it_is_or_else_from_where_it_is() -> None:
    fleet, said = Fleet(), Pose(7.0, 9.0, 1.5)
    frames = [
        (1, encode(Position.of(1, 0, 0.0, said))),
        (2, encode(Position.of(1, 0, 0.0, said))),  # another's
        (2, encode(Position.of(2, 0, 0.0, said))),  # not in the first place
        (3, b"noise"),
    ]
    fleet.tick(0, frames=frames)
    (_, _, first), *others = fleet.looks
    assert (first.x, first.y, first.heading) == pytest.approx((7.0, 9.0, 1.5), abs=0.01)
    assert [number for number, _, _ in fleet.looks] == [1, 2, 3]
    assert [pose.x for _, _, pose in others] == pytest.approx([2.0, 3.0], abs=0.01)
    assert [pose.y for _, _, pose in others] == pytest.approx([0.0, 0.0], abs=0.01)
    assert [pose.heading for _, _, pose in others] == pytest.approx([0.5, 0.5], abs=0.01)
