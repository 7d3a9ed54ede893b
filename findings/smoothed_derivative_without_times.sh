#!/bin/sh
# package: PySINDy 2.1.0
# guess: `SINDy(differentiation_method=SmoothedFiniteDifference())` fitted with the times of the samples, `fit(x, t)`, uses them, as with the default `FiniteDifference()`.
# happens: The smoothing before the difference counts samples and ignores the times: at steps of 10 or 30 ms x' = v, v' = -4 x - 0.4 v is found as x' = 1.41 v, v' = -5.43 x - 0.59 v, though nothing is noisy. `FiniteDifference()` finds it.
# why: Logs with jitter or dropouts are what one smooths. The model is wrong by more than any noise would make it. Resample to even times before, or smooth the samples over time yourself.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pysindy==2.1.0 numpy==2.3.5 scipy==1.16.3
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version

import numpy as np
import pysindy as ps
from scipy.linalg import expm

A = np.array([[0.0, 1.0], [-4.0, -0.4]])


def found(times, method):
    states = np.array([expm(A * t) @ [1.0, 0.0] for t in times])
    model = ps.SINDy(
        differentiation_method=method,
        feature_library=ps.PolynomialLibrary(degree=1, include_bias=False),
        optimizer=ps.STLSQ(threshold=0.0, alpha=0.0),
    )
    model.fit(states, t=times)
    return model.coefficients()


print(f"PySINDy {version('pysindy')}: rows of A of an oscillator without noise, [0 1], [-4 -0.4]")
even = 0.02 * np.arange(400)
uneven = np.cumsum(np.random.default_rng(0).choice([0.01, 0.03], 400))
gap = np.delete(even, slice(100, 120))
errors = {}
for label, times in (("every 20 ms", even), ("10 or 30 ms", uneven), ("0.4 s lost", gap)):
    for method in (ps.FiniteDifference(), ps.SmoothedFiniteDifference()):
        name = type(method).__name__
        coefficients = found(times, method)
        errors[label, name] = np.abs(coefficients - A).max()
        print(f"  {label:12} {name:25}", (np.round(coefficients, 2) + 0.0).tolist())
wrong = errors.pop(("10 or 30 ms", "SmoothedFiniteDifference")), errors.pop(("0.4 s lost", "SmoothedFiniteDifference"))
sys.exit(not (max(errors.values()) < 0.01 and wrong[0] > 1.2 and wrong[1] > 0.09))
END
