"""Links as columns read like tuples of rows, and equal them."""

from __future__ import annotations

import pytest

from patrol.journal.links import NO_DROPS, NO_LINKS, drops_of, joined, links_of, places_of, to_others

ROWS = ((1, 2, 7), (1, 3, 7), (2, 1, 7), (0, 1, 2**40))
DROPPED = ((1, 2, 7, "loss:b"), (1, 2, 7, "loss:a"), (1, 1, 7, "loss:b"))


def test_columns_read_like_the_rows_they_were_made_of() -> None:
    links, drops = links_of(ROWS), drops_of(DROPPED)
    assert tuple(links) == ROWS == links[:]
    assert (links[0], links[-1], links[1:3]) == (ROWS[0], ROWS[-1], ROWS[1:3])
    assert tuple(drops) == DROPPED == drops[:]
    assert (len(links), len(drops), len(NO_LINKS), len(NO_DROPS)) == (4, 3, 0, 0)
    assert links_of(links) is links
    assert [*links, *drops][4] == DROPPED[0]
    assert ROWS[1] in links
    with pytest.raises(StopIteration):
        next(iter(NO_LINKS))


def test_columns_equal_rows_and_each_other_in_the_same_order_only() -> None:
    assert links_of(ROWS) == ROWS
    assert links_of(ROWS) == ROWS
    assert links_of(ROWS) == links_of(list(ROWS))
    assert links_of(ROWS) != links_of(ROWS[::-1])
    assert links_of(ROWS[:2]) != links_of(ROWS)
    assert drops_of(DROPPED) == DROPPED
    assert drops_of(DROPPED) != drops_of((*DROPPED[:2], (1, 1, 7, "loss:a")))
    assert drops_of(DROPPED) != links_of(ROWS[:3])
    assert hash(links_of(ROWS)) == hash(ROWS)


def test_drops_are_sorted_as_their_rows_are() -> None:
    assert tuple(drops_of(DROPPED).sorted()) == tuple(sorted(DROPPED))


def test_places_have_the_order_of_the_links() -> None:
    assert places_of(links_of(ROWS)) is None  # a forged frame's sequence
    rows = [(65535, 1, 3), (1, 65535, 2**32 - 1), (1, 65535, 0), (0, 2, 9)]
    places = places_of(links_of(rows))
    assert places is not None
    by_place = sorted(range(len(rows)), key=lambda index: int(places[index]))
    assert [rows[index] for index in by_place] == sorted(rows)


def test_joined_links_follow_one_another() -> None:
    assert tuple(joined(links_of(ROWS), drops_of(DROPPED))) == (*ROWS, *(row[:3] for row in DROPPED))
    assert joined(links_of(ROWS), NO_DROPS) == ROWS


def test_each_frame_goes_to_all_but_its_sender() -> None:
    links = to_others((0, 2, 2, 3), (1, 2, 3))
    rows = [(0, 0, 1), (0, 0, 2), (0, 0, 3), (1, 2, 1), (1, 2, 3), (2, 2, 1), (2, 2, 3), (3, 3, 1), (3, 3, 2)]
    assert list(zip(links.frame.tolist(), links.source.tolist(), links.destination.tolist(), strict=True)) == rows
    assert links.reaches.tolist() == [
        [True, True, True, True],
        [True, False, False, True],
        [True, True, True, False],
    ]
    assert not any(column.flags.writeable for column in links)
    assert [column.size for column in to_others((), ())] == [0, 0, 0, 0]
