"""Reduces the chart of a long run to as many points as a screen can show."""

from __future__ import annotations

import numpy as np

from monitor.observation.source import Series


def thinned(series: Series, most: int) -> Series:
    """Reduce a series, keeping its extremes.

    Args:
        series: The series.
        most: Number of ticks to keep.

    Returns:
        The whole series if it has at most `most` ticks. Else of each interval its first tick and the one with the
        largest MFoW, and the last tick: `most` + 1 ticks or fewer.
    """
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
