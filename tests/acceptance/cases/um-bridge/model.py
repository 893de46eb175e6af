"""The bracket of the guide as a UM-Bridge model: `model.py PORT`."""

import sys

import umbridge


class Bracket(umbridge.Model):
    def __init__(self):
        super().__init__("bracket")

    def get_input_sizes(self, config):
        return [2, 2]

    def get_output_sizes(self, config):
        return [1, 2]

    def __call__(self, parameters, config):
        (width, height), (pull, push) = parameters
        section = width * height**2 / 6.0
        mass = 0.00785 * 200.0 * width * height
        return [[mass], [config["length"] * pull / section, 260.0 * push / section]]

    def supports_evaluate(self):
        return True


umbridge.serve_models([Bracket()], int(sys.argv[1]))
