"""How good this project's approaches are beside other tools, at equal numbers of samples.

    python3 -m venv peers && peers/bin/pip install -r crates/lab/peers/requirements.txt
    cargo build --release -p coordinator -p worker
    peers/bin/python crates/lab/peers/peers.py --seeds 1-9 >> results.jsonl
    peers/bin/python crates/lab/peers/peers.py --table results.jsonl

Every tool gets a problem's budget in samples, 25 for a design, and names one design; its true percentile counts. Constraints
are closed formulas that cost no samples, which a campaign's approaches model all the same. `--tools`, `--problems` and `--seeds`
choose; the runs that the file has already are left out with `--resume FILE`.
"""

import argparse
import csv
import io
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
import numpy as np
from scipy.stats.mstats import hdquantiles

sys.path.insert(0, str(Path(__file__).parent))
from problems import PROBLEMS, Z90

SAMPLES = 25
ROOT = Path(__file__).resolve().parents[3]


class Spent(Exception):
    """The budget is used up."""


class Budget:
    """Percentiles of a problem's designs from 25 samples, and how many are left."""

    def __init__(self, problem, seed):
        self.problem, self.left = problem, problem.budget // SAMPLES
        self.rng = np.random.default_rng([seed, 7])

    def estimate(self, x):
        """A percentile and its variance: m + z s where the response is normal, which is more than a user knows, and
        Harrell and Davis' elsewhere."""
        if self.left == 0:
            raise Spent
        self.left -= 1
        y = self.problem.draw(list(map(float, x)), self.rng, SAMPLES)
        if self.problem.is_normal:
            s = y.std(ddof=1)
            return float(y.mean() + Z90 * s), float(s**2 / SAMPLES * (1 + Z90**2 / 2))
        value, variance = hdquantiles(y, [0.9], var=True)[:, 0]
        return float(value), float(variance)

    def scaled(self, u):
        low, high = np.array(self.problem.low, float), np.array(self.problem.high, float)
        return [float(v) for v in low + np.clip(u, 0, 1) * (high - low)]


# --- This project ----------------------------------------------------------------------------------------------------


def campaign(approach):
    """The design that an approach of a campaign recommends."""

    def run(problem, seed):
        designs = problem.budget // SAMPLES
        text = [f'kind = "external"\nformat = 1\nname = "peer"\nseed = {seed}\napproaches = ["{approach}"]']
        for i, (low, high) in enumerate(zip(problem.low, problem.high)):
            text.append(f'[[variables]]\nname = "x{i}"\nlow = {float(low)}\nhigh = {float(high)}')
        text.append('[[responses]]\nname = "y"\n[objective]\nresponse = "y"')
        for i, _ in enumerate(problem.constraints(problem.low)):
            text.append(f'[[constraints]]\nname = "g{i}"\nmax = 0.0')
        search = "[optimise]\nevaluations = 4000\nstarts = 3"
        first = designs
        if approach == "enriched-kriging":
            first = max(designs // 5, 2 * problem.dimension)
            text.append(
                f"[enrichment]\nsamples = {problem.budget}\nrounds = 1000\npoints_per_round = 4\n"
                f"samples_per_point = {SAMPLES}\ntolerance = 0.002"
            )
        elif approach == "direct":
            first = 2 * problem.dimension + 2
            search = f"[optimise]\nevaluations = {designs - first}\nstarts = 1\ndirect = true"
        text.append(f"[doe]\ndesigns = {first}\n[sampling]\nsamples_per_design = {SAMPLES}\n{search}\n[verify]\nsamples = 50")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "peer.toml")
            file.write_text("\n".join(text))
            program = f"exec '{sys.executable}' '{Path(__file__).parent / 'problems.py'}' '{problem.name}'"
            store = str(Path(folder, "peer.db"))
            command = [OPTIONS.programs / "coordinator", "run", file, "--db", store, "--out", Path(folder, "report"), "--exec", program]
            done = subprocess.run([*command, "--workers", "1"], capture_output=True, text=True)
            if done.returncode != 0:
                raise RuntimeError(done.stderr[-2000:])
            export = [OPTIONS.programs / "coordinator", "export", "--db", store, "--table", "optima", "--out", "-"]
            table = subprocess.run(export, capture_output=True, text=True, check=True).stdout
        rows = [row for row in csv.DictReader(io.StringIO(table)) if row["approach"] == approach]
        return [float(rows[0][f"x{i}"]) for i in range(problem.dimension)] if rows else None

    return run


# --- The others ------------------------------------------------------------------------------------------------------


def cma_es(problem, seed):
    """pycma with its noise handling; what breaks a constraint is ranked behind all else, without samples."""
    import cma

    budget = Budget(problem, seed)
    worst = [0.0]

    def cost(u):
        x = budget.scaled(u)
        broken = problem.violation(x)
        if broken > 0:
            return worst[0] + 1 + broken
        value, _ = budget.estimate(x)
        worst[0] = max(worst[0], value)
        return value

    rng = np.random.default_rng(seed)
    best = None
    try:
        while budget.left > 0:
            options = {"bounds": [0, 1], "seed": seed + 1, "verbose": -9}
            search = cma.CMAEvolutionStrategy(rng.random(problem.dimension), 0.3, options)
            noise = cma.NoiseHandler(problem.dimension, maxevals=[1, 1, 30])
            while not search.stop():
                points, values = search.ask_and_eval(cost, evaluations=noise.evaluations)
                search.tell(points, values)
                search.sigma *= noise(points, values, cost, search.ask)
                best = search.result.xfavorite
    except Spent:
        pass
    if best is None:
        return None
    x = budget.scaled(best)
    if problem.violation(x) > 0:
        x = budget.scaled(search.result.xbest)
    return x


def optuna_with(sampler):
    def run(problem, seed):
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        budget = Budget(problem, seed)
        constrained = bool(problem.constraints([float(v) for v in problem.low]))

        def broken(trial):
            return [float(g) for g in problem.constraints([trial.params[f"x{i}"] for i in range(problem.dimension)])]

        settings = {"constraints_func": broken} if constrained else {}
        study = optuna.create_study(sampler=sampler(optuna, seed, settings))

        def cost(trial):
            x = [trial.suggest_float(f"x{i}", l, h) for i, (l, h) in enumerate(zip(problem.low, problem.high))]
            return budget.estimate(x)[0]

        study.optimize(cost, n_trials=budget.left)
        trials = [t for t in study.trials if problem.is_feasible([t.params[f"x{i}"] for i in range(problem.dimension)])]
        if not trials:
            return None
        best = min(trials, key=lambda t: t.value)
        return [best.params[f"x{i}"] for i in range(problem.dimension)]

    return run


def botorch(problem, seed):
    """qLogNEI with the known noise, four designs at a time; the design with the least posterior mean is named."""
    import torch
    from botorch.acquisition.logei import qLogNoisyExpectedImprovement
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from botorch.models.transforms.outcome import Standardize
    from botorch.optim import optimize_acqf
    from gpytorch.mlls import ExactMarginalLogLikelihood

    warnings.simplefilter("ignore")
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    budget = Budget(problem, seed)
    d = problem.dimension
    low = torch.tensor(problem.low, dtype=torch.double)
    span = torch.tensor(problem.high, dtype=torch.double) - low
    box = torch.stack([torch.zeros(d), torch.ones(d)]).double()
    count = len(problem.constraints([float(v) for v in problem.low]))

    def feasible(n, tries=2**14):
        """Random feasible points, nearest ones if there are too few."""
        u = torch.rand(tries, d, dtype=torch.double)
        broken = torch.tensor([problem.violation(budget.scaled(one.numpy())) for one in u]) if count else torch.zeros(tries)
        return u[torch.argsort(broken)[:n]]

    u = feasible(max(2 * d + 2, budget.left // 5)) if count else torch.quasirandom.SobolEngine(d, True, seed).draw(
        max(2 * d + 2, budget.left // 5), dtype=torch.double
    )
    found = [budget.estimate(budget.scaled(one.numpy())) for one in u]
    y = torch.tensor([[-v] for v, _ in found], dtype=torch.double)
    noise = torch.tensor([[v] for _, v in found], dtype=torch.double)
    constraints = [
        (lambda z, i=i: -problem.constraints(low + z * span)[i], True) for i in range(count)
    ] or None
    while True:
        model = SingleTaskGP(u, y, train_Yvar=noise, outcome_transform=Standardize(1))
        fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
        if budget.left == 0:
            break
        value = qLogNoisyExpectedImprovement(model, u, prune_baseline=True)
        q = min(4, budget.left)
        try:
            if count:
                pool = feasible(512)
                with torch.no_grad():
                    start = pool[torch.topk(torch.cat([value(pool[i : i + 64, None]) for i in range(0, len(pool), 64)]), 4).indices]
                new, _ = optimize_acqf(
                    value,
                    box,
                    q=1,
                    num_restarts=len(start),
                    batch_initial_conditions=start[:, None],
                    nonlinear_inequality_constraints=constraints,
                    options={"batch_limit": 1, "maxiter": 50},
                )
            else:
                new, _ = optimize_acqf(value, box, q=q, num_restarts=4, raw_samples=128, sequential=True)
        except Exception:
            new = feasible(q, 256)
        for one in new:
            v, s = budget.estimate(budget.scaled(one.detach().numpy()))
            u = torch.cat([u, one.detach()[None]])
            y = torch.cat([y, torch.tensor([[-v]], dtype=torch.double)])
            noise = torch.cat([noise, torch.tensor([[s]], dtype=torch.double)])
    with torch.no_grad():
        means = model.posterior(u).mean[:, 0]
    order = torch.argsort(means, descending=True)
    for i in order:
        x = budget.scaled(u[i].numpy())
        if problem.is_feasible(x):
            return x
    return None


def smt(problem, seed):
    """SMT's kriging with the known noise of all designs, one shot, and a search for its least mean."""
    from scipy.stats import qmc
    from smt.surrogate_models import KRG

    budget = Budget(problem, seed)
    u = qmc.LatinHypercube(problem.dimension, seed=seed).random(budget.left)
    found = [budget.estimate(budget.scaled(one)) for one in u]
    model = KRG(
        print_global=False,
        theta0=[1e-1] * problem.dimension,
        noise0=[max(v, 1e-12) for _, v in found],
        use_het_noise=True,
        corr="matern52",
    )
    model.set_training_values(u, np.array([v for v, _ in found]))
    model.train()
    import cma

    best = None
    for start in range(3):
        options = {"bounds": [0, 1], "seed": 100 * seed + start + 1, "verbose": -9, "maxfevals": 4000}
        search = cma.CMAEvolutionStrategy(np.random.default_rng([seed, start]).random(problem.dimension), 0.3, options)
        while not search.stop():
            points = search.ask()
            values = model.predict_values(np.array(points))[:, 0]
            broken = [problem.violation(budget.scaled(p)) for p in points]
            search.tell(points, [1e6 * (1 + b) if b > 0 else float(v) for v, b in zip(values, broken)])
        if best is None or search.result.fbest < best[0]:
            best = (search.result.fbest, search.result.xbest)
    return budget.scaled(best[1])


TOOLS = {
    "enriched": campaign("enriched-kriging"),
    "kriging": campaign("kriging"),
    "direct": campaign("direct"),
    "pycma": cma_es,
    "Optuna TPE": optuna_with(lambda optuna, seed, more: optuna.samplers.TPESampler(seed=seed, **more)),
    "Optuna GP": optuna_with(lambda optuna, seed, more: optuna.samplers.GPSampler(seed=seed, **more)),
    "BoTorch": botorch,
    "SMT": smt,
}


def processor_time():
    """Processor time of this process and the programs it ran, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def one(job):
    """A run's record."""
    tool, name, seed = job
    problem = PROBLEMS[name]
    warnings.simplefilter("ignore")
    begun = processor_time()
    try:
        x = TOOLS[tool](problem, seed)
        why = None if x is not None else "no feasible design"
    except Exception as error:  # a tool that fails loses its run, and says why
        x, why = None, f"{type(error).__name__}: {error}"
    held = x is not None and problem.is_feasible(x)
    record = {"tool": tool, "problem": name, "seed": seed, "x": x, "percentile": problem.truth(x) if held else None}
    record["broken"] = problem.violation(x) if x is not None else None
    record["seconds"] = round(processor_time() - begun, 2)
    if why:
        record["why"] = why
    return record


def table(path):
    """Medians in Markdown: how far above the optimum, in per cent of it; the best is bold."""
    runs = [json.loads(line) for line in Path(path).read_text().splitlines()]
    tools = [tool for tool in TOOLS if any(run["tool"] == tool for run in runs)]
    print("| problem (optimum) | " + " | ".join(tools) + " | enriched against the best |")
    print("|---|" + "---:|" * (len(tools) + 1))
    reached = 0
    for name, problem in PROBLEMS.items():
        medians, cells = {}, []
        for tool in tools:
            held = [run for run in runs if run["tool"] == tool and run["problem"] == name]
            values = sorted(math.inf if run["percentile"] is None else run["percentile"] for run in held)
            medians[tool] = statistics.median_low(values) if values else math.inf
            greatest = values[-1] if values else math.inf
            text = "–" if math.isinf(medians[tool]) else f"{medians[tool]:.3f} (–{greatest:.3f})"
            cells.append(text.replace("–inf", "–∞") + (f" [{len(values)}]" if values else ""))
        best = min(medians.values())
        cells = [f"**{cell}**" if medians[tool] == best else cell for tool, cell in zip(tools, cells)]
        share = medians.get("enriched", math.inf) / best - 1
        reached += share <= 0.02
        print(f"| {name} ({problem.optimum:.3f}) | " + " | ".join(cells) + f" | {100 * share:+.1f} % |")
    print(f"\nBest or within 2 % of the best on {reached} of {len(PROBLEMS)}.")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tools", default=",".join(TOOLS))
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    parser.add_argument("--seeds", default="1-9")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--programs", type=Path, default=ROOT / "target/release")
    parser.add_argument("--resume", metavar="FILE")
    parser.add_argument("--table", metavar="FILE")
    global OPTIONS
    OPTIONS = parser.parse_args()
    if OPTIONS.table:
        return table(OPTIONS.table)
    first, _, last = OPTIONS.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    held = set()
    if OPTIONS.resume and Path(OPTIONS.resume).exists():
        for line in Path(OPTIONS.resume).read_text().splitlines():
            run = json.loads(line)
            held.add((run["tool"], run["problem"], run["seed"]))
    jobs = [(t, p, s) for t in OPTIONS.tools.split(",") for p in OPTIONS.problems.split(",") for s in seeds]
    jobs = [job for job in jobs if job not in held]
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(OPTIONS.jobs, mp_context=get_context("fork")) as pool:
        for record in pool.map(one, jobs):
            print(json.dumps(record), flush=True)


if __name__ == "__main__":
    main()
