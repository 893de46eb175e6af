"""Gears: one pair, or many designs of a campaign.

>>> from pitchline.gear import Pair
>>> pair = Pair(
...     pair=dict(teeth=[20, 22], centre_distance_mm=110.0, pressure_angle_deg=18.0, helix_angle_deg=30.0,
...               face_width_mm=10.0, profile_shift=[0.49, 0.49], rack="iso-53-a", tip_radius_mm=[0.0, 0.0]),
...     load=dict(pinion_torque_nm=100.0),
...     material=dict(name="16MnCr5"),
... )
>>> pair.geometry["z"]
[20, 22]
>>> samples = pair.sample(50, seed=1)
>>> samples.shape
(50, 1)
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pitchline import _pitchline
from pitchline._files import toml_of

__all__ = ["Curve", "Designs", "Pair", "Responses", "Samples"]

Array = NDArray[np.float64]


class Curve(NamedTuple):
    """The static transmission error over one base pitch."""

    #: the position of the mesh as a share of the base pitch
    phase: Array
    #: µm along the line of action; more is further behind
    ste_um: Array

    @property
    def delta_ste_um(self) -> float:
        """ΔSTE: peak to peak, µm, of these points."""
        return float(np.ptp(self.ste_um))


class Pair:
    """One gear pair.

    Keywords are the sections of a pair file, whose keys are those of the guide's reference: ``pair``, ``load``,
    ``material``, ``wear``, ``manufacture``, ``corrections``, … Lists of two are pinion, mate.

    :raises PitchlineError: a key or a value is wrong, or no such pair exists: the text names what and where
    """

    def __init__(self, **sections: Any) -> None:
        self._pair = _pitchline.Pair("the pair", toml_of(sections))

    @classmethod
    def from_toml(cls, file: str | os.PathLike[str]) -> Pair:
        """The pair of a pair file, such as ``coordinator export --pair`` writes."""
        return cls._of(Path(file).read_text(encoding="utf-8"), os.fspath(file))

    @classmethod
    def _of(cls, text: str, file: str = "the pair") -> Pair:
        pair = cls.__new__(cls)
        pair._pair = _pitchline.Pair(file, text)
        return pair

    def to_toml(self) -> str:
        """The pair as the text of a pair file."""
        return self._pair.to_toml()

    def __getstate__(self) -> str:
        return self.to_toml()

    def __setstate__(self, text: str) -> None:
        self._pair = _pitchline.Pair("the pair", text)

    def __repr__(self) -> str:
        geometry = self.geometry
        z, m_n, a = geometry["z"], geometry["m_n"], geometry["a"]
        return f"<Pair {z[0]}/{z[1]}, m_n {m_n:.4g} mm, a {a:.6g} mm>"

    @property
    def geometry(self) -> dict[str, Any]:
        """The geometry by the symbols of ISO 21771, in mm and degrees; lists of two are pinion, mate."""
        return self._pair.geometry()

    @property
    def load_cases(self) -> list[str]:
        """The names of the load cases; empty without ``[[load.cases]]``."""
        return self._pair.load_cases()

    def transmission_error(self, *, worn: bool = False) -> Curve:
        """The transmission error of the nominal pair, new or with the mean wear."""
        return Curve(*self._pair.transmission_error(worn))

    def sample(self, samples: int, *, seed: int = 1) -> Array:
        """ΔSTE of pairs with random wear and deviations in µm, shape (samples, load cases).

        A sample depends on the seed and its number alone.
        """
        return self._pair.sample(samples, seed)

    def simulate(self, *, wear: str = "none", samples: int = 30, seed: int = 1) -> dict[str, Any]:
        """All figures of ``coordinator simulate --json``: stresses, safeties, the data sheet, …

        :param wear: ``"none"``, ``"archard"`` or ``"random"``, of which ``samples`` are drawn
        """
        found: dict[str, Any] = json.loads(self._pair.simulate(wear, samples, seed))
        return found

    def _repr_html_(self) -> str:
        rows = []
        for symbol, value in self.geometry.items():
            values = value if isinstance(value, (list, tuple)) else [value]
            cells = "".join(f"<td>{one:.6g}</td>" for one in values)
            rows.append(f"<tr><th>{symbol}</th>{cells}</tr>")
        return "<table>" + "".join(rows) + "</table>"


class Responses(NamedTuple):
    """Deterministic responses of designs."""

    #: the responses by name, n numbers each, NaN for a design that is refused
    values: dict[str, Array]
    #: why a design is refused, ``None`` for one that is not
    refused: list[str | None]


class Samples(NamedTuple):
    """Random responses of designs."""

    #: shape (n, samples, responses), NaN for a design that is refused
    values: Array
    #: why a design is refused, ``None`` for one that is not
    refused: list[str | None]


class Designs:
    """Many designs of a campaign of gears, computed in parallel.

    :param campaign: a campaign file, or its sections as a dictionary
    """

    def __init__(self, campaign: str | os.PathLike[str] | dict[str, Any]) -> None:
        if isinstance(campaign, dict):
            name, text = "the campaign", toml_of(campaign)
        else:
            name, text = os.fspath(campaign), Path(campaign).read_text(encoding="utf-8")
        self._text = text
        self._problem = _pitchline.Problem(name, text)

    def __getstate__(self) -> str:
        return self._text

    def __setstate__(self, text: str) -> None:
        self._text = text
        self._problem = _pitchline.Problem("the campaign", text)

    @property
    def variables(self) -> dict[str, str]:
        """The free variables, in the order of a design's columns, with their units."""
        return dict(self._problem.variables())

    @property
    def warnings(self) -> list[str]:
        """Doubts about the campaign file, in sentences."""
        return self._problem.warnings()

    @property
    def bounds(self) -> Array:
        """Lowest and highest values of the variables, shape (d, 2)."""
        return self._problem.bounds()

    @property
    def responses(self) -> dict[str, str]:
        """The deterministic responses with their units."""
        return dict(self._problem.responses())

    @property
    def sampled(self) -> dict[str, str]:
        """The random responses with their units."""
        return dict(self._problem.sampled())

    def from_unit(self, x: ArrayLike) -> Array:
        """The designs of points in the unit box, shape (n, d), such as those of :mod:`pitchline.doe`. Discrete
        variables take their values."""
        return self._problem.at_unit(x)

    def evaluate(self, x: ArrayLike) -> Responses:
        """The deterministic responses of designs, shape (n, d)."""
        values, refused = self._problem.evaluate(x)
        return Responses(dict(zip(self.responses, values.T, strict=True)), refused)

    def sample(self, x: ArrayLike, samples: int, *, seed: int = 1, first: int = 0) -> Samples:
        """Random responses of designs, shape (n, d).

        :param samples: of each design
        :param first: the number of the first design: design i has the random numbers of design ``first`` + i of a
            campaign with this seed
        """
        return Samples(*self._problem.sample(x, samples, seed, first))
