#!/usr/bin/env python3
"""Ishigami's function with normal noise: one JSON request per line in, one JSON answer per line out.

Standard library only; Python 3.8 or later. campaigns/external/README.md describes the lines.
"""

import json
import math
import random
import sys

A, B, NOISE = 7.0, 0.1, 0.5


def ishigami(design):
    x1, x2, x3 = design["x1"], design["x2"], design["x3"]
    return math.sin(x1) + A * math.sin(x2) ** 2 + B * x3**4 * math.sin(x1)


def answer(request):
    kind = request["request"]
    if kind == "describe":
        return {
            "protocol": 2,
            "version": "ishigami 1",
            "variables": ["x1", "x2", "x3"],
            "responses": ["y"],
        }
    if kind == "evaluate":
        return {name: ishigami(request["design"]) for name in request["responses"]}
    if kind == "sample":
        seed = sum(word << (32 * place) for place, word in enumerate(request["seed"]))
        return {"y": ishigami(request["design"]) + NOISE * random.Random(seed).gauss(0.0, 1.0)}
    return {"error": f"unknown request {kind!r}"}


for line in sys.stdin:
    request = json.loads(line)
    # Flushed: a line that stays in a buffer is an answer that never comes.
    print(json.dumps({**answer(request), "id": request["id"]}, allow_nan=False), flush=True)
