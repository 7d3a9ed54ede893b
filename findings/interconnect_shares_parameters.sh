#!/bin/sh
# package: python-control 0.10.2
# guess: Two systems that each have a parameter `mass` keep their own values in `ct.interconnect`.
# happens: The last system's value is used in all of them, without a warning; `params` of the result shows one `mass`.
# why: Two carts made by one function behave alike: the light one accelerates 100 times too slowly. Give every parameter a name of its own.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check control==0.10.2 numpy==2.3.5 scipy==1.16.3
"$folder/venv/bin/python" - <<'END'
import sys

import control as ct
import numpy as np


def cart(name, mass):
    def acceleration(t, x, u, params):
        return [u[0] / params["mass"]]

    signals = {"inputs": [f"{name}_force"], "outputs": [f"{name}_speed"], "states": 1}
    return ct.nlsys(acceleration, None, name=name, params={"mass": mass}, **signals)


light, heavy = cart("light", 1.0), cart("heavy", 100.0)
t = np.linspace(0.0, 1.0, 11)
alone = [float(ct.input_output_response(one, t, np.ones(11)).outputs[-1]) for one in (light, heavy)]
ends = {"inputs": ["light_force", "heavy_force"], "outputs": ["light_speed", "heavy_speed"]}
both = ct.interconnect([light, heavy], **ends)
together = ct.input_output_response(both, t, np.ones((2, 11))).outputs[:, -1]
print(f"python-control {ct.__version__}: speed after 1 s under 1 N, masses of 1 kg and 100 kg")
print(f"  each alone:     light {alone[0]:.3f} m/s, heavy {alone[1]:.3f} m/s")
print(f"  interconnected: light {together[0]:.3f} m/s, heavy {together[1]:.3f} m/s; params {both.params}")
sys.exit(not (np.allclose(alone, [1.0, 0.01]) and np.allclose(together, 0.01)))
END
