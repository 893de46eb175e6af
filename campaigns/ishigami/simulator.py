#!/usr/bin/env python3
"""Ishigami's function with a random offset: one JSON request per line in, one JSON answer per line out.

Standard library only; Python 3.8 or later. campaigns/external/README.md describes the lines.
"""

import json
import math
import sys

A, B = 7.0, 0.1


def ishigami(design):
    x1, x2, x3 = design["x1"], design["x2"], design["x3"]
    return math.sin(x1) + A * math.sin(x2) ** 2 + B * x3**4 * math.sin(x1)


def answer(request):
    kind = request["request"]
    if kind == "describe":
        return {
            "protocol": 2,
            "version": "ishigami 2",
            "variables": ["x1", "x2", "x3"],
            "responses": ["y"],
        }
    # The values of [[random]] in the campaign file: their means for "evaluate", draws for "sample".
    y = ishigami(request["design"]) + request["random"]["offset"]
    if kind == "evaluate":
        return {name: y for name in request["responses"]}
    if kind == "sample":
        return {"y": y}
    return {"error": f"unknown request {kind!r}"}


for line in sys.stdin:
    request = json.loads(line)
    # Flushed: a line that stays in a buffer is an answer that never comes.
    print(json.dumps({**answer(request), "id": request["id"]}, allow_nan=False), flush=True)
