"""Speed and accuracy beside other packages, as a Markdown table: ``python python/benches/speed.py``.

The packages are those of ``requirements.txt``. Times are medians of repetitions in turn, so that a busy machine slows
all of them. Nothing here is tuned to the test functions: every package has its own defaults, except for the options
that a row names.
"""

from __future__ import annotations

import contextlib
import io
import os
import statistics
import time
import warnings
from collections.abc import Callable

import cma
import numpy as np
from scipy.stats import qmc
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from smt.sampling_methods import LHS
from smt.surrogate_models import KRG

from pitchline import cmaes, doe, stats
from pitchline.kriging import Kriging

#: A task done by one package, which returns a description of its result.
Task = Callable[[], str]


def compared(title: str, tasks: dict[str, Task], repetitions: int) -> None:
    """A row for each package: median seconds, the ratio to ours, and what was found."""
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    found = {}
    for _ in range(repetitions):
        for name, task in tasks.items():
            start = time.perf_counter()
            with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
                warnings.simplefilter("ignore")
                found[name] = task()
            seconds[name].append(time.perf_counter() - start)
    ours = statistics.median(seconds["pitchline"])
    for name, measured in seconds.items():
        median = statistics.median(measured)
        print(f"| {title} | {name} | {median:.3g} s | {median / ours:.2g} | {found[name]} |", flush=True)


def truth(x: np.ndarray) -> np.ndarray:
    """A smooth function of five variables and an idle one (J. H. Friedman, Ann. Stat. 19, 1991)."""
    return (
        10.0 * np.sin(np.pi * x[:, 0] * x[:, 1]) + 20.0 * (x[:, 2] - 0.5) ** 2 + 10.0 * x[:, 3] + 5.0 * x[:, 4]
    )


def rosenbrock(x: np.ndarray) -> np.ndarray:
    """Rosenbrock's function of rows."""
    return (100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2).sum(axis=1)


def designs() -> None:
    n, d = 300, 10
    box = np.array([[0.0, 1.0]] * d)
    compared(
        f"maximin Latin hypercube, {n} × {d}",
        {
            "pitchline": lambda: f"distance {doe.smallest_distance(doe.maximin(n, d)):.3f}",
            "SMT, ese": lambda: f"distance {doe.smallest_distance(LHS(xlimits=box, criterion='ese', seed=1)(n)):.3f}",
            "SciPy, random-cd": lambda: "distance "
            f"{doe.smallest_distance(qmc.LatinHypercube(d, optimization='random-cd', rng=1).random(n)):.3f}",
        },
        3,
    )


def models() -> None:
    n, d = 250, 6
    rng = np.random.default_rng(1)
    x = doe.maximin(n, d, seed=2)
    variance = 0.25
    y = truth(x) + rng.normal(size=n) * np.sqrt(variance)
    at = doe.random(5000, d, seed=3)
    expected = truth(at)

    def judged(mean: np.ndarray, sd: np.ndarray) -> str:
        error = np.sqrt(np.mean((mean - expected) ** 2))
        inside = np.mean(np.abs(mean - expected) < 1.644854 * sd)
        return f"error {error:.3f}, {inside:.0%} in 90 % intervals"

    kernel = ConstantKernel(1.0, (1e-3, 1e6)) * Matern(np.ones(d), (1e-2, 1e3), nu=2.5)

    def ours(kernel: str, variance: float | None) -> str:
        return judged(*Kriging(kernel=kernel).fit(x, y, noise_variance=variance).predict(at, return_std=True))

    def known() -> str:
        peer = GaussianProcessRegressor(kernel, alpha=variance).fit(x, y)
        return judged(*peer.predict(at, return_std=True))

    def white() -> str:
        peer = GaussianProcessRegressor(kernel + WhiteKernel()).fit(x, y)
        mean, sd = peer.predict(at, return_std=True)
        return judged(mean, np.sqrt(np.maximum(sd**2 - peer.kernel_.k2.noise_level, 0.0)))

    def smt() -> str:
        peer = KRG(corr="matern52", eval_noise=True, print_global=False, seed=1)
        peer.set_training_values(x, y)
        peer.train()
        return judged(peer.predict_values(at)[:, 0], np.sqrt(peer.predict_variances(at)[:, 0]))

    # The kernel of scikit-learn is the radial one, that of SMT the product over the variables.
    product, radial = "matern-5-2", "radial-matern-5-2"
    compared(
        f"kriging with known noise, {n} × {d}, and 5000 predictions",
        {
            "pitchline": lambda: ours(product, variance),
            "pitchline, radial": lambda: ours(radial, variance),
            "scikit-learn": known,
        },
        3,
    )
    compared(
        f"kriging with estimated noise, {n} × {d}, and 5000 predictions",
        {
            "pitchline": lambda: ours(product, None),
            "pitchline, radial": lambda: ours(radial, None),
            "scikit-learn": white,
            "SMT": smt,
        },
        3,
    )


def searches() -> None:
    d, evaluations = 10, 6000
    box = [[-3.0, 3.0]] * d

    def ours() -> str:
        return f"value {cmaes.minimise(rosenbrock, box, start=np.zeros(d), evaluations=evaluations).value:.2g}"

    def pycma() -> str:
        options = {"bounds": [-3.0, 3.0], "maxfevals": evaluations, "verbose": -9, "seed": 1}
        search = cma.CMAEvolutionStrategy(np.zeros(d), 1.8, options)
        while not search.stop():
            x = search.ask()
            search.tell(x, rosenbrock(np.array(x)).tolist())
        return f"value {search.result.fbest:.2g} after {search.result.evaluations} evaluations"

    compared(f"CMA-ES on Rosenbrock's function, d = {d}, {evaluations} evaluations", {"pitchline": ours, "pycma": pycma}, 5)


def calls() -> None:
    """The cost of a call besides its computation."""
    x = doe.maximin(30, 2)
    model = Kriging(starts=1).fit(x, x.sum(axis=1), noise_variance=1e-4)
    search = cmaes.CmaEs([0.5, 0.5], [[0.0, 1.0]] * 2)
    one = np.array([[0.3, 0.4]])
    samples = np.linspace(0.0, 1.0, 30)

    def generation() -> None:
        search.tell(search.ask()[:, 0])

    for name, call in [
        ("one prediction", lambda: model.predict(one)),
        ("one prediction, with its deviation", lambda: model.predict(one, return_std=True)),
        ("a generation of CMA-ES, asked and told", generation),
        ("the percentile of 30 samples", lambda: stats.percentile(samples)),
        ("the distance of two points", lambda: doe.smallest_distance(one)),
    ]:
        times = []
        for _ in range(50):
            start = time.perf_counter()
            for _ in range(40):
                call()
            times.append((time.perf_counter() - start) / 40)
        print(f"| {name} | {1e6 * statistics.median(times):.1f} µs |", flush=True)


if __name__ == "__main__":
    print(f"{os.cpu_count()} processors\n")
    print("| task | package | time | of ours | result |\n|---|---|---:|---:|---|")
    designs()
    models()
    searches()
    print("\n| call | time |\n|---|---:|")
    calls()
