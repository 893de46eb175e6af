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

with open("column.in", encoding="utf-8") as lines:
    given = {name: float(value) for name, value in map(str.split, lines)}
b, h, p, m, y = (given[name] for name in "bhPMY")

bending, axial = 4.0 * m / (b * h * h), p / (b * h)
needed = (bending + math.hypot(bending, 2.0 * axial)) / 2.0
with open("column.out", "w", encoding="utf-8") as out:
    print(f"area = {b * h!r}\nlack_of_strength = {needed - y!r}", file=out)
