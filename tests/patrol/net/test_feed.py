"""What watchers are sent."""

from __future__ import annotations

from array import array

from patrol.net.feed import thinned


def test_what_is_thinned_lets_the_values_grow() -> None:
    values = array("f", [1.0, 2.0, 3.0])
    found = thinned(values, 2)
    values.append(4.0)
    assert found.tolist() == [1.0, 3.0]
