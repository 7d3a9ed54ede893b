#!/bin/sh
# package: CasADi 3.8.2
# guess: `DaeBuilder.create("f", ["x", "u"], ["ode"])` of equations that hold the time is refused, since time is a free variable of the function, as `casadi.Function` refuses one.
# happens: The function is made without a word, with the time fixed at its start value: of x' = t it gives 0 at all times. With "t" among its inputs it is right.
# why: An optimal control problem over a model with a clock in it (a reference, a wave, a schedule, an imported FMU) is solved for the start time. Give "t" always.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check casadi==3.8.2 numpy==2.3.5
"$folder/venv/bin/python" - <<'END'
import sys

import casadi as ca

dae = ca.DaeBuilder("ramp")
t, x = dae.add("t", "independent"), dae.add("x")
dae.eq(dae.der(x), t)
frozen, right = dae.create("f", ["x"], ["ode"]), dae.create("g", ["t", "x"], ["ode"])
time, state = ca.SX.sym("time"), ca.SX.sym("state")
try:
    ca.Function("h", [state], [time])
    plain = "accepted"
except RuntimeError as error:
    plain = "refused, free variable" if "free" in str(error) else str(error)
print(f"CasADi {ca.__version__}: x' = t as a function of x alone")
print(f"  casadi.Function: {plain}")
print(f"  DaeBuilder.create: x' = {float(frozen(0.0))}")
print(f"  DaeBuilder.create of t and x, at t = 2: x' = {float(right(2.0, 0.0))}")
sys.exit(not (plain.startswith("refused") and float(frozen(0.0)) == 0.0 and float(right(2.0, 0.0)) == 2.0))
END
