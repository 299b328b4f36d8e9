"""Reduces the chart of a long run to as many points as a screen can show."""

from __future__ import annotations

import numpy as np

from monitor.observation.source import Series


def thinned(series: Series, most: int) -> Series:
    """Reduce a series to `most` + 1 ticks or fewer, keeping its extremes.

    A series of at most `most` ticks is returned as it is. Of a longer one, each interval keeps its first tick and the
    one with the largest MFoW; the last tick stays too.
    """
    count = len(series.ticks)
    if count <= most:
        return series
    size = -(-2 * count // most)
    first = np.arange(0, count, size)
    padded = np.full(len(first) * size, -np.inf)
    padded[:count] = np.nan_to_num(series.mfow_s, nan=-np.inf)
    stalest = first + padded.reshape(-1, size).argmax(axis=1)
    chosen = np.unique(np.concatenate((first, stalest, [count - 1])))
    return Series(series.ticks[chosen], series.mfow_s[chosen], series.fog_mean_s[chosen])
