"""The cantilever beam as a UM-Bridge model, with inches, pounds and psi: `um_bridge.py PORT`.

Inputs are [width, thickness] and [horizontal, vertical, modulus, strength], outputs [area], [overstress] and [displacement],
all as in beam.c.
"""

import math
import sys

import umbridge

LENGTH = 100.0


class Cantilever(umbridge.Model):
    def __init__(self):
        super().__init__("cantilever")

    def get_input_sizes(self, config):
        return [2, 4]

    def get_output_sizes(self, config):
        return [1, 1, 1]

    def __call__(self, parameters, config):
        (width, thickness), (horizontal, vertical, modulus, strength) = parameters
        area = width * thickness
        stress = 6.0 * LENGTH / area * (vertical / thickness + horizontal / width)
        bent = math.hypot(horizontal / width**2, vertical / thickness**2)
        displacement = 4.0 * LENGTH**3 / (modulus * area) * bent
        return [[area], [stress - strength], [displacement]]

    def supports_evaluate(self):
        return True


umbridge.serve_models([Cantilever()], int(sys.argv[1]))
