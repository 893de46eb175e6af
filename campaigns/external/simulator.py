#!/usr/bin/env python3
"""An external simulator: one JSON request per line in, one JSON answer per line out.

The protocol is real, the gear model is a stand-in: textbook involute geometry, a nominal root
stress, and a transmission error that is one harmonic of the mesh stiffness plus wear. Replace the
class Pair by calls of your own program. README.md, beside this file, describes the protocol.

Standard library only; Python 3.8 or later.
"""

import json
import math
import random
import sys

PROTOCOL = 2
VERSION = "involute stand-in 1"


class Refused(Exception):
    """A design that cannot be simulated: a short name, a colon, and a sentence."""


def involute(angle):
    return math.tan(angle) - angle


def inverse_involute(value):
    """The angle whose involute function is `value`, by Newton's method."""
    if value <= 0.0:
        raise Refused("no-involute-solution: the centre distance is too small for these shifts")
    angle = (3.0 * value) ** (1.0 / 3.0)
    for _ in range(50):
        step = (involute(angle) - value) / math.tan(angle) ** 2
        angle -= step
        if abs(step) < 1e-15:
            break
    return angle


class Pair:
    """A helical pair; lengths in mm, forces in N, stresses in MPa, lists are pinion, mate."""

    def __init__(self, campaign, teeth, design):
        pair, material = campaign["pair"], campaign["material"]
        module = design["normal_module_mm"]
        beta = math.radians(design["beta_deg"])
        alpha_n = math.radians(pair["pressure_angle_deg"])
        shift = [design["x_p"], design["x_r"]]
        # The tool's addendum cuts the root, its dedendum forms the tip.
        addendum = [design["ha0_p"], design["ha0_r"]]
        dedendum = [design["hf0_p"], design["hf0_r"]]
        alpha_t = math.atan(math.tan(alpha_n) / math.cos(beta))
        self.radius = [z * module / math.cos(beta) / 2.0 for z in teeth]
        base = [r * math.cos(alpha_t) for r in self.radius]
        alpha_w = inverse_involute(
            involute(alpha_t) + 2.0 * math.tan(alpha_n) * sum(shift) / sum(teeth)
        )
        centre = sum(base) / math.cos(alpha_w)
        tip = [r + module * (h + x) for r, h, x in zip(self.radius, dedendum, shift)]
        root = [r - module * (h - x) for r, h, x in zip(self.radius, addendum, shift)]
        for name, outer, inner in zip(("pinion", "mate"), tip, base):
            if outer <= inner:
                raise Refused(f"no-involute: the tip of the {name} lies within its base circle")

        # Distances along the path of contact from the pinion's base tangent point.
        length = centre * math.sin(alpha_w)
        start = length - math.sqrt(tip[1] ** 2 - base[1] ** 2)
        end = math.sqrt(tip[0] ** 2 - base[0] ** 2)
        pitch = 2.0 * math.pi * base[0] / teeth[0]
        if start <= 0.0 or end >= length:
            raise Refused("undercut: the path of contact reaches beyond a base tangent point")
        self.epsilon_alpha = (end - start) / pitch
        if self.epsilon_alpha < 1.0:
            raise Refused("contact-gap: the next pair of teeth meets after the last one parted")
        width = pair["face_width_mm"]
        self.epsilon_beta = width * math.sin(abs(beta)) / (math.pi * module)

        ratio = teeth[0] / teeth[1]
        self.sliding = max(
            abs(1.0 - ratio * (length - start) / start),
            abs(1.0 - end / (ratio * (length - end))),
        )
        self.clearance = [centre - tip[0] - root[1], centre - tip[1] - root[0]]
        # Where a sharp rack stops cutting the involute.
        form = [
            r * math.sin(alpha_t) - module * (h - x) / math.sin(alpha_t)
            for r, h, x in zip(self.radius, addendum, shift)
        ]
        self.margin = [start - form[0], (length - end) - form[1]]

        # Load of the pair at the pitch point, shared by the teeth in contact.
        torque = campaign["load"]["pinion_torque_nm"] * 1e3
        force = torque / base[0]
        self.line_load = force / width / self.epsilon_alpha
        rho = [base[0] * math.tan(alpha_w), base[1] * math.tan(alpha_w)]
        curvature = 1.0 / rho[0] + 1.0 / rho[1]
        self.young = material["youngs_modulus_gpa"] * 1e3
        plane = 1.0 - material["poisson_ratio"] ** 2
        self.pressure = math.sqrt(self.line_load * curvature * self.young / (2.0 * math.pi * plane))
        stress = []
        for gear in range(2):
            thickness = module * (math.pi / 2.0 + 2.0 * shift[gear] * math.tan(alpha_n) + 0.4)
            if thickness <= 0.0:
                raise Refused("no-tooth: a tooth has no thickness left")
            arm = tip[gear] - root[gear]
            stress.append(6.0 * self.line_load * arm / thickness**2)
        self.stress = max(stress)
        self.wear_depth = campaign["wear"]["max_depth_um"]
        self.variance = campaign["wear"]["variance"]

    def unworn_ste_um(self):
        """The deflection times the first harmonic of the number of teeth in contact."""

        def harmonic(epsilon):
            return math.sin(math.pi * epsilon) / (math.pi * epsilon) if epsilon > 0.0 else 1.0

        deflection_um = 1e3 * self.line_load / 14e3
        share = abs(harmonic(self.epsilon_alpha) * harmonic(self.epsilon_beta))
        return deflection_um * (0.02 + 0.5 * share)

    def wear_um(self):
        """What worn flanks add: they are worn most where they slide most."""
        return 0.5 * self.wear_depth * self.sliding / (1.0 + self.sliding) / self.epsilon_alpha

    def responses(self):
        """All of them, whichever are asked for: they cost nothing here."""
        return {
            "contact_ratio": self.epsilon_alpha + self.epsilon_beta,
            "specific_sliding": self.sliding,
            "hertz_pressure_mpa": self.pressure,
            # Worn flanks carry their load on a little less of their width.
            "hertz_pressure_worn_mpa": 1.03 * self.pressure,
            "root_stress_mpa": self.stress,
            "clearance_p_mm": self.clearance[0],
            "clearance_r_mm": self.clearance[1],
            "flank_margin_p_mm": self.margin[0],
            "flank_margin_r_mm": self.margin[1],
            "delta_ste_um": self.unworn_ste_um(),
            "delta_ste_archard_um": self.unworn_ste_um() + self.wear_um(),
        }

    def sample(self, seed):
        """Wear whose depth is random on either flank; nothing but the seed is random."""
        generator = random.Random(sum(word << (32 * place) for place, word in enumerate(seed)))
        depth = [1.0 + math.sqrt(self.variance) * generator.gauss(0.0, 1.0) for _ in range(2)]
        return {"delta_ste_um": self.unworn_ste_um() + self.wear_um() * sum(depth) / 2.0}


class Simulator:
    def __init__(self):
        self.campaign = None
        self.teeth = None

    def answer(self, request):
        kind = request["request"]
        if kind == "describe":
            self.campaign, self.teeth = request["campaign"], request["teeth"]
            wear = self.campaign["wear"]
            if "max_depth_um" not in wear or wear.get("law", "archard") != "archard":
                return {"error": "wear must be Archard's law, with max_depth_um: this model knows no other law"}
            if "manufacture" in self.campaign:
                return {"error": "[manufacture] must be absent: this model knows no slope deviations"}
            return {"protocol": PROTOCOL, "version": VERSION}
        pair = Pair(self.campaign, self.teeth, request["design"])
        if kind == "evaluate":
            return pair.responses()
        if kind == "sample":
            return pair.sample(request["seed"])
        return {"error": f"unknown request {kind!r}"}


def main():
    simulator = Simulator()
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = simulator.answer(request)
        except Refused as refusal:
            answer = {"refused": str(refusal)}
        answer["id"] = request["id"]
        # Flushed: a line that stays in a buffer is an answer that never comes.
        print(json.dumps(answer, allow_nan=False), flush=True)


if __name__ == "__main__":
    main()
