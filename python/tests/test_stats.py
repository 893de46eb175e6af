import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitchline import PitchlineError, stats

samples = st.lists(st.floats(-1e6, 1e6), min_size=30, max_size=200)


@given(samples, st.floats(0.1, 0.9))
def test_a_percentile_lies_in_its_interval_and_among_the_samples(samples, level):
    found = stats.percentile(samples, level)
    assert found.samples == len(samples)
    assert min(samples) <= found.value <= max(samples)
    assert not found.low > found.value
    assert not found.high < found.value


def test_intervals_cover_as_often_as_they_say():
    rng = np.random.default_rng(3)
    truth = 1.2815515655446004
    found = [stats.percentile(rng.normal(size=200), 0.9, confidence=0.9) for _ in range(1000)]
    share = np.mean([one.low <= truth <= one.high for one in found])
    assert 0.87 < share < 0.96


def test_without_skewness_the_mean_has_the_interval_of_students_t():
    samples = np.linspace(-1.0, 1.0, 101)
    found = stats.mean(samples)
    # t of 100 degrees of freedom at 0.975, times the standard error
    assert found.value == pytest.approx(0.0, abs=1e-15)
    assert found.high == pytest.approx(1.983972 * samples.std(ddof=1) / np.sqrt(101), rel=1e-6)
    assert np.isnan(stats.mean([1.0, 2.0]).low)


def test_paired_samples_have_a_short_interval():
    rng = np.random.default_rng(1)
    x = rng.normal(size=2000)
    found = stats.difference(x + 0.1 + 0.01 * rng.normal(size=2000), x)
    assert 0.08 < found.low < 0.1 < found.high < 0.12


def test_few_samples_choose_their_estimator():
    rng = np.random.default_rng(5)
    assert stats.estimate(rng.normal(size=30)).is_normal
    skewed = stats.estimate(rng.exponential(size=60) ** 3)
    assert not skewed.is_normal
    assert skewed.p_value < 0.05


def test_what_is_no_sample_is_refused():
    with pytest.raises(PitchlineError):
        stats.percentile([])
    with pytest.raises(PitchlineError):
        stats.percentile([1.0, math.nan])
