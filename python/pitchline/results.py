"""The results in a campaign's store.

>>> import pitchline
>>> results = pitchline.Results("pair.db")              # doctest: +SKIP
>>> results.recommended["p90_um"]                       # doctest: +SKIP
1.19
>>> pandas.DataFrame.from_arrow(results.table("responses"))  # doctest: +SKIP
"""

from __future__ import annotations

import html
import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pitchline import _pitchline

if TYPE_CHECKING:
    from pitchline.gear import Pair
    from pitchline.kriging import Kriging

__all__ = ["Chart", "Report", "Results", "Run", "Table"]


class Table:
    """A table: ``table["p90_um"]`` is a column, an array of numbers (NaN where one is missing) or a list of texts.

    It has Arrow's PyCapsule interface, so ``pandas.DataFrame.from_arrow(table)``, ``polars.DataFrame(table)``,
    ``pyarrow.table(table)`` and DuckDB take it as it is, without a copy.
    """

    def __init__(self, table: _pitchline.Table) -> None:
        self._table = table
        self._units = dict(table.columns())
        self._places = {name: place for place, name in enumerate(self._units)}

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._table.__arrow_c_stream__(requested_schema)

    @property
    def units(self) -> dict[str, str]:
        """The units of the columns that have one."""
        return {name: unit for name, unit in self._units.items() if unit}

    @property
    def columns(self) -> list[str]:
        """The names of the columns."""
        return list(self._places)

    def __len__(self) -> int:
        """The number of rows."""
        return len(self._table)

    def __getitem__(self, name: str) -> Any:
        if name not in self._places:
            raise KeyError(f"unknown column {name!r}; available: {', '.join(self._places)}")
        return self._table.column(self._places[name])

    def row(self, place: int) -> dict[str, Any]:
        """The values of a row by column, plain numbers and texts."""
        cells = {name: self[name][place] for name in self.columns}
        return {name: cell if isinstance(cell, str) else cell.item() for name, cell in cells.items()}

    def __repr__(self) -> str:
        return f"<Table of {len(self)} rows: {', '.join(self.columns)}>"

    def _repr_html_(self) -> str:
        def cell(value: Any) -> str:
            return html.escape(value) if isinstance(value, str) else f"{value:.6g}"

        def heading(name: str) -> str:
            unit = self.units.get(name)
            return html.escape(f"{name}, {unit}" if unit else name)

        shown = min(len(self), 20)
        columns = [self[name] for name in self.columns]
        head = "".join(f"<th>{heading(name)}</th>" for name in self.columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{cell(column[row])}</td>" for column in columns) + "</tr>"
            for row in range(shown)
        )
        rest = f"<p>… {len(self) - shown} more rows</p>" if len(self) > shown else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{rest}"


class Run(NamedTuple):
    """A run of an optimiser."""

    approach: str
    start: int
    #: columns: evaluations, the best objective so far
    history: NDArray[np.float64]


class Chart:
    """A chart of a report; Jupyter shows it.

    >>> Chart("<svg xmlns='http://www.w3.org/2000/svg'/>")._repr_svg_()[:4]
    '<svg'
    """

    def __init__(self, svg: str) -> None:
        #: the picture as the text of an SVG file
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg


class Report:
    """The report of a campaign in a folder; Jupyter shows it."""

    def __init__(self, page: Path) -> None:
        #: the page
        self.page = page

    @property
    def charts(self) -> dict[str, Chart]:
        """The charts of the report by their names."""
        files = sorted((self.page.parent / "charts").glob("*.svg"))
        return {file.stem: Chart(file.read_text(encoding="utf-8")) for file in files}

    def __repr__(self) -> str:
        return f"<Report {self.page}>"

    def _repr_html_(self) -> str:
        page = html.escape(self.page.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 40em; border: 0"></iframe>'


class Results:
    """The results in a store, read only; also of a campaign that runs.

    :param db: the store
    """

    def __init__(self, db: str | os.PathLike[str]) -> None:
        self.db = Path(db)
        self._store = _pitchline.Store(self.db)
        # A store that is missing or damaged is refused at once.
        self._store.campaign()

    @property
    def status(self) -> dict[str, Any]:
        """The object of ``coordinator status --json``."""
        found: dict[str, Any] = json.loads(self._store.status())
        return found

    @property
    def finished(self) -> bool:
        """Whether nothing is left to compute."""
        return bool(self.status["finished"])

    @property
    def warnings(self) -> list[str]:
        """Reasons to doubt the results, in sentences."""
        return list(self.status.get("warnings", []))

    @property
    def campaign(self) -> str:
        """The text of the campaign file."""
        return self._store.campaign()

    def table(self, name: str) -> Table:
        """A table of ``coordinator export``: ``"designs"``, ``"samples"``, ``"responses"``, ``"loo"``, ``"optima"``,
        ``"rounds"``, ``"infill"``, ``"evaluations"``, ``"failures"`` or ``"blocks"``."""
        return Table(self._store.table(name))

    def write(self, name: str, file: str | os.PathLike[str]) -> None:
        """Writes a table into a new file: ``.csv``, ``.json`` or ``.parquet``, by its name."""
        self._store.write(name, Path(file).suffix.removeprefix("."), file)

    @property
    def optima(self) -> Table:
        """The optima of the approaches: a row for each, with the verified measure and its interval."""
        return self.table("optima")

    @property
    def recommended(self) -> dict[str, Any] | None:
        """The row of :attr:`optima` with the best verified measure; ``None`` without a feasible optimum."""
        name = self._store.recommended()
        optima = self.optima
        places = [place for place, one in enumerate(optima["approach"]) if one == name]
        return optima.row(places[0]) if places else None

    @property
    def verification(self) -> dict[str, NDArray[np.float64]]:
        """The numbers of each optimum's verification samples from which the measure is estimated, by approach."""
        return dict(self._store.verification())

    @property
    def runs(self) -> list[Run]:
        """The finished runs of the optimisers."""
        return [
            Run(approach, start, np.array(history, dtype=float).reshape(-1, 2))
            for approach, start, history in self._store.runs()
        ]

    def pair(self, approach: str | None = None) -> Pair:
        """The pair of the optimum of an approach, or of the recommended one; for campaigns of gears only."""
        from pitchline.gear import Pair

        approach = approach or self._store.recommended()
        if approach is None:
            raise _pitchline.PitchlineError("no optimum is feasible and verified: name an approach")
        return Pair._of(self._store.pair(approach))

    @property
    def model(self) -> Kriging:
        """The kriging model of the measure over the free variables, whose names are ``input_names_``."""
        from pitchline.kriging import Kriging

        model, inputs, response, noise_variance = self._store.model()
        return Kriging._stored(model, [one[0] for one in inputs], response[0], noise_variance)

    def report(self, out: str | os.PathLike[str] | None = None) -> Report:
        """Writes the report into a folder, new or empty; a temporary one if absent."""
        folder = Path(tempfile.mkdtemp(prefix="pitchline-report-") if out is None else out)
        if folder.exists() and any(folder.iterdir()):
            raise _pitchline.PitchlineError(f"{folder} is not empty: give another folder, nothing in it is overwritten")
        return Report(self._store.report(folder))

    def __repr__(self) -> str:
        return self._store.describe()

    def _repr_html_(self) -> str:
        warnings = "".join(f"<li>{html.escape(one)}</li>" for one in self.warnings)
        text = f"<pre>{html.escape(self._store.describe())}</pre>"
        return text + (f"<ul>{warnings}</ul>" if warnings else "")
