"""The example's simulator with failures that follow from a seed. Its numbers are the example's.

A share of the designs fails once, in the middle of its samples, and one call of another kind fails once. Some of them kill
the worker, or the coordinator that computes itself, instead, and some give an absurd number.
With a locked design, samples of that design fail until the file `licence` exists. What has failed is
marked by a file in the working folder, so that all processes of a round fail together as often as one.

    unreliable.py SEED [LOCKED_X_P LOCKED_SHARE]
"""

import hashlib
import json
import os
import signal
import sys

import simulator

SEED = sys.argv[1]
LOCKED = [float(text) for text in sys.argv[2:4]]
# Shares, of 256: the designs that fail, the samples of these at which they may fail, and the other calls that fail.
DESIGNS, SAMPLES, CALLS = 30, 12, 2


def draws(*parts):
    return hashlib.sha256(json.dumps([SEED, *parts], sort_keys=True).encode()).digest()


def is_first(name):
    """Whether nothing has failed under this name before."""
    try:
        os.close(os.open(name, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


def kill_the_worker():
    pid = os.getppid()
    while pid > 1:
        with open(f"/proc/{pid}/comm") as name:
            if name.read().strip() in ("worker", "coordinator"):
                os.kill(pid, signal.SIGKILL)
                return
        with open(f"/proc/{pid}/stat") as stat:
            pid = int(stat.read().rsplit(")", 1)[1].split()[1])


def fail(way):
    """An answer instead of numbers, or no answer at all."""
    if way == 0:
        return {"error": "no licence: the server does not answer"}
    if way == 1:
        sys.exit(7)
    if way == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if way == 3:
        kill_the_worker()
    if way == 4:
        return {"delta_ste_um": 1e160}
    print("segmentation fault", flush=True)
    return {"error": "after nonsense"}


class Unreliable(simulator.Simulator):
    def answer(self, request):
        return self.trouble(request) or super().answer(request)

    def trouble(self, request):
        kind = request["request"]
        if kind == "describe":
            return None
        design = request["design"]
        if kind != "sample":
            call = draws("call", kind, design)
            if call[0] < CALLS and is_first("failed-call"):
                return fail((0, 1, 2, 3, 5)[call[1] % 5])
            return None
        place, sample = draws("design", design), draws("sample", design, request["seed"])
        if LOCKED and abs(design["x_p"] - LOCKED[0]) < 1e-12 and not os.path.exists("licence"):
            if sample[0] < LOCKED[1] * 256:
                return {"error": "no licence for this design"}
        if place[0] < DESIGNS and sample[1] < SAMPLES and is_first("failed-" + place.hex()[:16]):
            return fail(place[1] % 6)
        return None


simulator.Simulator = Unreliable
simulator.main()
