#!/bin/sh
# package: python-control 0.10.2
# guess: `control.margin` of a sampled loop with an integrator gives the gain at which the closed loop becomes unstable, as for a continuous loop.
# happens: The gain margin is 2e-12, at frequency 0, where the integrator's gain is infinite. The loop is stable for gains up to 10.9 (by its poles).
# why: A digital LQR loop of a position looks as if it had no gain margin at all. `margin` of the same loop in continuous time skips frequency 0; look at poles over the gain instead.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check control==0.10.2 numpy==2.3.5 scipy==1.16.3
"$folder/venv/bin/python" - <<'END'
import sys
from importlib.metadata import version

import control
import numpy as np

# Position, speed and a first-order drive, sampled at 0.1 s, and its LQR gain.
A, B = np.array([[1.0, 0.1, 0.0], [0.0, 0.9, 0.2], [0.0, 0.0, 0.6]]), np.array([[0.0], [0.0], [0.4]])
K, _, _ = control.dlqr(A, B, np.diag([1.0, 0.1, 0.1]), 0.5)
gain, phase, at, _ = control.margin(control.ss(A, B, K, 0, 0.1))
stable = [k for k in np.linspace(0.1, 20.0, 2000) if max(abs(np.linalg.eigvals(A - k * B @ K))) < 1.0]
print(f"python-control {version('control')}, a sampled loop with an integrator")
print(f"  margin(): gain margin {gain:.2g} at {at:g} rad/s, phase margin {phase:.1f} deg")
print(f"  poles inside the unit circle for gains from {min(stable):.2g} to {max(stable):.4g}")
sys.exit(not (gain < 1e-9 and at == 0.0 and 10.8 < max(stable) < 11.0))
END
