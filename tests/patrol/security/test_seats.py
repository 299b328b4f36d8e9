"""Which process a launcher has started for a robot."""

from __future__ import annotations

import pytest

from patrol.security.seats import SEAT, own_instance, seat_of

TOKEN = "0123456789abcdef"


def test_each_process_has_a_seat_of_its_own_that_follows_from_the_token() -> None:
    seats = {
        seat_of(token, fleet, robot, incarnation)
        for token in (TOKEN, "another token that is long")
        for fleet in ("f", "g")
        for robot in ("r1", "r2")
        for incarnation in (1, 2)
    }
    assert len(seats) == 16
    assert all(0 < seat < 2**63 for seat in seats)
    assert seat_of(TOKEN, "f", "r1", 1) == seat_of(TOKEN, "f", "r1", 1)


def test_a_process_takes_the_seat_that_it_was_given() -> None:
    assert own_instance({SEAT: "77"}) == 77
    assert own_instance({SEAT: str(2**63 - 1)}) == 2**63 - 1


@pytest.mark.parametrize("given", [None, "", "0", "-5", "1.5", "x", "\u0663", str(2**63), "9" * 5000])
def test_without_one_it_draws_its_instance(given: str | None) -> None:
    environment = {} if given is None else {SEAT: given}
    drawn = {own_instance(environment) for _ in range(3)}
    assert len(drawn) == 3
    assert all(0 < instance < 2**63 for instance in drawn)
