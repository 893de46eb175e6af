"""Designs of experiments in the unit box.

>>> from pitchline import doe
>>> x = doe.maximin(20, 3, seed=7)
>>> x.shape
(20, 3)
>>> doe.smallest_distance(x) > doe.smallest_distance(doe.random(20, 3, seed=7))
True
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pitchline import _pitchline

__all__ = ["discrepancy", "enlarge", "maximin", "random", "scale", "smallest_distance", "sobol"]

Points = NDArray[np.float64]


def maximin(n: int, d: int, *, seed: int = 1, effort: float = 1.0) -> Points:
    """A Latin hypercube whose points lie far apart.

    :param n: number of points, 2 to 100 000
    :param d: number of variables, 1 to 20
    :param seed: of every random number
    :param effort: time of the search as a multiple of its default; 0 is a random hypercube
    :returns: shape (n, d), within 0 and 1

    >>> maximin(4, 1, seed=1).shape
    (4, 1)
    """
    return _pitchline.design("maximin", n, d, seed, effort)


def random(n: int, d: int, *, seed: int = 1) -> Points:
    """A random Latin hypercube, shape (n, d).

    >>> x = random(4, 1)
    >>> sorted((4 * x[:, 0]).astype(int).tolist())
    [0, 1, 2, 3]
    """
    return _pitchline.design("random", n, d, seed, 0.0)


def sobol(n: int, d: int, *, seed: int = 1) -> Points:
    """The first points of a scrambled Sobol' sequence, shape (n, d).

    >>> bool((sobol(8, 2) < 1.0).all())
    True
    """
    return _pitchline.design("sobol", n, d, seed, 0.0)


def enlarge(x: ArrayLike, n: int, *, kind: str = "maximin", seed: int = 1, effort: float = 1.0) -> Points:
    """A design of ``n`` points that begins with the points of ``x``, shape (n, d).

    :param kind: ``"maximin"``, ``"random"`` or ``"sobol"``; a Sobol' sequence continues its own points alone

    >>> x = maximin(10, 2)
    >>> bool((enlarge(x, 15)[:10] == x).all())
    True
    """
    return _pitchline.enlarge(kind, x, n, seed, effort)


def scale(x: ArrayLike, bounds: ArrayLike) -> Points:
    """Points of the unit box between ``bounds``, shape (d, 2): lower, upper.

    >>> scale([[0.0, 0.5]], [[1.0, 2.0], [10.0, 20.0]]).tolist()
    [[1.0, 15.0]]
    """
    low, high = np.asarray(bounds, dtype=float).T
    scaled: Points = low + np.asarray(x, dtype=float) * (high - low)
    return scaled


def smallest_distance(x: ArrayLike) -> float:
    """The smallest Euclidean distance between two points.

    >>> smallest_distance([[0.0, 0.0], [0.0, 0.5], [1.0, 1.0]])
    0.5
    """
    return _pitchline.distance(x)


def discrepancy(x: ArrayLike) -> float:
    """The centred L2 discrepancy: how far the points are from even.

    >>> discrepancy(sobol(64, 2)) < discrepancy(random(64, 2))
    True
    """
    return _pitchline.discrepancy(x)
