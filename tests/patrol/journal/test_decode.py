"""Limits of a record, by the size of its fleet."""

from typing import Any

import msgpack
import pytest

from patrol.errors import Malformed
from patrol.journal import Event, TickRecord, pack
from patrol.journal.decode import MAX_RECORD, decode, is_tick, longest_record


@pytest.mark.parametrize(
    ("robots", "size"),
    [(0, 4_194_304), (10, 4_194_304 + 10_240 + 800), (1000, 4_194_304 + 1_024_000 + 8_000_000), (60_000, 2**28)],
)
def test_the_longest_record_grows_with_the_square_of_the_fleet(robots: int, size: int) -> None:
    assert longest_record(robots) == size
    assert MAX_RECORD == 2**28


def test_a_tick_is_known_by_its_first_bytes() -> None:
    tick, event = pack(TickRecord(3, (), (), (), (), 1, 0.5, 2)), pack(Event(3, "tick"))
    assert is_tick(tick)
    assert not is_tick(event)
    assert decode(event, 1) == Event(3, "tick")


def problem_of(record: dict[str, Any], robots: int) -> str:
    with pytest.raises(Malformed) as refused:
        decode(msgpack.packb(record), robots)
    return str(refused.value)


@pytest.mark.parametrize(("robots", "most"), [(1, 500_000 + 8 * 4), (9, 500_000 + 8 * 100)])
def test_a_tick_has_no_more_links_than_its_robots_can_have(robots: int, most: int) -> None:
    groups = [[1, 3, "a", [1] * 100_000] for _ in range(most // 100_000)] + [[1, 3, "a", [1] * (most % 100_000)]]
    record = {"type": "tick", "robots": [], "delivered": groups[:2], "dropped": groups[2:]}
    assert "links" not in problem_of(record, robots)
    assert problem_of(record | {"copies": [[1, 3, "a", [1]]]}, robots) == "more links than the robots can have"


@pytest.mark.parametrize(
    ("group", "known"),
    [
        ([0, 3, "a", [1]], True),
        ([2, 3, "a", [1, 2]], True),
        ([2, 3, "a", []], True),
        ([3, 3, "a", [1]], False),
        ([1, 3, "a", [0, 1]], False),
        ([1, 3, "a", [1, 3]], False),
    ],
)
@pytest.mark.parametrize("field", ["delivered", "dropped", "copies", "delayed"])
def test_links_are_of_robots_of_the_fleet(field: str, group: list[Any], known: bool) -> None:
    problem = problem_of({"type": "tick", "robots": [], field: [group]}, 2)
    assert (problem != "links of a robot that the header does not have") == known


@pytest.mark.parametrize(("lists", "many"), [(249_999, False), (250_000, True)])
def test_another_record_has_no_more_lists_and_mappings_than_a_quarter_of_a_million(lists: int, many: bool) -> None:
    """The mapping of the record itself counts, and so does the list of the lists."""
    record = {"type": "event", "detail": [[]] * (lists - 1)}
    assert ("more than 250000 lists and mappings" in problem_of(record, 1)) == many
