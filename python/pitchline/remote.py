"""A coordinator that runs elsewhere.

>>> import pitchline
>>> far = pitchline.Coordinator(access="my.access")      # doctest: +SKIP
>>> far.status()["stage"]                                # doctest: +SKIP
'sample'
>>> far.explain()                                        # doctest: +SKIP
['no samples are wanted at the moment: …']
"""

from __future__ import annotations

import json
import os
import subprocess
from typing import Any, cast

from pitchline import _pitchline
from pitchline._files import program

__all__ = ["Coordinator"]


class Coordinator:
    """A running ``coordinator serve``; :func:`pitchline.work` computes for it.

    :param access: its access file, or a copy of it; the one in ``~/.local/state/pitchline`` if absent
    :param connect: its address HOST:PORT, if it differs from those in the file
    """

    def __init__(self, access: str | os.PathLike[str] | None = None, connect: str | None = None) -> None:
        self._options = [] if access is None else ["--access", os.fspath(access)]
        if connect is not None:
            self._options += ["--connect", connect]

    def _ask(self, *command: str) -> str:
        """The output of a command."""
        done = subprocess.run(
            [program("coordinator"), *command, *self._options],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PITCHLINE_LOG": "off"},
        )
        if done.returncode != 0:
            raise _pitchline.PitchlineError(done.stderr.strip().removeprefix("error: "))
        return done.stdout

    def status(self) -> dict[str, Any]:
        """Its progress: the object of ``coordinator status --json``."""
        return cast(dict[str, Any], json.loads(self._ask("status", "--json")))

    def explain(self) -> list[str]:
        """Why no job, or no further job, is being computed, in sentences."""
        return cast(list[str], json.loads(self._ask("explain", "--json"))["sentences"])

    def drain(self, *, resume: bool = False) -> None:
        """Stops leasing jobs: it ends once the leased jobs are reported. With ``resume`` it leases jobs again."""
        self._ask("drain", *(["--resume"] if resume else []))

    def retry(self) -> None:
        """Tries the quarantined jobs again."""
        self._ask("retry")

    def _repr_html_(self) -> str:
        status = self.status()
        rows = "".join(
            f"<tr><th>{stage['name']}</th><td>{stage['state']}</td><td>{stage['done']} of {stage['wanted']} "
            f"{stage['of']}</td></tr>"
            for stage in status["stages"]
        )
        return f"<p>{status['campaign']}: {status['stage']}</p><table>{rows}</table>"
