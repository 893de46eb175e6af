#!/usr/bin/env python3
"""A cantilever welded to a wall: answers requests on standard input.

Standard library only; Python 3.8 or later.

K. M. Ragsdell, D. T. Phillips, "Optimal design of a class of welded structures using geometric programming", Journal of
Engineering for Industry 98 (1976), 1021-1025: height h and length l of the weld, depth t and width b of the bar, in inches;
a load of 6000 lb at 14 in. Each response is a share of what the beam bears, at most 1. Dimensions scatter by 1 %.
"""

import json
import math
import sys

LENGTH, SHEAR_MODULUS = 14.0, 12e6


def shares(h, l, t, b, load, youngs, shear_strength, strength):
    direct = load / (math.sqrt(2) * h * l)
    radius = math.sqrt(l**2 / 4 + ((h + t) / 2) ** 2)
    polar = 2 * math.sqrt(2) * h * l * (l**2 / 12 + ((h + t) / 2) ** 2)
    torsion = load * (LENGTH + l / 2) * radius / polar
    shear = math.sqrt(direct**2 + direct * torsion * l / radius + torsion**2)
    bending = 6 * load * LENGTH / (b * t**2)
    deflection = 4 * load * LENGTH**3 / (youngs * t**3 * b)
    slenderness = 1 - t / (2 * LENGTH) * math.sqrt(youngs / (4 * SHEAR_MODULUS))
    buckling = 4.013 * youngs * math.sqrt(t**2 * b**6 / 36) / LENGTH**2 * slenderness
    return {
        "shear": shear / shear_strength,
        "bending": bending / strength,
        "deflection": deflection / 0.25,
        "buckling": load / buckling,
    }


def answer(request):
    if request["request"] == "describe":
        return {"protocol": request["protocol"]}
    h, l, t, b = (request["design"][name] for name in "hltb")
    if request["request"] == "evaluate":
        cost = 1.10471 * h**2 * l + 0.04811 * t * b * (LENGTH + l)
        return {"cost": cost, "weld_beyond_bar": h - b}
    random = request["random"]
    sizes = [size * random[name + "_factor"] for name, size in zip("hltb", (h, l, t, b))]
    return shares(*sizes, random["load"], random["youngs"], random["shear_strength"], random["strength"])


for line in sys.stdin:
    request = json.loads(line)
    print(json.dumps({"id": request["id"], **answer(request)}), flush=True)
