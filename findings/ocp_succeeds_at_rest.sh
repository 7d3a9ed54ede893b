#!/bin/sh
# package: python-control 0.10.2 (SciPy 1.16.3)
# guess: `control.optimal.solve_ocp` moves a cart from 1 m to 0; `success` and "Optimization terminated successfully" say that the plan is a minimum.
# happens: With a fan's thrust n abs(n) and the default initial guess of zeros the plan is zero for ever, at nearly three times the cost of the plan found from a guess of 0.1.
# why: The thrust of fans and propellers has no slope at rest, so that zero is a stationary point and a maximum in all directions that matter. `success` is true and the craft stays where it is. Give `initial_guess` a value other than zero.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check control==0.10.2 numpy==2.3.5 scipy==1.16.3
"$folder/venv/bin/python" - <<'END'
import sys
from importlib.metadata import version

import control
import control.optimal
import numpy as np


def cart(t, x, n, params):
    return [x[1], n[0] * abs(n[0])]  # a fan at speed n pushes with n abs(n)


system = control.nlsys(cart, None, inputs=1, states=2, outputs=2)
cost = control.optimal.quadratic_cost(system, np.eye(2), 0.01 * np.eye(1), x0=[1.0, 0.0])
time = np.linspace(0.0, 3.0, 16)
plans = {}
for guess in (None, 0.1 * np.ones((1, 16))):
    plans[guess is None] = control.optimal.solve_ocp(system, time, [0.0, 0.0], cost, initial_guess=guess, print_summary=False)
print(f"python-control {version('control')}, SciPy {version('scipy')}: a cart with a fan is to move by 1 m")
for default, plan in plans.items():
    name = "default guess" if default else "guess of 0.1"
    print(f"  {name}: success {plan.success}, largest input {abs(plan.inputs).max():.2g}, cost {plan.cost:.3g}")
rest, moves = plans[True], plans[False]
sys.exit(not (rest.success and not rest.inputs.any() and moves.success and moves.cost < 0.5 * rest.cost))
END
