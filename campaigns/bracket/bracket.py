#!/usr/bin/env python3
"""A bracket under two loads: answers requests on standard input, one JSON object a line.

Standard library only. Replace `bracket` by your own model; print messages to standard error.
"""

import json
import sys


def bracket(design, random):
    """All responses of a design, for values of the random inputs."""
    width, height = design["width"], design["height"]
    section = width * height**2 / 6.0
    return {
        "mass": 0.00785 * 200.0 * width * height,
        "stress_pull": 200.0 * random["pull"] / section,
        "stress_push": 260.0 * random["push"] / section,
    }


for line in sys.stdin:
    request = json.loads(line)
    answer = {"id": request["id"]}
    if request["request"] == "describe":
        answer["protocol"] = request["protocol"]
    elif request["request"] == "sample":
        answer.update(bracket(request["design"], request["random"]))
    # "evaluate" asks for deterministic responses, of which this campaign has none.
    print(json.dumps(answer), flush=True)
