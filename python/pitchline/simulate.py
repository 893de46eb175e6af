"""Python functions as simulators.

A function takes the variables of a design by their names and gives its responses:

>>> import pitchline
>>> @pitchline.simulator
... def bowl(x, y, rng):
...     depth = (x - 0.5) ** 2 + (y + 0.5) ** 2
...     return depth if rng is None else depth + rng.normal(0.0, 0.1)
>>> bowl(0.5, -0.5, None)
0.0

One of the arguments says what is random:

- ``rng``, a ``numpy.random.Generator``, or ``seed``, a whole number: everything random follows from it. It is ``None``
  where the campaign asks for deterministic responses, or for the response without random effects. A campaign that asks
  for neither calls the function once for each design before its samples, to see whether it can be simulated.
- The random inputs that the campaign states, by their names: then the function itself has nothing random.

It returns a number if the campaign has one response, or a dictionary from names to numbers, more of them than asked
for if that is easier. NaN says that there is no number.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np

from pitchline._files import program

__all__ = ["Again", "Refused", "Simulator", "simulator", "work"]


class Refused(Exception):  # noqa: N818 -- it is an answer, not an error
    """Raised by a simulator: this design cannot be simulated. The text may begin with a short name of small letters
    and hyphens and a colon, as in ``"contact-gap: the teeth lose contact"``: the report counts designs by it."""


class Again(Exception):  # noqa: N818
    """Raised by a simulator: something failed that another attempt may cure, such as a missing licence."""


class Simulator:
    """A function that simulates; see :func:`simulator`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.function = function
        parameters = inspect.signature(function).parameters.values()
        positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.VAR_POSITIONAL)
        for one in parameters:
            if one.kind in positional:
                raise TypeError(
                    f"{function.__name__} takes {one} by its place: a simulator takes variables by their names"
                )
        self._takes_all = any(one.kind is inspect.Parameter.VAR_KEYWORD for one in parameters)
        self._names = [one.name for one in parameters if one.kind is not inspect.Parameter.VAR_KEYWORD]

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Calls the function."""
        return self.function(*arguments, **keywords)

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request of ``campaigns/external/README.md``."""
        kind = request["request"]
        if kind == "describe":
            self._sampled = request["sampled"]
            return {"protocol": request["protocol"], "version": "python"}
        arguments = {**request["design"], **request.get("random", {})}
        # A request without responses asks only whether the design can be simulated, so any seed will do.
        seed = seed_of(request)
        if seed is None and not request.get("responses"):
            seed = 0
        if "seed" in self._names:
            arguments["seed"] = seed
        if "rng" in self._names:
            arguments["rng"] = None if seed is None else np.random.default_rng(seed)
        if not self._takes_all:
            arguments = {name: arguments[name] for name in self._names if name in arguments}
        wanted = self._sampled if kind == "sample" else request["responses"]
        try:
            found = self.function(**arguments)
            return self._numbers(found, wanted) if wanted else {}
        except Again as error:
            return {"error": str(error)}
        except Refused as error:
            return {"refused": reason("refused", str(error))}
        except Exception as error:  # noqa: BLE001 -- any exception of the user's function is a refusal
            return {"refused": reason(_kebab(type(error).__name__), str(error) or "no text")}

    def _numbers(self, found: Any, wanted: list[str]) -> dict[str, Any]:
        if not isinstance(found, dict):
            if len(wanted) > 1 or np.ndim(found) > 0:
                raise TypeError(f"the simulator returned {found!r}, it must return a dictionary with {wanted}")
            found = {wanted[0]: found}
        missing = [name for name in wanted if name not in found]
        if missing:
            raise TypeError(f"the simulator returned {sorted(found)}, without {missing}")
        return {name: number(found[name]) for name in wanted}

    @contextlib.contextmanager
    def command(self) -> Iterator[str]:
        """The command that serves the function to workers, while the context lasts."""
        with tempfile.TemporaryDirectory(prefix="pitchline-") as folder:
            file = Path(folder) / "simulator.pickle"
            file.write_bytes(cloudpickle.dumps(self.function))
            yield shlex.join(["exec", sys.executable, "-m", "pitchline._serve", os.fspath(file), *sys.path])


def _kebab(name: str) -> str:
    """``ValueError`` as ``value-error``."""
    return re.sub(r"[^a-z0-9]+", "-", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name).lower()).strip("-")


def seed_of(request: dict[str, Any]) -> int | None:
    """The seed of a request as one number; ``None`` without one."""
    if "seed" not in request:
        return None
    words: list[int] = request["seed"]
    return sum(word << (32 * place) for place, word in enumerate(words))


def number(value: Any) -> float | None:
    """A number of an answer; ``None`` stands for NaN and infinity, which JSON does not have."""
    value = float(value)
    return value if math.isfinite(value) else None


def reason(name: str, text: str) -> str:
    """A reason in the form that campaigns count by name: a short name, a colon and a sentence."""
    text = " ".join(text.split())
    return text if re.match(r"[a-z0-9-]+: \S", text) else f"{name}: {text}"


def simulator(function: Callable[..., Any]) -> Simulator:
    """Makes a function the simulator of a campaign; a decorator.

    Workers run it in processes of their own, so it must depend on its arguments alone. An exception means
    that the design cannot be simulated, for the reason in its text. :class:`Refused` names the reason, and
    :class:`Again` means that another attempt may succeed.
    """
    return Simulator(function)


def work(
    function: Simulator,
    *,
    access: str | os.PathLike[str] | None = None,
    connect: str | None = None,
    slots: int | None = None,
    idle_exit: float | None = None,
) -> None:
    """Computes jobs of a coordinator elsewhere with this function until the campaign is finished.

    :param access: the access file of ``coordinator serve``, or a copy of it
    :param connect: the coordinator's address, if it differs from those in the file
    :param slots: jobs at once; as many as processors if absent
    :param idle_exit: seconds without a job after which to return
    """
    options: list[str] = []
    for name, value in [("access", access), ("connect", connect), ("slots", slots), ("idle-exit", idle_exit)]:
        if value is not None:
            options += [f"--{name}", os.fspath(value) if isinstance(value, os.PathLike) else str(value)]
    with function.command() as command, process([program("worker"), "--exec", command, *options]) as child:
        child.wait()
    if child.returncode != 0:
        raise ChildProcessError(f"the worker ended with exit code {child.returncode}; its log says why")


@contextlib.contextmanager
def process(
    command: list[str], *, at_once: bool = False, **options: Any
) -> Iterator[subprocess.Popen[str]]:
    """A program that ends in order when the context does: it gets Ctrl-C and is awaited, or gets a second Ctrl-C if
    ``at_once``."""
    # A session of its own: otherwise Ctrl-C of the terminal would reach it as well, and a second one would end it at
    # once.
    child = subprocess.Popen(command, start_new_session=True, text=True, **options)
    try:
        yield child
    finally:
        try:
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
                if at_once:
                    # A second Ctrl-C; the program must have seen the first one.
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        child.wait(0.2)
                    child.send_signal(signal.SIGINT)
                child.wait(60.0)
        except BaseException:
            child.kill()
            child.wait()
            raise
        finally:
            if child.stdin is not None:
                child.stdin.close()
