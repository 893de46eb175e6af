import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitchline import PitchlineError, doe


@given(n=st.integers(2, 40), d=st.integers(1, 6), seed=st.integers(0, 2**64 - 1))
def test_a_hypercube_has_one_point_in_each_slice(n, d, seed):
    for x in (doe.random(n, d, seed=seed), doe.maximin(n, d, seed=seed, effort=0.1)):
        assert x.shape == (n, d)
        slices = np.sort((n * x).astype(int), axis=0)
        assert (slices == np.arange(n)[:, None]).all()


@given(n=st.integers(2, 20), more=st.integers(1, 20), d=st.integers(1, 4))
def test_an_enlarged_design_keeps_its_points(n, more, d):
    x = doe.random(n, d)
    assert (doe.enlarge(x, n + more, effort=0.1)[:n] == x).all()


def test_distance_is_that_of_numpy():
    x = doe.maximin(30, 4)
    pairs = np.linalg.norm(x[:, None] - x[None, :], axis=2)
    assert doe.smallest_distance(x) == pytest.approx(pairs[~np.eye(30, dtype=bool)].min(), rel=1e-14)


def test_points_of_any_layout_are_read():
    x = doe.sobol(16, 3)
    assert doe.discrepancy(np.asfortranarray(x)) == doe.discrepancy(x) == doe.discrepancy(x.tolist())


def test_wrong_sizes_are_refused_with_the_range():
    with pytest.raises(PitchlineError, match="1 points requested: 2 to 100000 are possible"):
        doe.maximin(1, 2)
    with pytest.raises(PitchlineError, match="unknown variant"):
        doe.enlarge([[0.5], [0.6]], 4, kind="grid")
