#!/usr/bin/env python3
"""A short column under bending and axial force: reads column.in, writes column.out.

Standard library only; Python 3.8 or later. `python3 -S` starts fastest.

N. Kuschel and R. Rackwitz, "Two basic problems in reliability-based structural optimization",
Mathematical Methods of Operations Research 46 (1997), 309-333: a cross-section b × h of yield strength Y
fails under the bending moment M and the axial force P where

    4 M / (b h² Y) + (P / (b h Y))² > 1.

The response is the yield strength that makes this an equality, less Y: above 0 the column fails.
"""

import math
import random

with open("column.in", encoding="utf-8") as lines:
    given = dict(line.split() for line in lines)
b, h, seed = float(given["b"]), float(given["h"]), int(given["seed"])

# P and M are normal with a correlation of 0.5, Y is log-normal.
p, m, y = 500.0, 2000.0, 5.0
if seed != 0:
    draw = random.Random(seed).gauss
    of_p, of_m = draw(0.0, 1.0), draw(0.0, 1.0)
    p += 100.0 * of_p
    m += 400.0 * (0.5 * of_p + math.sqrt(0.75) * of_m)
    variance = math.log1p((0.5 / 5.0) ** 2)
    y *= math.exp(math.sqrt(variance) * draw(0.0, 1.0) - variance / 2.0)

bending, axial = 4.0 * m / (b * h * h), p / (b * h)
needed = (bending + math.hypot(bending, 2.0 * axial)) / 2.0
with open("column.out", "w", encoding="utf-8") as out:
    print(f"area = {b * h!r}\nlack_of_strength = {needed - y!r}", file=out)
