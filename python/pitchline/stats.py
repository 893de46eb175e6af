"""Percentiles and other measures of samples, with intervals.

>>> import numpy as np
>>> from pitchline import stats
>>> samples = np.random.default_rng(1).normal(size=2000)
>>> p90 = stats.percentile(samples, 0.9)
>>> p90.low < p90.value < p90.high
True
"""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from pitchline import _pitchline

__all__ = [
    "Estimate",
    "Interval",
    "Normality",
    "difference",
    "estimate",
    "exceedance",
    "lilliefors",
    "mean",
    "mean_plus_sd",
    "percentile",
    "tail_mean",
]


class Interval(NamedTuple):
    """A measure of ``samples`` samples and its interval; its ends are NaN where the samples are too few for one."""

    value: float
    low: float
    high: float
    samples: int


class Estimate(NamedTuple):
    """A measure of few samples and the variance of it."""

    value: float
    variance: float
    #: whether a normal distribution was assumed
    is_normal: bool
    #: the p-value of Lilliefors' test of normality; NaN without a test
    p_value: float


class Normality(NamedTuple):
    """Lilliefors' test: the largest distance between the distributions, and its p-value."""

    statistic: float
    p_value: float


def _interval(found: tuple[float, tuple[float, float] | None, int]) -> Interval:
    value, ends, samples = found
    low, high = ends or (float("nan"), float("nan"))
    return Interval(value, low, high, samples)


def percentile(samples: ArrayLike, level: float = 0.9, *, confidence: float = 0.95) -> Interval:
    """The percentile at ``level`` and its distribution-free interval from order statistics.

    >>> percentile(range(1, 100), 0.5).value
    50.0
    """
    return _interval(_pitchline.verified(samples, "percentile", level, confidence))


def mean(samples: ArrayLike, *, confidence: float = 0.95) -> Interval:
    """The mean and its interval by Hall's transformation of Student's t, which takes the skewness out.

    >>> mean([1.0, 2.0, 3.0]).value
    2.0
    """
    return _interval(_pitchline.verified(samples, "mean", 0.0, confidence))


def mean_plus_sd(samples: ArrayLike, k: float, *, confidence: float = 0.95) -> Interval:
    """The mean plus ``k`` standard deviations.

    >>> round(mean_plus_sd([1.0, 2.0, 3.0], 1.0).value, 9)
    3.0
    """
    return _interval(_pitchline.verified(samples, "mean-plus-sd", k, confidence))


def tail_mean(
    samples: ArrayLike, level: float = 0.9, *, lower: bool = False, confidence: float = 0.95
) -> Interval:
    """The mean of the share 1 − ``level`` of the largest samples: conditional value at risk. With ``lower`` that of
    the smallest ones.

    >>> tail_mean(range(1, 101), 0.9).value
    95.5
    """
    name = "lower-tail-mean" if lower else "tail-mean"
    return _interval(_pitchline.verified(samples, name, level, confidence))


def exceedance(samples: ArrayLike, limit: float, *, confidence: float = 0.95) -> Interval:
    """The probability of more than ``limit``, and its interval by Clopper and Pearson.

    >>> exceedance(range(100), 89.5).value
    0.1
    """
    return _interval(_pitchline.verified(samples, "exceedance", limit, confidence))


def difference(
    first: ArrayLike, second: ArrayLike, level: float = 0.9, *, confidence: float = 0.95
) -> Interval | None:
    """The percentile of ``first`` less that of ``second``, samples with the same random numbers in the same order.
    ``None`` if there are too few for an interval.

    >>> import numpy as np
    >>> x = np.random.default_rng(1).normal(size=1000)
    >>> round(difference(x + 0.5, x).value, 9)
    0.5
    """
    found = _pitchline.difference(first, second, "percentile", level, confidence)
    return None if found is None else _interval(found)


def estimate(samples: ArrayLike, level: float = 0.9, *, significance: float = 0.05) -> Estimate:
    """The percentile of few samples, as a design's in a campaign: of a normal distribution unless Lilliefors' test
    refuses one at ``significance``, of Harrell and Davis otherwise. The variance is the noise of a kriging model.

    >>> import numpy as np
    >>> estimate(np.random.default_rng(1).normal(size=30)).is_normal
    True
    """
    value, variance, is_normal, p_value = _pitchline.estimate(samples, "percentile", level, significance)
    return Estimate(value, variance, is_normal, float("nan") if p_value is None else p_value)


def lilliefors(samples: ArrayLike) -> Normality:
    """Lilliefors' test of normality.

    >>> import numpy as np
    >>> lilliefors(np.random.default_rng(1).exponential(size=100)).p_value < 0.05
    True
    """
    return Normality(*_pitchline.lilliefors(samples))
