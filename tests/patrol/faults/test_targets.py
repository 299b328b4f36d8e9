"""Which robots a target means."""

from itertools import pairwise

import pytest

from patrol.faults.targets import Some, TargetField, in_drawn_order, meant, size_of

NUMBERS = {name: number for number, name in enumerate("abcdefg", start=1)}
NOBODY: frozenset[int] = frozenset()
DRAWING = (7, 0, TargetField.WHO)


@pytest.mark.parametrize(
    ("robots", "one", "minority", "half", "all_"),
    [
        (1, 1, 0, 1, 1),
        (2, 1, 1, 1, 2),
        (3, 1, 1, 1, 3),
        (4, 1, 1, 2, 4),
        (5, 1, 2, 2, 5),
        (6, 1, 2, 3, 6),
        (7, 1, 3, 3, 7),
    ],
)
def test_words_mean_sizes(robots: int, one: int, minority: int, half: int, all_: int) -> None:
    assert [size_of(word, robots) for word in ("one", "minority", "half", "all")] == [one, minority, half, all_]


@pytest.mark.parametrize(
    ("fraction", "robots", "size"), [(0.5, 3, 2), (0.49, 3, 1), (0.01, 3, 1), (0.25, 10, 3), (0.24, 10, 2), (1.0, 7, 7)]
)
def test_a_share_is_rounded_half_up_to_at_least_one(fraction: float, robots: int, size: int) -> None:
    assert size_of(Some(fraction=fraction), robots) == size
    assert size_of(Some(count=2), robots) == 2


def test_names_mean_themselves_and_all_means_spare_robots_too() -> None:
    spares = frozenset({6, 7})
    assert meant(("e", "b", "g"), NUMBERS, spares, DRAWING) == (2, 5, 7)
    assert meant("g", NUMBERS, spares, DRAWING) == (7,)
    assert meant(("half",), {"half": 3}, spares, DRAWING) == (3,)
    assert meant("all", NUMBERS, spares, DRAWING) == (1, 2, 3, 4, 5, 6, 7)


def test_sizes_mean_the_first_in_a_drawn_order_without_spare_robots() -> None:
    spares = frozenset({1, 4})
    order = in_drawn_order([2, 3, 5, 6, 7], DRAWING)
    assert sorted(order) == [2, 3, 5, 6, 7]
    for who, size in (("one", 1), ("minority", 2), ("half", 2), (Some(count=4), 4), (Some(fraction=0.5), 3)):
        assert meant(who, NUMBERS, spares, DRAWING) == tuple(sorted(order[:size]))


def test_each_seed_fault_and_field_has_an_order_of_its_own() -> None:
    drawings = [DRAWING, (8, 0, TargetField.WHO), (7, 1, TargetField.WHO), (7, 0, TargetField.TO)]
    orders = [in_drawn_order(range(1, 40), drawing) for drawing in drawings]
    assert all(one != other for one, other in pairwise(orders))
    assert in_drawn_order(reversed(range(1, 40)), DRAWING) == orders[0]
    # Who is left after others are taken out keeps the order.
    assert in_drawn_order(range(1, 20), DRAWING) == [number for number in orders[0] if number < 20]
