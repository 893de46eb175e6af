"""Campaigns: run them, stop and resume them, or answer their requests from elsewhere.

>>> import pitchline
>>> @pitchline.simulator
... def bowl(x, y, rng):
...     depth = (x - 0.5) ** 2 + (y + 0.5) ** 2
...     return depth if rng is None else depth + rng.normal(0.0, 0.1)
>>> campaign = pitchline.Campaign(
...     {
...         "kind": "external",
...         "format": 1,
...         "name": "bowl",
...         "seed": 1,
...         "variables": [{"name": "x", "low": -2.0, "high": 2.0}, {"name": "y", "low": -2.0, "high": 2.0}],
...         "responses": [{"name": "depth", "unit": "mm"}],
...         "doe": {"designs": 30},
...         "sampling": {"samples_per_design": 25},
...     },
...     simulator=bowl,
... )
>>> results = campaign.run()           # doctest: +SKIP
>>> results.recommended                # doctest: +SKIP
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import queue
import shlex
import socket
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import IO, Any

from pitchline import _pitchline
from pitchline._files import program, toml_of
from pitchline.results import Results
from pitchline.simulate import Simulator, number, process, reason, seed_of

__all__ = ["Campaign", "CampaignError", "Evaluations", "Request"]

logger = logging.getLogger("pitchline")

#: Seconds between two readings of the store.
_LOOK = 0.3
#: Seconds that an answer from elsewhere may take: a year.
_PATIENCE = 365 * 24 * 3600
#: The exit code of a program that a signal stopped.
_INTERRUPTED = 14


class CampaignError(_pitchline.PitchlineError):
    """A campaign did not end well; the text is the program's sentence. Computed results are kept."""

    #: the exit code, see the guide
    code: int = 1
    #: the results in the store; ``None`` without one
    results: Results | None = None


class Campaign:
    """A campaign.

    :param campaign: a campaign file, or its sections as a dictionary
    :param simulator: what simulates a campaign of ``kind = "external"`` that names no program
    """

    def __init__(
        self,
        campaign: str | os.PathLike[str] | dict[str, Any],
        *,
        simulator: Simulator | Callable[..., Any] | None = None,
    ) -> None:
        if isinstance(campaign, dict):
            self._file = None
            self.text = toml_of(campaign)
            self.name = str(campaign.get("name", "campaign"))
        else:
            self._file = Path(campaign)
            self.text = self._file.read_text(encoding="utf-8")
            self.name = _pitchline.name_of(os.fspath(campaign), self.text)
        if simulator is not None and not isinstance(simulator, Simulator):
            simulator = Simulator(simulator)
        self.simulator = simulator

    def __repr__(self) -> str:
        return f"<Campaign {self.name}>"

    @contextlib.contextmanager
    def _path(self) -> Iterator[Path]:
        """The campaign file."""
        if self._file is not None:
            yield self._file
            return
        with tempfile.TemporaryDirectory(prefix="pitchline-") as folder:
            file = Path(folder) / f"{self.name}.toml"
            file.write_text(self.text, encoding="utf-8")
            yield file

    def _own_words(self, said: str, file: Path) -> str:
        """A message of a program, without the name of a temporary file, which the user has not seen."""
        return said if self._file is not None else said.replace(os.fspath(file), "the campaign")

    def check(self) -> dict[str, Any]:
        """The plan of the campaign: the object of ``coordinator check --json``.

        :raises CampaignError: a key or a value is wrong
        """
        with self._path() as file:
            command = [program("coordinator"), "check", "--json", os.fspath(file)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise _error(done.returncode, self._own_words(done.stderr, file), None)
            found: dict[str, Any] = json.loads(self._own_words(done.stdout, file))
            return found

    def run(
        self,
        db: str | os.PathLike[str] | None = None,
        *,
        out: str | os.PathLike[str] | None = None,
        workers: int | None = None,
        retry_failed: bool = False,
        progress: bool | Callable[[dict[str, Any]], object] = True,
    ) -> Results:
        """Runs the campaign on this machine, or continues the one in its store.

        Ctrl-C stops it in order; the same call continues it.

        :param db: the store; NAME.db if absent
        :param out: the folder of the report; NAME-report if absent
        :param workers: simulations at once; as many as processors if absent
        :param retry_failed: whether to compute results again that failed in every attempt
        :param progress: whether to show a bar, or a function that takes the status from time to time
        :raises CampaignError: it did not end well, or no design is feasible
        """
        with contextlib.ExitStack() as stack:
            simulator = self.simulator
            command = None if simulator is None else stack.enter_context(simulator.command())
            running = stack.enter_context(
                self._start(db, out=out, workers=workers, retry_failed=retry_failed, command=command)
            )
            show = stack.enter_context(_shown(progress))
            while running.child.poll() is None:
                show(running.status())
                with contextlib.suppress(subprocess.TimeoutExpired):
                    running.child.wait(_LOOK)
            show(running.status())
            return running.end()

    @contextlib.contextmanager
    def ask_and_tell(
        self,
        db: str | os.PathLike[str] | None = None,
        *,
        parallel: int = 1,
        out: str | os.PathLike[str] | None = None,
    ) -> Iterator[Evaluations]:
        """Runs the campaign with simulations that happen elsewhere: it asks for evaluations, the caller tells them.

        Leaving the context before the end stops the campaign. The same call continues it, and repeats the requests
        that were not answered, or were answered in the last second. ``probe_designs = 0`` in ``[simulator]`` leaves
        out the requests that test a program.

        :param parallel: requests at once, at most 1024

        >>> with campaign.ask_and_tell(parallel=4) as evaluations:     # doctest: +SKIP
        ...     for request in evaluations:
        ...         request.tell(depth=measure(request.design))
        """
        with contextlib.ExitStack() as stack:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="pitchline-"))
            listener = stack.enter_context(socket.socket(socket.AF_UNIX))
            address = os.path.join(folder, "socket")
            listener.bind(address)
            listener.listen(parallel)
            bridge = Path(__file__).with_name("_bridge.py")
            command = shlex.join(["exec", sys.executable, "-S", "-E", os.fspath(bridge), address])
            running = stack.enter_context(
                self._start(
                    db,
                    out=out,
                    workers=parallel,
                    command=command,
                    further=["--exec-timeout", str(_PATIENCE)],
                    at_once=True,
                )
            )
            evaluations = Evaluations(running, listener)
            try:
                yield evaluations
            finally:
                evaluations._leave()

    @contextlib.contextmanager
    def _start(
        self,
        db: str | os.PathLike[str] | None,
        *,
        out: str | os.PathLike[str] | None,
        workers: int | None,
        command: str | None,
        retry_failed: bool = False,
        further: Sequence[str] = (),
        at_once: bool = False,
    ) -> Iterator[_Running]:
        """The campaign's program, which ends when the context does."""
        store = Path(f"{self.name}.db" if db is None else db)
        options = ["--db", os.fspath(store)]
        if out is not None:
            options += ["--out", os.fspath(out)]
        if workers is not None:
            options += ["--workers", str(workers)]
        if command is not None:
            options += ["--exec", command]
        if retry_failed:
            options.append("--retry-failed")
        with self._path() as file, contextlib.ExitStack() as stack:
            child = stack.enter_context(
                process(
                    [program("coordinator"), "run", os.fspath(file), "--until-input-ends", *options, *further],
                    at_once=at_once,
                    # The program ends with this process, even if this process is killed.
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                )
            )
            yield _Running(child, store, lambda said: self._own_words(said, file))


class _Running:
    """A campaign that runs."""

    def __init__(
        self, child: subprocess.Popen[str], db: Path, own_words: Callable[[str], str]
    ) -> None:
        self.child = child
        self.db = db
        self._own_words = own_words
        self._said: list[str] = []
        self._listening = threading.Thread(target=self._listen, args=(child.stderr,), daemon=True)
        self._listening.start()

    def _listen(self, log: IO[str]) -> None:
        with log:
            for line in log:
                logger.info("%s", line.rstrip())
                self._said = [*self._said[-100:], line]

    def status(self) -> dict[str, Any] | None:
        """The status; ``None`` before the store is there."""
        try:
            found: dict[str, Any] = json.loads(_pitchline.Store(self.db).status())
            return found
        except _pitchline.PitchlineError:
            return None

    def end(self) -> Results:
        """The results of the campaign."""
        self._listening.join()
        code = self.child.wait()
        if code == 0:
            return Results(self.db)
        raise _error(code, self._own_words("".join(self._said)), self.db)


def _error(code: int, said: str, db: Path | None) -> CampaignError:
    """The last error that a program printed, or its last warning."""
    _, found, text = said.rpartition("error: ")
    if code == _INTERRUPTED or code < 0:
        text = "a signal ended the campaign's program; the same call continues it"
    elif not found:
        lines = [line for line in said.splitlines() if " WARN " in line] or said.splitlines()[-1:]
        text = lines[-1].rpartition(" WARN ")[2] if lines else f"the program ended with exit code {code}"
    error = CampaignError(text.strip())
    error.code = code
    if db is not None:
        with contextlib.suppress(_pitchline.PitchlineError):
            error.results = Results(db)
    return error


@contextlib.contextmanager
def _shown(progress: bool | Callable[[dict[str, Any]], object]) -> Iterator[Callable[[dict[str, Any] | None], None]]:
    """A function that shows a status."""
    if callable(progress):

        def tell(status: dict[str, Any] | None) -> None:
            if status is not None:
                progress(status)

        yield tell
        return
    with warnings.catch_warnings():
        # Without ipywidgets tqdm draws with characters, and warns about it.
        warnings.simplefilter("ignore")
        from tqdm.auto import tqdm

    bar = tqdm(disable=not progress, bar_format="{desc:>9} |{bar}| {n_fmt}/{total_fmt} {postfix}")

    def show(status: dict[str, Any] | None) -> None:
        if status is None:
            return
        current = [stage for stage in status["stages"] if stage["state"] == "current"]
        for stage in current:
            bar.set_description_str(stage["name"], refresh=False)
            bar.set_postfix_str(stage["of"], refresh=False)
            bar.total, bar.n = stage["wanted"], stage["done"]
        if status["finished"]:
            bar.set_description_str("done", refresh=False)
            bar.total = bar.n = status["samples"]["done"]
            bar.set_postfix_str("samples", refresh=False)
        bar.refresh()

    try:
        yield show
    finally:
        bar.close()


class Request:
    """A request of a campaign."""

    def __init__(self, request: dict[str, Any], names: list[str]) -> None:
        #: ``"sample"``, or ``"evaluate"`` for the numbers without random effects
        self.kind: str = request["request"]
        #: the values of the variables
        self.design: dict[str, float] = request["design"]
        #: the values of the random inputs that the campaign states
        self.random: dict[str, float] = request.get("random", {})
        #: the seed of a sample whose random inputs the campaign does not state; else ``None``
        self.seed = seed_of(request)
        #: the names of the requested responses
        self.responses = names
        self._told: Future[dict[str, Any]] = Future()

    def tell(self, **responses: float) -> None:
        """The answer: a number for each of :attr:`responses`; NaN says that there is none."""
        if sorted(responses) != sorted(self.responses):
            raise _pitchline.PitchlineError(
                f"{sorted(responses)} were told, it must be {sorted(self.responses)}"
            )
        self._answer({name: number(value) for name, value in responses.items()})

    def refuse(self, text: str) -> None:
        """This design cannot be simulated. The text has the form of that of :class:`pitchline.Refused`."""
        self._answer({"refused": reason("refused", text)})

    def again(self, text: str) -> None:
        """The simulation failed, and another attempt may succeed."""
        self._answer({"error": text})

    def _answer(self, answer: dict[str, Any]) -> None:
        if self._told.done():
            raise _pitchline.PitchlineError(f"{self} is answered already")
        self._told.set_result(answer)

    def __repr__(self) -> str:
        return f"<Request {self.kind} {self.design}>"


class Evaluations:
    """The requests of a campaign; iterating yields them one after another until the campaign is finished. A repeated
    request of a worker gets the same answer as before."""

    def __init__(self, running: _Running, listener: socket.socket) -> None:
        self._running = running
        self._requests: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
        self._finished = False
        self._lock = threading.Lock()
        self._asked: dict[str, Request] = {}
        threading.Thread(target=self._accept, args=(listener,), daemon=True).start()
        threading.Thread(target=self._end, daemon=True).start()

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                end, _ = listener.accept()
                threading.Thread(target=self._converse, args=(end,), daemon=True).start()

    def _converse(self, end: socket.socket) -> None:
        """Passes on the requests of one worker."""
        sampled: list[str] = []
        with contextlib.suppress(OSError), end, end.makefile("rw", encoding="utf-8") as lines:
            for line in lines:
                request = json.loads(line)
                if request["request"] == "describe":
                    sampled = request["sampled"]
                    answer = {"protocol": request["protocol"]}
                else:
                    names = sampled if request["request"] == "sample" else request["responses"]
                    answer = self._answer(request, names) if names else {}
                lines.write(json.dumps({**answer, "id": request["id"]}, allow_nan=False) + "\n")
                lines.flush()

    def _answer(self, request: dict[str, Any], names: list[str]) -> dict[str, Any]:
        """The answer to a request."""
        key = json.dumps({name: value for name, value in request.items() if name != "id"}, sort_keys=True)
        with self._lock:
            asked = self._asked.get(key)
            if asked is None:
                asked = self._asked[key] = Request(request, names)
                self._requests.put(asked)
        answer = asked._told.result()
        if "error" in answer:
            with self._lock:
                self._asked.pop(key, None)
        return answer

    def _leave(self) -> None:
        """Ends all conversations: open requests will get no answer."""
        with self._lock:
            asked = list(self._asked.values())
        for request in asked:
            if not request._told.done():
                request.again("the answer was not awaited")

    def _end(self) -> None:
        self._running.child.wait()
        self._requests.put(None)

    def ask(self, timeout: float | None = None) -> Request | None:
        """The next request; waits for one, at most ``timeout`` seconds. ``None`` at the end of the campaign.

        :raises queue.Empty: there was none in time
        """
        if self._finished:
            return None
        request = self._requests.get(timeout=timeout)
        self._finished = request is None
        return request

    def __iter__(self) -> Iterator[Request]:
        while (request := self.ask()) is not None:
            yield request

    def results(self) -> Results:
        """The results of the campaign, once it is finished.

        :raises CampaignError: it did not end well
        """
        return self._running.end()
