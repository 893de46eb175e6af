#!/usr/bin/env python3
"""A short column under bending and axial force: answers requests on standard input, one JSON object a line.

Standard library only; Python 3.8 or later.

N. Kuschel and R. Rackwitz, "Two basic problems in reliability-based structural optimization",
Mathematical Methods of Operations Research 46 (1997), 309-333: a cross-section b × h of yield strength Y
fails under the bending moment M and the axial force P where

    4 M / (b h² Y) + (P / (b h Y))² > 1.

The response is the yield strength that makes this an equality, less Y: above 0 the column fails.
"""

import json
import math
import sys


def lack_of_strength(b, h, axial_force, bending_moment, yield_strength):
    bending, axial = 4.0 * bending_moment / (b * h * h), axial_force / (b * h)
    return (bending + math.hypot(bending, 2.0 * axial)) / 2.0 - yield_strength


for line in sys.stdin:
    request = json.loads(line)
    answer = {"id": request["id"]}
    if request["request"] == "describe":
        answer["protocol"] = request["protocol"]
    elif request["request"] == "sample":
        design = request["design"]
        answer["area"] = design["b"] * design["h"]
        answer["lack_of_strength"] = lack_of_strength(**design, **request["random"])
    print(json.dumps(answer), flush=True)
