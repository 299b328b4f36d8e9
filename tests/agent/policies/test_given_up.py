"""Places that were given up: for how long, and what lies around them."""

from __future__ import annotations

from agent.policies.pursuit import LEFT_OUT_S, LONGEST_S, MOST_PLACES, GivenUp

STEP = 0.5


def test_a_place_that_is_given_up_again_is_left_out_for_longer_and_others_are_not() -> None:
    given_up = GivenUp(0.3, 0.1, STEP)
    spells = []
    for turn in range(2000):
        given_up.add(turn, (5, 5))
        spells.append((given_up.places[-1][2] - turn) * STEP)
    assert spells[:7] == [20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 960.0]
    assert spells[-1] == LONGEST_S
    given_up.add(2000, (5, 40))
    assert [place[:2] for place in given_up.places] == [(5, 5), (5, 40)]
    assert (given_up.places[-1][2] - 2000) * STEP == LEFT_OUT_S
    for col in range(3 * MOST_PLACES):
        given_up.add(2000, (0, 50 * col))
    assert len(given_up.places) == MOST_PLACES


def test_what_lies_around_a_place_is_left_out_with_it_and_forgiven_with_it() -> None:
    given_up = GivenUp(0.3, 0.1, STEP)
    given_up.add(10, (5, 5))
    assert given_up.now(11).tolist() == [[5, 5, 36]]
    assert given_up.now(10 + round(LEFT_OUT_S / STEP)).size == 0
    given_up.forgive((5, 12))
    assert given_up.places != []
    given_up.forgive((5, 11))
    assert given_up.places == []


def test_a_place_is_forgotten_some_time_after_it_was_left_out() -> None:
    given_up = GivenUp(0.3, 0.1, STEP)
    given_up.add(0, (5, 5))
    late = round((LEFT_OUT_S + LONGEST_S) / STEP)
    given_up.add(late, (5, 5))
    assert given_up.places == [(5, 5, late + round(LEFT_OUT_S / STEP), round(LEFT_OUT_S / STEP))]
