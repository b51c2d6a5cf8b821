"""Statistics of groups of runs: medians with bootstrap intervals, shares with Wilson's, paired differences. Pure.

Resampling draws from a generator that its caller seeds, so the same values give the same interval, byte for byte.
Efron and Tibshirani, An Introduction to the Bootstrap (1993), sections 13 and 14; Wilson, JASA 22 (1927); Cohen,
Statistical Power Analysis (1988), section 2.3, for d_z.
"""

from __future__ import annotations

from math import sqrt
from zlib import crc32

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

Values = NDArray[np.float64]
CONFIDENCE = 0.95
Z = 1.959963984540054
"""Quantile of the normal distribution for two-sided 95 %."""
RESAMPLES = 2000
BATCH_VALUES_MAX = 4_000_000
"""Number of values drawn at once; bounds the memory of a group of many runs."""


class Interval(Struct, frozen=True):
    """Estimate with the bounds of its 95 % interval."""

    value: float
    low: float
    high: float


class Paired(Struct, frozen=True):
    """Differences, second group minus first, over the seeds that both groups have a value for."""

    pairs: int
    difference: Interval
    """Median of the differences."""
    effect: float | None
    """d_z: mean of the differences over their standard deviation; None below two pairs, or if all are equal."""
    less: int
    """Number of pairs in which the second value is the smaller one."""
    more: int


def wilson(good: int, of: int) -> Interval:
    """Return the share of `good` among `of` > 0 runs with its Wilson score interval."""
    share = good / of
    center = (share + Z * Z / (2 * of)) / (1 + Z * Z / of)
    half = Z / (1 + Z * Z / of) * sqrt(share * (1 - share) / of + Z * Z / (4 * of * of))
    return Interval(share, max(0.0, center - half), min(1.0, center + half))


def median(values: Values, name: str) -> Interval:
    """Return the median of at least one value with its percentile bootstrap interval; `name` seeds the resampling."""
    found = float(np.median(values))
    if values.size == 1 or np.all(values == values[0]):
        return Interval(found, found, found)
    chance = np.random.Generator(np.random.PCG64(crc32(name.encode())))
    batch = max(1, BATCH_VALUES_MAX // values.size)
    medians = [
        np.median(values[chance.integers(0, values.size, (min(batch, RESAMPLES - n), values.size))], axis=1)
        for n in range(0, RESAMPLES, batch)
    ]
    low, high = np.quantile(np.concatenate(medians), (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2))
    return Interval(found, float(low), float(high))


def paired(first: Values, second: Values, name: str) -> Paired:
    """Return the paired differences of two lists of equal length of at least one, by seed."""
    differences = second - first
    spread = float(np.std(differences, ddof=1)) if differences.size > 1 else 0.0
    effect = float(np.mean(differences)) / spread if spread > 0.0 else None
    less, more = int(np.count_nonzero(differences < 0.0)), int(np.count_nonzero(differences > 0.0))
    return Paired(differences.size, median(differences, name), effect, less, more)


def quartiles(values: Values) -> tuple[float, float, float, float, float]:
    """Return least value, quartiles and largest value, of at least one."""
    low, first, middle, third, high = np.quantile(values, (0.0, 0.25, 0.5, 0.75, 1.0))
    return float(low), float(first), float(middle), float(third), float(high)
