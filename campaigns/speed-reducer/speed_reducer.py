#!/usr/bin/env python3
"""Golinski's speed reducer: answers requests on standard input.

Standard library only; Python 3.8 or later.

J. Golinski, "An adaptive optimization system applied to machine synthesis", Mechanism and Machine Theory 8 (1973), 419-436.
Lengths are in cm. Each limited response is a share of what is allowed, at most 1.
"""

import json
import math
import sys

LENGTHS = ["face_width", "module", "shaft_1", "shaft_2", "diameter_1", "diameter_2"]


def volume(face_width, module, teeth, shaft_1, shaft_2, diameter_1, diameter_2):
    wheels = 0.7854 * face_width * module**2 * (3.3333 * teeth**2 + 14.9334 * teeth - 43.0934)
    bores = 1.508 * face_width * (diameter_1**2 + diameter_2**2)
    necks = 7.4777 * (diameter_1**3 + diameter_2**3)
    return wheels - bores + necks + 0.7854 * (shaft_1 * diameter_1**2 + shaft_2 * diameter_2**2)


def shares(face_width, module, teeth, shaft_1, shaft_2, diameter_1, diameter_2):
    pitch = module * teeth
    stress = lambda shaft, constant, diameter: math.hypot(745 * shaft / pitch, constant) / (0.1 * diameter**3)
    return {
        "bending": 27 / (face_width * module**2 * teeth),
        "contact": 397.5 / (face_width * module**2 * teeth**2),
        "bend_1": 1.93 * shaft_1**3 / (pitch * diameter_1**4),
        "bend_2": 1.93 * shaft_2**3 / (pitch * diameter_2**4),
        "stress_1": stress(shaft_1, math.sqrt(16.9e6), diameter_1) / 1100,
        "stress_2": stress(shaft_2, math.sqrt(157.5e6), diameter_2) / 850,
        "space": pitch / 40,
        "slim": 5 * module / face_width,
        "wide": face_width / (12 * module),
        "room_1": (1.5 * diameter_1 + 1.9) / shaft_1,
        "room_2": (1.1 * diameter_2 + 1.9) / shaft_2,
    }


for line in sys.stdin:
    request = json.loads(line)
    answer = {"id": request["id"]}
    if request["request"] == "describe":
        answer["protocol"] = request["protocol"]
    elif request["request"] == "sample":
        design, random = request["design"], request["random"]
        scattered = {name: design[name] + random[name + "_error"] for name in LENGTHS}
        answer.update(shares(teeth=design["teeth"], **scattered))
        answer["volume"] = volume(**design)
    print(json.dumps(answer), flush=True)
