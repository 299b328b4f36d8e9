import numpy as np
import pytest

from patrol.journal.links import NO_DROPS, WholeLinks, drops_of, joined, links_of, pairs_of, places_of, to_others

ROWS = ((1, 2, 7), (1, 3, 7), (2, 1, 7), (0, 1, 2**40))
DROPPED = ((1, 2, 7, "loss:b"), (1, 2, 7, "loss:a"), (1, 1, 7, "loss:b"))


def test_columns_read_like_the_rows_they_were_made_of() -> None:
    links, drops = links_of(ROWS), drops_of(DROPPED)
    assert tuple(links) == ROWS == links[:]
    assert (links[0], links[-1], links[1:3]) == (ROWS[0], ROWS[-1], ROWS[1:3])
    assert tuple(drops) == DROPPED == drops[:]
    assert (len(links), len(drops), len(links_of(())), len(NO_DROPS)) == (4, 3, 0, 0)
    assert links_of(links) is links
    assert [*links, *drops][4] == DROPPED[0]
    assert ROWS[1] in links
    with pytest.raises(StopIteration):
        next(iter(links_of(())))


def test_columns_equal_rows_and_each_other_in_the_same_order_only() -> None:
    assert links_of(ROWS) == ROWS == links_of(list(ROWS))
    assert links_of(ROWS) != links_of(ROWS[::-1])
    assert links_of(ROWS[:2]) != links_of(ROWS)
    assert drops_of(DROPPED) == DROPPED
    assert drops_of(DROPPED) != drops_of((*DROPPED[:2], (1, 1, 7, "loss:a")))
    assert drops_of(DROPPED) != links_of(ROWS[:3])
    assert hash(links_of(ROWS)) == hash(ROWS)


def test_joined_links_follow_one_another_and_places_have_their_order() -> None:
    assert tuple(joined(links_of(ROWS), drops_of(DROPPED))) == (*ROWS, *(row[:3] for row in DROPPED))
    assert joined(links_of(ROWS), NO_DROPS) == ROWS
    assert places_of(links_of(ROWS)) is None  # a forged frame's sequence
    rows = [(65535, 1, 3), (1, 65535, 2**32 - 1), (1, 65535, 0), (0, 2, 9)]
    places = places_of(links_of(rows))
    assert places is not None
    by_place = sorted(range(len(rows)), key=lambda index: int(places[index]))
    assert [rows[index] for index in by_place] == sorted(rows)


def test_each_frame_goes_to_all_but_its_sender() -> None:
    links = to_others((0, 2, 2, 3), (1, 2, 3))
    rows = [(0, 0, 1), (0, 0, 2), (0, 0, 3), (1, 2, 1), (1, 2, 3), (2, 2, 1), (2, 2, 3), (3, 3, 1), (3, 3, 2)]
    pairs = links.pairs
    assert list(zip(pairs.frame.tolist(), pairs.source.tolist(), pairs.destination.tolist(), strict=True)) == rows
    assert pairs.robots.tolist() == [to << 16 | source for _, source, to in rows]
    assert links.reaches.tolist() == [[True, True, True, True], [True, False, False, True], [True, True, True, False]]
    assert not any(column.flags.writeable for column in (*pairs[:4], links.reaches))
    assert [column.size for column in to_others((), ()).pairs[:4]] == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("sources", "receivers", "rises"),
    [
        ((1, 2, 5), (1, 2, 5), True),
        ((), (), True),
        ((1, 1), (1, 2), False),  # the same link twice
        ((1, 2, 2), (1, 2, 5), False),
        ((2, 1), (1, 2), False),
    ],
)
def test_pairs_say_whether_they_are_in_order(sources: tuple[int, ...], receivers: tuple[int, ...], rises: bool) -> None:
    pairs = to_others(sources, receivers).pairs
    rows = list(zip(pairs.source.tolist(), pairs.destination.tolist(), strict=True))
    assert pairs.rises == rises == (rows == sorted(set(rows)))


def test_whole_links_equal_the_same_rows_however_they_are_held() -> None:
    pairs = to_others((0, 2, 3), (2, 3)).pairs
    whole = WholeLinks(pairs, np.array([2**40, 7, 8]))
    rows = ((0, 2, 2**40), (0, 3, 2**40), (2, 3, 7), (3, 2, 8))
    apart = WholeLinks(pairs_of(*(column.copy() for column in pairs[:3])), whole.of_frames.copy())
    for same in (rows, links_of(rows), WholeLinks(pairs, whole.of_frames), apart):
        assert whole == same
        assert same == whole
    other = WholeLinks(to_others((0, 2, 4), (2, 3)).pairs, whole.of_frames)
    for different in (links_of(rows[::-1]), WholeLinks(pairs, np.array([2**40, 7, 9])), other, rows[1:]):
        assert whole != different
        assert different != whole
    assert tuple(whole) == rows
    # The same rows of other frames: the second reaches nobody.
    lonely = WholeLinks(pairs_of(np.array([0, 2]), np.array([2, 3]), np.array([3, 2])), np.array([7, 5, 8]))
    assert lonely == links_of(rows[2:])
    assert links_of(rows[2:]) == lonely
