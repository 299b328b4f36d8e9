"""The rate of ticks, as a page shows it."""

import pytest

from monitor.observation.source import TickRate


def test_the_rate_is_that_of_the_last_three_seconds() -> None:
    rate = TickRate()
    assert rate.at(5.0, 7) == 0.0
    for second in range(5):  # two ticks a second, then ten
        rate.add(float(second), 2 * second)
    assert rate.at(4.0, 8) == pytest.approx(2.0)
    for second in range(1, 5):
        rate.add(4.0 + second, 8 + 10 * second)
    assert rate.at(8.0, 48) == pytest.approx(10.0)
    assert rate.at(6.0, 28) == pytest.approx(10.0)  # three seconds before 8 s nothing else is left
    rate.clear()
    assert rate.at(8.0, 48) == 0.0


def test_a_sample_that_is_three_seconds_old_still_counts_and_an_older_one_does_not() -> None:
    rate = TickRate()
    for now_s, k in ((0.0, 0), (1.0, 100), (3.0, 110), (4.0, 120)):
        rate.add(now_s, k)
    assert rate.at(3.9, 120) == pytest.approx(120 / 3.9)
    assert rate.at(4.0, 120) == pytest.approx((120 - 100) / 3.0)


def test_samples_closer_than_a_tenth_of_a_second_are_left_out() -> None:
    rate = TickRate()
    for now_s, k in ((0.0, 0), (0.09, 5), (0.1, 6)):
        rate.add(now_s, k)
    assert rate.at(0.1, 6) == pytest.approx(60.0)
    assert rate.at(3.1, 36) == pytest.approx(36 / 3.1), "two samples stay, however old they are"
    rate.add(3.2, 40)
    assert rate.at(3.2, 40) == pytest.approx((40 - 6) / 3.1)


def test_without_time_there_is_no_rate() -> None:
    rate = TickRate()
    rate.add(1.0, 3)
    assert rate.at(1.0, 9) == 0.0
    assert rate.at(1.5, 9) == pytest.approx(12.0)
