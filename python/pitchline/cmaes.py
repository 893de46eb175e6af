"""CMA-ES within bounds, with constraints and restarts.

Ask and tell:

>>> from pitchline import cmaes
>>> search = cmaes.CmaEs([1.0, 1.0], [[-2.0, 2.0], [-2.0, 2.0]], seed=1)
>>> while search.stop is None:
...     x = search.ask()
...     search.tell((x**2).sum(axis=1))
>>> search.best.value < 1e-9
True

Or all at once:

>>> found = cmaes.minimise(lambda x: (x**2).sum(axis=1), [[-2.0, 2.0]] * 2, evaluations=500)
>>> found.value < 1e-9
True
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pitchline import _pitchline

__all__ = ["Best", "CmaEs", "Minimum", "Restart", "Run", "minimise"]

Points = NDArray[np.float64]


class Best(NamedTuple):
    """The best evaluation that was told."""

    x: Points
    value: float
    #: the constraint violation; 0 if all constraints hold
    violation: float


class Restart(NamedTuple):
    """Where a search ended and the next began."""

    evaluations: int
    cause: str


class Minimum(NamedTuple):
    """The result of a run."""

    x: Points
    value: float
    #: the constraint violation; 0 if all constraints hold
    violation: float
    evaluations: int
    #: columns evaluations, value, violation: a row for each improvement
    history: Points
    restarts: list[Restart]


class CmaEs:
    """A search without restarts, which ends at the causes of N. Hansen's tutorial (arXiv:1604.00772).

    :param start: the first mean, d numbers within the bounds
    :param bounds: shape (d, 2): lower, upper
    :param population: candidates of a generation; 4 + 3 ln d if absent
    :param parents: the best ones, which move the mean; half of the population if absent
    :param step: the first standard deviation as a share of each range
    :param seed: of every random number
    """

    def __init__(
        self,
        start: ArrayLike,
        bounds: ArrayLike,
        *,
        population: int | None = None,
        parents: int | None = None,
        step: float = 0.3,
        seed: int = 1,
    ) -> None:
        self._search = _pitchline.Search(start, bounds, population, parents, step, seed)

    def ask(self) -> Points:
        """The candidates of the next generation, shape (population, d). Asked again, it draws others in their place."""
        return self._search.ask()

    def tell(self, values: ArrayLike, violations: ArrayLike | None = None) -> None:
        """The values of the candidates, in their order.

        :param values: NaN or infinity for a candidate that has none; it ranks last
        :param violations: by how much each exceeds the constraints, 0 for none: those with a smaller one rank first
        """
        self._search.tell(values, violations)

    @property
    def stop(self) -> str | None:
        """Why the search has ended; ``None`` while it goes on."""
        return self._search.stop()

    @property
    def best(self) -> Best:
        """The best candidate so far; the start and NaN before the first was told."""
        best = self._search.best()
        nan = float("nan")
        return Best(self.mean, nan, nan) if best is None else Best(*best)

    @property
    def mean(self) -> Points:
        """The mean of the distribution, d numbers."""
        return self._search.mean()

    @property
    def step(self) -> float:
        """The step size, as a share of the ranges."""
        return self._search.step()

    @property
    def evaluations(self) -> int:
        """The number of values told."""
        return self._search.evaluations()


class Run:
    """Searches one after another within a number of evaluations; the arguments are those of :class:`CmaEs`, and

    :param evaluations: the number of all values that will be told
    :param restarts: ``"from-best"``, ``"ipop"`` (from anywhere with twice the population) or ``"bipop"``

    >>> run = Run([1.0], [[-2.0, 2.0]], evaluations=200)
    >>> while not run.is_finished:
    ...     run.tell(run.ask()[:, 0] ** 2)
    >>> run.result().value < 1e-6
    True
    """

    def __init__(
        self,
        start: ArrayLike,
        bounds: ArrayLike,
        *,
        evaluations: int,
        restarts: str = "ipop",
        population: int | None = None,
        parents: int | None = None,
        step: float = 0.3,
        seed: int = 1,
    ) -> None:
        self._run = _pitchline.Run(start, bounds, population, parents, step, evaluations, restarts, seed)

    def ask(self) -> Points:
        """The next candidates, shape (n, d); the last ones of a run may be fewer than a population."""
        return self._run.ask()

    def tell(self, values: ArrayLike, violations: ArrayLike | None = None) -> None:
        """As :meth:`CmaEs.tell`."""
        self._run.tell(values, violations)

    @property
    def is_finished(self) -> bool:
        """Whether all evaluations are told."""
        return self._run.is_finished()

    def result(self) -> Minimum:
        """The best so far."""
        x, value, violation, evaluations, history, restarts = self._run.outcome()
        rows = np.array(history, dtype=float).reshape(-1, 3)
        return Minimum(x, value, violation, evaluations, rows, [Restart(*one) for one in restarts])


def minimise(
    function: Callable[[Points], ArrayLike],
    bounds: ArrayLike,
    *,
    start: ArrayLike | None = None,
    constraints: Callable[[Points], ArrayLike] | None = None,
    evaluations: int = 1000,
    restarts: str = "ipop",
    population: int | None = None,
    parents: int | None = None,
    step: float = 0.3,
    seed: int = 1,
) -> Minimum:
    """The minimum of a function of many points at once.

    :param function: takes points of shape (n, d), returns n values
    :param start: the first mean; the middle of the bounds if absent
    :param constraints: takes points of shape (n, d), returns shape (n,) or (n, m): a constraint holds where its number
        is not positive

    The other arguments are those of :class:`Run`.

    >>> found = minimise(
    ...     lambda x: x[:, 0] + x[:, 1],
    ...     [[0.0, 1.0]] * 2,
    ...     constraints=lambda x: 0.5 - x[:, 0],
    ... )
    >>> found.x.round(6).tolist()
    [0.5, 0.0]
    """
    limits = np.asarray(bounds, dtype=float)
    run = Run(
        limits.mean(axis=1) if start is None else start,
        limits,
        evaluations=evaluations,
        restarts=restarts,
        population=population,
        parents=parents,
        step=step,
        seed=seed,
    )
    while not run.is_finished:
        x = run.ask()
        violations = None
        if constraints is not None:
            exceeded = np.maximum(np.asarray(constraints(x), dtype=float), 0.0)
            violations = exceeded.reshape(len(x), -1).sum(axis=1)
        run.tell(function(x), violations)
    return run.result()
