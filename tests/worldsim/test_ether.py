"""The ether: every directed pair for itself, and every frame accounted for."""

from __future__ import annotations

from collections import Counter

from patrol.message import MAX_FRAMES
from patrol.random import Purpose, draw
from patrol.records import MAX_TICKS, frame_sequence
from worldsim.ether import OVERSIZED, RECEIVER_DEAD, Ether


def test_every_frame_reaches_all_others_in_the_same_tick() -> None:
    ether = Ether()
    delivery = ether.carry(5, {3: [b"c"], 1: [b"a"], 2: ()}, [1, 2, 3], [1, 2, 3])
    assert delivery.heard == {1: [b"c"], 2: [b"a", b"c"], 3: [b"a"]}
    assert delivery.arrived == ((1, 2, 5), (1, 3, 5), (3, 1, 5), (3, 2, 5))
    assert delivery.dropped == ()


def test_frames_to_the_dead_are_dropped_and_counted() -> None:
    ether = Ether()
    delivery = ether.carry(0, {1: [b"a"]}, [1, 2, 3], [1, 3])
    assert delivery.heard == {1: [], 3: [b"a"]}
    assert delivery.dropped == ((1, 2, 0, RECEIVER_DEAD),)
    assert delivery.arrived == ((1, 3, 0),)


def test_robots_that_are_not_there_are_no_receivers() -> None:
    ether = Ether()
    delivery = ether.carry(0, {1: [b"a"]}, [1], [1])
    assert delivery.arrived == ()
    assert delivery.dropped == ()


def test_an_oversized_frame_is_dropped_whatever_it_holds() -> None:
    ether = Ether()
    assert ether.carry(0, {1: [bytes(64)]}, [1, 2], [1, 2]).heard[2] == [bytes(64)]
    delivery = ether.carry(1, {1: [bytes(65)]}, [1, 2], [1, 2])
    assert delivery.heard[2] == []
    assert delivery.dropped == ((1, 2, 1, OVERSIZED),)


def test_a_rule_decides_for_each_directed_pair_alone() -> None:
    def lossy(source: int, destination: int, sequence: int) -> str | None:
        return "lost" if draw(7, Purpose.ETHER, 0, source, destination, sequence) < 0.5 else None

    def carried(numbers: list[int]) -> dict[tuple[int, int, int], bool]:
        ether = Ether([lossy])
        arrived: set[tuple[int, int, int]] = set()
        fates: Counter[tuple[int, int]] = Counter()
        for k in range(50):
            delivery = ether.carry(k, dict.fromkeys(numbers, (b"x",)), numbers, numbers)
            arrived.update(delivery.arrived)
            fates.update((source, destination) for source, destination, _ in delivery.arrived)
            fates.update((source, destination) for source, destination, _, _ in delivery.dropped)
        assert fates == {(i, j): 50 for i in numbers for j in numbers if i != j}
        return {(i, j, k): (i, j, k) in arrived for i in (1, 2) for j in (1, 2) if i != j for k in range(50)}

    small, large = carried([1, 2]), carried([1, 2, 3, 4])
    assert small == large
    assert 20 < sum(small.values()) < 80
    assert [small[1, 2, k] for k in range(50)] != [small[2, 1, k] for k in range(50)]


def test_each_of_a_senders_frames_has_a_fate_and_a_number_of_its_own() -> None:
    ether = Ether([lambda _source, _to, sequence: "lost" if sequence == frame_sequence(5, 1) else None])
    delivery = ether.carry(5, {1: [b"position", b"first", b"second"]}, [1, 2], [1, 2])
    assert delivery.heard[2] == [b"position", b"second"]
    assert delivery.arrived == ((1, 2, 5), (1, 2, frame_sequence(5, 2)))
    assert delivery.dropped == ((1, 2, frame_sequence(5, 1), "lost"),)
    most = frame_sequence(MAX_TICKS, MAX_FRAMES - 1)
    assert most < 2**32
    assert len({frame_sequence(k, place) for k in (0, 1, MAX_TICKS) for place in range(MAX_FRAMES)}) == 3 * MAX_FRAMES
