"""Serves a pickled function to a worker: ``python -m pitchline._serve FILE PATH...``.

Requests come as lines on standard input, answers go to standard output; see ``campaigns/external/README.md``.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import sys


def main() -> None:
    """Answers until the input ends."""
    # Ctrl-C is left to the worker, which ends this process and its computation in its own order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Text that the function prints is for people, so it goes to standard error.
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as answers:
        os.dup2(2, 1)
        file, *path = sys.argv[1:]
        sys.path[:] = path
        with open(file, "rb") as pickled:
            function = pickle.load(pickled)

        from pitchline.simulate import Simulator

        simulator = Simulator(function)
        for line in sys.stdin:
            request = json.loads(line)
            answer = {**simulator.answer(request), "id": request["id"]}
            answers.write(json.dumps(answer, allow_nan=False) + "\n")
            answers.flush()


main()
