"""Optimisation under uncertainty: gears that stay quiet when they wear, and any other noisy simulator.

The numbers come from the same Rust as the programs ``coordinator`` and ``worker``, which this package brings along.

==================== ==============================================================================
``pitchline.gear``    a gear pair: geometry, transmission error, random wear; many designs at once
``pitchline.doe``     designs of experiments
``pitchline.kriging`` kriging with known noise, by scikit-learn's conventions
``pitchline.cmaes``   CMA-ES: ask and tell, or ``minimise``
``pitchline.stats``   percentiles and other measures of samples, with intervals
==================== ==============================================================================

A campaign is run by :class:`Campaign`; :func:`simulator` makes a Python function its simulator, and
:class:`Results` reads what its store holds.

>>> import pitchline
>>> x = pitchline.doe.maximin(10, 2)
>>> x.shape
(10, 2)
"""

from __future__ import annotations

import importlib
from types import ModuleType

from pitchline._files import program
from pitchline._pitchline import PitchlineError
from pitchline.campaign import Campaign, CampaignError, Evaluations, Request
from pitchline.remote import Coordinator
from pitchline.results import Results, Table
from pitchline.simulate import Again, Refused, Simulator, simulator, work

__all__ = [
    "Again",
    "Campaign",
    "CampaignError",
    "Coordinator",
    "Evaluations",
    "PitchlineError",
    "Refused",
    "Request",
    "Results",
    "Simulator",
    "Table",
    "cmaes",
    "doe",
    "gear",
    "kriging",
    "program",
    "simulator",
    "stats",
    "work",
]

_MODULES = frozenset({"cmaes", "doe", "gear", "kriging", "plots", "stats"})


def __getattr__(name: str) -> ModuleType:
    """Imports a part of the package when it is first used: kriging needs scikit-learn, which takes a second."""
    if name in _MODULES:
        return importlib.import_module(f"pitchline.{name}")
    raise AttributeError(f"module 'pitchline' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
