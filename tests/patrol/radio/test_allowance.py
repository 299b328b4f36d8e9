from hypothesis import given
from hypothesis import strategies as st

from patrol.radio.allowance import Allowance, Share

SHARE = Share(per_tick=120.0, most=360.0, overhead=8, frame=37)


def test_a_robot_begins_with_nothing_and_sends_once_it_has_earned_the_frame() -> None:
    allowance = Allowance(SHARE)
    sent = []
    for k in range(9):
        allowance.earn(k)
        sent.append(allowance.take(28))
    # 28 bytes and 8 of overhead are 288 bits: three ticks' worth, of which 72 bits are left.
    assert sent == [False, False, False, True, False, True, False, False, True]


def test_savings_are_bounded_ticks_left_out_count_and_too_long_a_frame_uses_nothing() -> None:
    allowance = Allowance(SHARE)
    allowance.earn(10)
    assert not allowance.take(1), "the first tick is the beginning, whichever it is"
    allowance.earn(1000)
    assert allowance.take(37)
    assert not allowance.take(1)
    allowance = Allowance(Share(per_tick=1e6, most=1e6, overhead=0, frame=37))
    allowance.earn(0)
    allowance.earn(1)
    assert not allowance.take(38)
    assert allowance.take(37)


@given(st.integers(1, 10_000), st.floats(0.01, 2.0), st.integers(0, 20), st.integers(20, 64))
def test_an_empty_share_holds_the_longest_frame_as_soon_as_it_says(
    bits_per_s: int, step: float, overhead: int, frame: int
) -> None:
    per_tick = bits_per_s * step / 7
    share = Share(per_tick, max(per_tick, 8.0 * (frame + overhead)), overhead, frame)
    if share.earns_frame_in > 10_000:
        return
    allowance = Allowance(share)
    for k in range(share.earns_frame_in):
        allowance.earn(k)
    allowance.earn(share.earns_frame_in)
    assert allowance.take(frame)


@given(st.lists(st.tuples(st.integers(1, 5), st.integers(1, 37)), max_size=60))
def test_no_span_of_ticks_holds_more_than_what_it_earns_and_what_was_saved(wanted: list[tuple[int, int]]) -> None:
    allowance = Allowance(SHARE)
    k, sent = 0, [(0, 0)]
    allowance.earn(0)
    for wait, length in wanted:
        k += wait
        allowance.earn(k)
        sent.append((k, SHARE.cost(length) if allowance.take(length) else 0))
    for first in range(len(sent)):
        for last in range(first, len(sent)):
            bits = sum(cost for _, cost in sent[first : last + 1])
            assert bits <= SHARE.most + SHARE.per_tick * (sent[last][0] - sent[first][0])
    assert sum(cost for _, cost in sent) <= SHARE.per_tick * k


def test_what_is_earned_to_the_bit_suffices() -> None:
    """28 bytes and 8 of overhead are 288 bits, three ticks' worth; what can be saved is 960."""
    allowance = Allowance(Share(per_tick=96.0, most=960.0, overhead=8, frame=37))
    found = []
    for k in range(11):
        allowance.earn(k)
        found.append((allowance.suffices([28]), allowance.suffices([28, 28]), allowance.suffices([37] * 9)))
    assert found == [(k >= 3, k >= 6, k == 10) for k in range(11)], "to wait for more than can be saved is no use"
    assert [allowance.take(length) for length in (28, 28, 28, 4, 1)] == [True, True, True, True, False]
