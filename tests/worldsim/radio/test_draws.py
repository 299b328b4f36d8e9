"""Draws of many links at once are the draws of each."""

from __future__ import annotations

import numpy as np

from patrol.random import Purpose, draw, mix
from worldsim.kernels.radio import below


def test_the_draws_of_many_links_are_those_of_each() -> None:
    seed, fault, rate = 2**63 + 5, 3, 0.3
    sources, receivers, sequences = [1, 2, 900], [1, 7, 65535], [0, 12, 2**29 + 12]
    states = np.array([mix(seed, Purpose.ETHER, fault, source) for source in sources], dtype=np.uint64)
    rates = np.broadcast_to(rate, (len(sources), len(receivers)))
    found = below(states, np.array(receivers, dtype=np.int64), np.array(sequences, dtype=np.int64), rates)
    expected = [
        [draw(seed, Purpose.ETHER, fault, source, receiver, sequence) < rate for receiver in receivers]
        for source, sequence in zip(sources, sequences, strict=True)
    ]
    assert found.tolist() == expected
    assert 0 < found.sum() < found.size
