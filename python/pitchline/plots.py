"""Plots of the usual questions with matplotlib. Each takes axes, or makes new ones, and returns them.

>>> import matplotlib
>>> matplotlib.use("Agg")
>>> import numpy as np
>>> from pitchline import cmaes, plots
>>> found = cmaes.minimise(lambda x: (x**2).sum(axis=1), [[-2.0, 2.0]] * 2, evaluations=200)
>>> axes = plots.convergence(found)
>>> axes.get_xlabel()
'evaluations'
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import ArrayLike

from pitchline.cmaes import Minimum
from pitchline.gear import Pair
from pitchline.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pitchline.kriging import Kriging

__all__ = ["convergence", "parallel_coordinates", "slices", "transmission_error", "verification"]


def _axes(axes: Axes | None) -> Axes:
    return plt.subplots(layout="constrained")[1] if axes is None else axes


def convergence(found: Results | Minimum, axes: Axes | None = None) -> Axes:
    """The best objective so far over the evaluations: of every run of a campaign, or of one search."""
    axes = _axes(axes)
    if isinstance(found, Minimum):
        axes.step(found.history[:, 0], found.history[:, 1], where="post")
    else:
        colours: dict[str, Any] = {}
        for run in found.runs:
            label = None if run.approach in colours else run.approach
            (line,) = axes.step(*run.history.T, where="post", label=label, color=colours.get(run.approach))
            colours[run.approach] = line.get_color()
        axes.legend()
    # The first evaluations are by far the worst.
    axes.set_xscale("log")
    if all(np.all(np.asarray(line.get_ydata(), dtype=float) > 0.0) for line in axes.get_lines()):
        axes.set_yscale("log")
    axes.set_xlabel("evaluations")
    axes.set_ylabel("best objective so far")
    return axes


def slices(
    model: Kriging,
    at: ArrayLike,
    bounds: ArrayLike,
    *,
    names: list[str] | None = None,
    probability: float = 0.9,
    points: int = 101,
) -> Figure:
    """Predictions along each coordinate through a point, with intervals of the function.

    :param at: the point, d numbers
    :param bounds: shape (d, 2): lower, upper
    :param names: of the coordinates; those of a campaign's model if absent
    """
    at = np.asarray(at, dtype=float)
    names = names or getattr(model, "input_names_", [f"x{j}" for j in range(len(at))])
    figure, panels = plt.subplots(
        1, len(at), sharey=True, squeeze=False, layout="constrained", figsize=(2.6 * len(at) + 0.6, 2.8)
    )
    for j, (axes, (low, high)) in enumerate(zip(panels[0], np.asarray(bounds, dtype=float), strict=True)):
        line = np.tile(at, (points, 1))
        line[:, j] = np.linspace(low, high, points)
        ends = model.interval(line, probability)
        axes.fill_between(line[:, j], ends.low, ends.high, alpha=0.25, linewidth=0)
        axes.plot(line[:, j], model.predict(line))
        axes.axvline(at[j], color="grey", linewidth=0.8, linestyle=":")
        axes.set_xlabel(names[j])
    panels[0, 0].set_ylabel(f"prediction, {100.0 * probability:g} % intervals")
    return figure


def parallel_coordinates(results: Results, *, best: float = 0.1, axes: Axes | None = None) -> Axes:
    """The designs of a campaign as lines over their variables, the best share of them highlighted."""
    axes = _axes(axes)
    designs, responses = results.table("designs"), results.table("responses")
    measure = responses[responses.columns[3]]
    # The table begins with the design's number, and goes on with the variables.
    names = [name for name in designs.columns if name in results.model.input_names_]
    rows = np.stack([designs[name] for name in names], axis=1)[responses["design"]]
    low, high = rows.min(axis=0), rows.max(axis=0)
    scaled = (rows - low) / np.where(high > low, high - low, 1.0)
    order = np.argsort(-measure if results.status["aim"] == "maximise" else measure)
    marked = set(order[: max(1, round(best * len(order)))].tolist())
    for place in order[::-1].tolist():
        is_marked = place in marked
        axes.plot(
            scaled[place],
            linewidth=0.9,
            color="C1" if is_marked else "C0",
            alpha=0.9 if is_marked else 0.15,
            zorder=3 if is_marked else 2,
        )
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_yticks([0.0, 1.0], ["lowest", "highest"])
    axes.set_title(f"best {100.0 * best:g} % by {responses.columns[3]}")
    return axes


def verification(results: Results, axes: Axes | None = None) -> Axes:
    """The distributions of the verification samples of the optima, with a line at the percentile that is optimised."""
    axes = _axes(axes)
    for name, samples in results.verification.items():
        if len(samples) > 0:
            axes.ecdf(samples, label=name)
    if percentile := re.fullmatch(r"P([0-9.]+)", results.status["measure"]):
        axes.axhline(float(percentile[1]) / 100.0, color="grey", linewidth=0.8, linestyle=":")
    unit = results.status["unit"]
    axes.set_xlabel(f"verification samples, {unit}" if unit else "verification samples")
    axes.set_ylabel("share of the samples")
    axes.legend()
    return axes


def transmission_error(pair: Pair, axes: Axes | None = None) -> Axes:
    """The transmission error of a pair, new and with the mean wear."""
    axes = _axes(axes)
    for worn, label in [(False, "new"), (True, "worn")]:
        curve = pair.transmission_error(worn=worn)
        axes.plot(curve.phase, curve.ste_um, label=f"{label}, ΔSTE {curve.delta_ste_um:.3g} µm")
    axes.set_xlabel("position of the mesh, base pitches")
    axes.set_ylabel("transmission error, µm")
    axes.legend()
    return axes
