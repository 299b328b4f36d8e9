"""A chart of as many points as eyes can tell apart, however long the run."""

from __future__ import annotations

import numpy as np

from monitor.source import Series


def thinned(series: Series, most: int) -> Series:
    """All of a series, or of each stretch its first tick and its stalest, and its last tick: `most` and one at most."""
    count = len(series.ticks)
    if count <= most:
        return series
    size = -(-2 * count // most)
    first = np.arange(0, count, size)
    padded = np.full(len(first) * size, -np.inf)
    padded[:count] = np.nan_to_num(series.mfow_s, nan=-np.inf)
    stalest = first + padded.reshape(-1, size).argmax(axis=1)
    kept = np.unique(np.concatenate((first, stalest, [count - 1])))
    return Series(series.ticks[kept], series.mfow_s[kept], series.fog_mean_s[kept])
