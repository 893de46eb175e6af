#!/usr/bin/env python3
"""Side impact on a car, by published response surfaces: answers requests on standard input.

Standard library only; Python 3.8 or later.

B. D. Youn, K. K. Choi, R.-J. Yang, L. Gu, "Reliability-based design optimization for crashworthiness of vehicle side
impact", Structural and Multidisciplinary Optimization 26 (2004), 272-283: quadratic response surfaces of finite-element
analyses. x1 to x7 are thicknesses in mm, x8 and x9 the strengths of two materials, x10 and x11 height and position of the
barrier.
"""

import json
import sys


def impact(x1, x2, x3, x4, x5, x6, x7, x8, x9, x10, x11):
    return {
        "abdomen_load": 1.16 - 0.3717 * x2 * x4 - 0.00931 * x2 * x10 - 0.484 * x3 * x9 + 0.01343 * x6 * x10,
        "viscous_upper": 0.261 - 0.0159 * x1 * x2 - 0.188 * x1 * x8 - 0.019 * x2 * x7 + 0.0144 * x3 * x5
        + 0.0008757 * x5 * x10 + 0.08045 * x6 * x9 + 0.00139 * x8 * x11 + 0.00001575 * x10 * x11,
        "viscous_middle": 0.214 + 0.00817 * x5 - 0.131 * x1 * x8 - 0.0704 * x1 * x9 + 0.03099 * x2 * x6
        - 0.018 * x2 * x7 + 0.0208 * x3 * x8 + 0.121 * x3 * x9 - 0.00364 * x5 * x6 + 0.0007715 * x5 * x10
        - 0.0005354 * x6 * x10 + 0.00121 * x8 * x11 + 0.00184 * x9 * x10 - 0.018 * x2 * x2,
        "viscous_lower": 0.74 - 0.61 * x2 - 0.163 * x3 * x8 + 0.001232 * x3 * x10 - 0.166 * x7 * x9 + 0.227 * x2 * x2,
        "rib_upper": 28.98 + 3.818 * x3 - 4.2 * x1 * x2 + 0.0207 * x5 * x10 + 6.63 * x6 * x9 - 7.77 * x7 * x8
        + 0.32 * x9 * x10,
        "rib_middle": 33.86 + 2.95 * x3 + 0.1792 * x10 - 5.057 * x1 * x2 - 11.0 * x2 * x8 - 0.0215 * x5 * x10
        - 9.98 * x7 * x8 + 22.0 * x8 * x9,
        "rib_lower": 46.36 - 9.9 * x2 - 12.9 * x1 * x8 + 0.1107 * x3 * x10,
        "pubic_force": 4.72 - 0.5 * x4 - 0.19 * x2 * x3 - 0.0122 * x4 * x10 + 0.009325 * x6 * x10
        + 0.000191 * x11 * x11,
        "pillar_velocity": 10.58 - 0.674 * x1 * x2 - 1.95 * x2 * x8 + 0.02054 * x3 * x10 - 0.0198 * x4 * x10
        + 0.028 * x6 * x10,
        "door_velocity": 16.45 - 0.489 * x3 * x7 - 0.843 * x5 * x6 + 0.0432 * x9 * x10 - 0.0556 * x9 * x11
        - 0.000786 * x11 * x11,
    }


def weight(x1, x2, x3, x4, x5, x7):
    return 1.98 + 4.9 * x1 + 6.67 * x2 + 6.98 * x3 + 4.01 * x4 + 1.78 * x5 + 2.73 * x7


for line in sys.stdin:
    request = json.loads(line)
    answer = {"id": request["id"]}
    if request["request"] == "describe":
        answer["protocol"] = request["protocol"]
    elif request["request"] == "sample":
        design, random = request["design"], request["random"]
        # Each thickness scatters about the design's.
        x = {name: design.get(name, 0.0) + random[name + "_error"] for name in ["x%d" % i for i in range(1, 12)]}
        answer.update(impact(**x))
        answer["weight"] = weight(*(design["x%d" % i] for i in (1, 2, 3, 4, 5, 7)))
    print(json.dumps(answer), flush=True)
