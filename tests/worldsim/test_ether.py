"""The ether: every directed pair for itself, and every frame accounted for."""

from __future__ import annotations

from patrol.random import Purpose, draw
from worldsim.ether import OVERSIZED, RECEIVER_DEAD, Ether


def test_every_frame_reaches_all_others_in_the_same_tick() -> None:
    ether = Ether([1, 2, 3])
    delivery = ether.carry(5, {3: b"c", 1: b"a", 2: None}, [1, 2, 3], [1, 2, 3])
    assert delivery.heard == {1: [b"c"], 2: [b"a", b"c"], 3: [b"a"]}
    assert delivery.arrived == ((1, 2, 5), (1, 3, 5), (3, 1, 5), (3, 2, 5))
    assert delivery.dropped == ()


def test_frames_to_the_dead_are_dropped_and_counted() -> None:
    ether = Ether([1, 2, 3])
    delivery = ether.carry(0, {1: b"a"}, [1, 2, 3], [1, 3])
    assert delivery.heard == {1: [], 3: [b"a"]}
    assert delivery.dropped == ((1, 2, 0, RECEIVER_DEAD),)
    link = ether.links[1, 2]
    assert (link.sent, link.delivered, link.dropped) == (1, 0, {RECEIVER_DEAD: 1})


def test_robots_that_are_not_there_are_no_receivers() -> None:
    ether = Ether([1, 2])
    delivery = ether.carry(0, {1: b"a"}, [1], [1])
    assert delivery.arrived == ()
    assert delivery.dropped == ()
    assert ether.links[1, 2].sent == 0


def test_an_oversized_frame_is_dropped_whatever_it_holds() -> None:
    ether = Ether([1, 2])
    assert ether.carry(0, {1: bytes(64)}, [1, 2], [1, 2]).heard[2] == [bytes(64)]
    delivery = ether.carry(1, {1: bytes(65)}, [1, 2], [1, 2])
    assert delivery.heard[2] == []
    assert delivery.dropped == ((1, 2, 1, OVERSIZED),)


def test_a_rule_decides_for_each_directed_pair_alone() -> None:
    def lossy(source: int, destination: int, sequence: int) -> str | None:
        return "lost" if draw(7, Purpose.ETHER, 0, source, destination, sequence) < 0.5 else None

    def fates(numbers: list[int]) -> dict[tuple[int, int, int], bool]:
        ether = Ether(numbers, [lossy])
        arrived: set[tuple[int, int, int]] = set()
        for k in range(50):
            arrived.update(ether.carry(k, dict.fromkeys(numbers, b"x"), numbers, numbers).arrived)
        for link in ether.links.values():
            assert link.sent == 50 == link.delivered + sum(link.dropped.values())
        return {(i, j, k): (i, j, k) in arrived for i in (1, 2) for j in (1, 2) if i != j for k in range(50)}

    small, large = fates([1, 2]), fates([1, 2, 3, 4])
    assert small == large
    assert 20 < sum(small.values()) < 80
    assert [small[1, 2, k] for k in range(50)] != [small[2, 1, k] for k in range(50)]
