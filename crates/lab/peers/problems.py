"""Ten problems of optimisation under noise, whose optima are known.

Every problem asks for the design whose 90th percentile of a random response is least, within a box and under deterministic
constraints g(x) <= 0. As a program, `problems.py NAME` answers a campaign's requests on standard input.
"""

import json
import math
import sys
from dataclasses import dataclass
from typing import Callable

import numpy as np

Z90 = 1.2815515655446004


@dataclass
class Problem:
    """A problem and its budget in samples; constraints and means take anything that has arithmetic."""

    name: str
    low: list
    high: list
    budget: int
    draw: Callable  # (x, rng, n) -> n samples
    truth: Callable  # x -> the percentile
    optimum: float  # the least percentile, by long searches on the true one
    constraints: Callable = lambda x: []
    is_normal: bool = False  # whether the response is
    chosen_on: bool = False  # whether settings were chosen with it

    @property
    def dimension(self):
        return len(self.low)

    def violation(self, x):
        return sum(max(0.0, float(g)) for g in self.constraints(x))

    def is_feasible(self, x):
        return all(float(g) <= 1e-9 for g in self.constraints(x))


def normal(mean, sd):
    """Samples and percentile of a normal response."""
    return (
        lambda x, rng, n: mean(x) + sd(x) * rng.standard_normal(n),
        lambda x: float(mean(x) + Z90 * sd(x)),
    )


def simulated(response, inputs, n=100_000):
    """Samples of `response(x, z)` with z standard normal, and their percentile from samples of its own."""
    fixed = np.random.default_rng(1).standard_normal((n, inputs))

    def draw(x, rng, n):
        return response(x, rng.standard_normal((n, inputs)))

    return draw, lambda x: float(np.quantile(response(x, fixed), 0.9))


# --- The six of the study -------------------------------------------------------------------------------------------


def branin():
    def mean(x):
        a = x[1] - 5.1 / (4 * math.pi**2) * x[0] ** 2 + 5 / math.pi * x[0] - 6
        return (a * a + 10 * (1 - 1 / (8 * math.pi)) * math.cos(x[0]) + 10) / 10

    def sd(x):
        near = math.exp(-((x[0] - math.pi) ** 2 + (x[1] - 2.275) ** 2) / 8)
        return 0.3 + 2 * near + 0.6 * (x[0] + 5) / 15

    return Problem("branin", [-5, 0], [10, 15], 1500, *normal(mean, sd), 0.51815, is_normal=True)


def lognormal():
    def mean(x):
        return 1 + 3 * (x[0] - 0.3) ** 2 + 2 * (x[1] - 0.7) ** 2 + (x[2] - 0.5) ** 2

    def sigma(x):
        return 0.2 + 1.2 * x[0] * (1 - x[1]) + 0.8 * x[2] ** 2

    return Problem(
        "lognormal",
        [0] * 3,
        [1] * 3,
        2000,
        lambda x, rng, n: mean(x) + np.exp(sigma(x) * rng.standard_normal(n)),
        lambda x: mean(x) + math.exp(Z90 * sigma(x)),
        2.56799,
    )


def jump():
    def mean(x):
        return 3 * (1 - x[0]) + 4 * (x[1] - 0.4) ** 2

    def draw(x, rng, n):
        return mean(x) + 0.1 * rng.standard_normal(n) + 10 * (rng.random(n) < 0.3 * x[0])

    def truth(x):
        from scipy.optimize import brentq
        from scipy.stats import norm

        p = 0.3 * x[0]
        excess = lambda q: (1 - p) * norm.cdf(q / 0.1) + p * norm.cdf((q - 10) / 0.1) - 0.9
        return mean(x) + brentq(excess, -1, 12)

    return Problem("rare jump", [0, 0], [1, 1], 2000, draw, truth, 2.30125)


def beam():
    def response(x, z):
        h, l, t, b = (x[i] * (1 + 0.01 * z[:, i]) for i in range(4))
        load = 6000 * np.exp(0.15 * z[:, 4] - 0.15**2 / 2)
        youngs = 30e6 * (1 + 0.03 * z[:, 5])
        shear_limit = 13600 * (1 + 0.08 * z[:, 6])
        stress_limit = 30000 * (1 + 0.06 * z[:, 7])
        length, shear_modulus = 14.0, 12e6
        direct = load / (math.sqrt(2) * h * l)
        radius = np.sqrt(l**2 / 4 + ((h + t) / 2) ** 2)
        polar = 2 * math.sqrt(2) * h * l * (l**2 / 12 + ((h + t) / 2) ** 2)
        torsion = load * (length + l / 2) * radius / polar
        shear = np.sqrt(direct**2 + direct * torsion * l / radius + torsion**2)
        bending = 6 * load * length / (b * t**2)
        deflection = 4 * load * length**3 / (youngs * t**3 * b)
        slenderness = 1 - t / (2 * length) * np.sqrt(youngs / (4 * shear_modulus))
        buckling = 4.013 * youngs * np.sqrt(t**2 * b**6 / 36) / length**2 * slenderness
        each = [shear / shear_limit, bending / stress_limit, deflection / 0.25, load / buckling]
        return np.max(each, axis=0)

    def constraints(x):
        cost = 1.10471 * x[0] ** 2 * x[1] + 0.04811 * x[2] * x[3] * (14 + x[1])
        return [cost - 3, x[0] - x[3]]

    low, high = [0.125, 0.1, 0.1, 0.125], [2, 10, 10, 2]
    return Problem("welded beam", low, high, 2500, *simulated(response, 8), 0.71028, constraints)


def impact():
    """Youn and Choi's car: the pubic force, with nine limits and at most 25 kg at the mean; both materials are strong."""
    mild = 0.345

    def force(x, x10, x11):
        return 4.72 - 0.5 * x[3] - 0.19 * x[1] * x[2] - 0.0122 * x[3] * x10 + 0.009325 * x[5] * x10 + 0.000191 * x11**2

    def response(x, z):
        inner = [x[i] + 0.03 * z[:, i] for i in range(7)]
        return force(inner, 10 * z[:, 7], 10 * z[:, 8])

    def constraints(x):
        x1, x2, x3, x4, x5, x6, x7 = (x[i] for i in range(7))
        return [
            1.16 - 0.3717 * x2 * x4 - 0.484 * x3 * mild - 1,
            0.261 - 0.0159 * x1 * x2 - 0.188 * x1 * mild - 0.019 * x2 * x7 + 0.0144 * x3 * x5 + 0.08045 * x6 * mild - 0.32,
            0.214 + 0.00817 * x5 - 0.131 * x1 * mild - 0.0704 * x1 * mild + 0.03099 * x2 * x6 - 0.018 * x2 * x7
            + 0.0208 * x3 * mild + 0.121 * x3 * mild - 0.00364 * x5 * x6 - 0.018 * x2 * x2 - 0.32,
            0.74 - 0.61 * x2 - 0.163 * x3 * mild - 0.166 * x7 * mild + 0.227 * x2 * x2 - 0.32,
            (28.98 + 3.818 * x3 - 4.2 * x1 * x2 + 6.63 * x6 * mild - 7.77 * x7 * mild - 32) / 10,
            (33.86 + 2.95 * x3 - 5.057 * x1 * x2 - 11 * x2 * mild - 9.98 * x7 * mild + 22 * mild * mild - 32) / 10,
            (46.36 - 9.9 * x2 - 12.9 * x1 * mild - 32) / 10,
            10.58 - 0.674 * x1 * x2 - 1.95 * x2 * mild - 9.9,
            16.45 - 0.489 * x3 * x7 - 0.843 * x5 * x6 - 15.7,
            (1.98 + 4.9 * x1 + 6.67 * x2 + 6.98 * x3 + 4.01 * x4 + 1.78 * x5 + 2.73 * x7 - 25) / 10,
        ]

    low = [0.5, 0.45, 0.5, 0.5, 0.875, 0.4, 0.4]
    high = [1.5, 1.35, 1.5, 1.5, 2.625, 1.2, 1.2]
    return Problem("side impact", low, high, 3000, *simulated(response, 9), 3.96255, constraints)


def ten():
    rng = np.random.default_rng(10)
    rotation, _ = np.linalg.qr(rng.standard_normal((10, 10)))
    matrix = rotation @ np.diag(np.linspace(1, 20, 10)) @ rotation.T
    centre, calm = rng.uniform(-0.5, 0.5, 10), rng.uniform(-0.8, 0.8, 10)
    mean = lambda x: float((np.asarray(x) - centre) @ matrix @ (np.asarray(x) - centre))
    sd = lambda x: 0.2 + float(np.sum((np.asarray(x) - calm) ** 2)) / 3
    constraints = lambda x: [sum(x[i] for i in range(10)) - 0.5]
    return Problem("ten variables", [-1] * 10, [1] * 10, 6000, *normal(mean, sd), 1.53648, constraints, is_normal=True)


# --- Four of the literature, which settings were chosen with ---------------------------------------------------------


def camel_mean(x):
    a, b = x[0], x[1]
    return 2 + (4 - 2.1 * a * a + a**4 / 3) * a * a + a * b + (-4 + 4 * b * b) * b * b


def camel():
    def sd(x):
        return 0.2 + 0.5 * (1 - math.exp(-((x[0] - 0.09) ** 2) - (x[1] + 0.71) ** 2))

    return Problem("camel", [-2, -1], [2, 1], 1500, *normal(camel_mean, sd), 1.22469, is_normal=True, chosen_on=True)


def gomez():
    def constraints(x):
        sin = lambda v: v.sin() if hasattr(v, "sin") else math.sin(v)  # a tensor has its own
        return [-sin(4 * math.pi * x[0]) + 2 * sin(2 * math.pi * x[1]) ** 2]

    sd = lambda x: 0.15 + 0.15 * (x[0] + 1)
    return Problem("gomez", [-1, -1], [1, 1], 1500, *normal(camel_mean, sd), 1.43355, constraints, is_normal=True, chosen_on=True)


def hartmann():
    alpha = np.array([1.0, 1.2, 3.0, 3.2])
    a = np.array(
        [[10, 3, 17, 3.5, 1.7, 8], [0.05, 10, 17, 0.1, 8, 14], [3, 3.5, 1.7, 10, 17, 8], [17, 8, 0.05, 10, 0.1, 14]]
    )
    p = 1e-4 * np.array(
        [
            [1312, 1696, 5569, 124, 8283, 5886],
            [2329, 4135, 8307, 3736, 1004, 9991],
            [2348, 1451, 3522, 2883, 3047, 6650],
            [4047, 8828, 8732, 5743, 1091, 381],
        ]
    )
    mean = lambda x: 4 - float(alpha @ np.exp(-np.sum(a * (np.asarray(x) - p) ** 2, axis=1)))
    sd = lambda x: 0.15 + 0.4 * x[2] * x[2]
    return Problem("hartmann", [0] * 6, [1] * 6, 4000, *normal(mean, sd), 0.98015, is_normal=True, chosen_on=True)


def levy():
    def mean(x):
        w = [1 + (v - 1) / 4 for v in x]
        inner = sum((v - 1) ** 2 * (1 + 10 * math.sin(math.pi * v + 1) ** 2) for v in w[:-1])
        last = (w[-1] - 1) ** 2 * (1 + math.sin(2 * math.pi * w[-1]) ** 2)
        return 1 + math.sin(math.pi * w[0]) ** 2 + inner + last

    sd = lambda x: 0.3 + 0.05 * abs(x[0] - x[1])
    return Problem("levy", [-5] * 4, [5] * 4, 3000, *normal(mean, sd), 1.38447, is_normal=True, chosen_on=True)


PROBLEMS = {p.name: p for p in (branin(), lognormal(), jump(), beam(), impact(), ten(), camel(), gomez(), hartmann(), levy())}


def serve(problem):
    """Answers a campaign's requests."""
    names = [f"x{i}" for i in range(problem.dimension)]
    for line in sys.stdin:
        request = json.loads(line)
        answer = {"id": request["id"]}
        if request["request"] == "describe":
            answer["protocol"] = request["protocol"]
        else:
            x = [request["design"][name] for name in names]
            if request["request"] == "evaluate":
                answer.update({f"g{i}": float(g) for i, g in enumerate(problem.constraints(x))})
            else:
                rng = np.random.default_rng(request["seed"])
                answer["y"] = float(problem.draw(x, rng, 1)[0])
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    serve(PROBLEMS[sys.argv[1]])
