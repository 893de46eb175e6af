import numpy as np
import pytest

from pitchline import PitchlineError, cmaes


def rosenbrock(x):
    return (100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2).sum(axis=1)


def test_a_curved_valley_is_followed():
    found = cmaes.minimise(rosenbrock, [[-2.0, 2.0]] * 5, evaluations=8000, seed=3)
    assert found.x == pytest.approx(np.ones(5), abs=1e-4)
    assert found.evaluations == 8000
    assert (np.diff(found.history[:, 1]) <= 0.0).all()


def test_the_same_seed_gives_the_same_search():
    first, second = (cmaes.minimise(rosenbrock, [[-2.0, 2.0]] * 3, evaluations=300, seed=9) for _ in range(2))
    assert (first.x == second.x).all()


def test_a_constraint_holds():
    found = cmaes.minimise(
        lambda x: (x**2).sum(axis=1),
        [[-2.0, 2.0]] * 3,
        constraints=lambda x: np.stack([1.0 - x[:, 0], x[:, 1] - 0.5], axis=1),
        evaluations=3000,
    )
    assert found.violation == 0.0
    assert found.x == pytest.approx([1.0, 0.0, 0.0], abs=1e-3)


def test_a_candidate_without_a_value_ranks_last():
    def holes(x):
        value = (x**2).sum(axis=1)
        return np.where(x[:, 0] < -0.1, np.nan, value)

    found = cmaes.minimise(holes, [[-2.0, 2.0]] * 2, start=[1.0, 1.0], evaluations=600)
    assert found.value < 1e-6


def test_the_best_is_the_best_of_what_was_told():
    search = cmaes.CmaEs([0.5, 0.5], [[0.0, 1.0]] * 2, population=6)
    assert np.isnan(search.best.value)
    first = search.ask()
    assert first.shape == (6, 2)
    search.tell(first[:, 0])
    assert search.best.value == first[:, 0].min()
    assert search.evaluations == 6
    assert search.step < 1.0


def test_wrong_calls_are_explained():
    with pytest.raises(PitchlineError, match="two: lower, upper"):
        cmaes.CmaEs([0.0], [[0.0, 1.0, 2.0]])
    search = cmaes.CmaEs([0.5], [[0.0, 1.0]])
    search.ask()
    with pytest.raises(PitchlineError):
        search.tell([1.0])
