"""A small campaign of a function."""

from pathlib import Path

import pitchline

BOWL = {
    "kind": "external",
    "format": 1,
    "name": "bowl",
    "seed": 1,
    "variables": [{"name": "x", "low": -2.0, "high": 2.0}, {"name": "y", "low": -2.0, "high": 2.0}],
    "responses": [{"name": "depth", "unit": "mm"}],
    "doe": {"designs": 20},
    "sampling": {"samples_per_design": 12},
    "optimise": {"evaluations": 100, "starts": 1},
    "verify": {"samples": 60},
}


@pitchline.simulator
def bowl(x, y, rng):
    if x > 1.7:
        raise ValueError("x is too far away")
    depth = (x - 0.5) ** 2 + (y + 0.5) ** 2
    return depth if rng is None else depth + rng.normal(0.0, 0.1)


def slow_campaign(db, out, seconds):
    """A program that runs the campaign with a function that takes so long."""
    return f"""
import sys, time
sys.path.insert(0, {str(Path(__file__).parent)!r})
from simulators import BOWL, bowl
import pitchline

@pitchline.simulator
def slow(x, y, rng):
    time.sleep({seconds})
    return bowl(x, y, rng)

pitchline.Campaign(BOWL, simulator=slow).run({str(db)!r}, out={str(out)!r}, workers=2, progress=False)
"""
