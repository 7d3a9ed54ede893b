#!/bin/sh
# package: CasADi 3.8.2 with its OSQP plugin
# guess: With `error_on_fail=False` an infeasible QP gives NaN, or at least a point within the given bounds, and `unified_return_status`, the same for all solvers, says infeasible.
# happens: `x` is 2e9 where the bounds are 0 and 1, and `unified_return_status` is SOLVER_RET_UNKNOWN. Only `success` (False) and the solver's own text tell.
# why: A predictive controller that does not read `success` at every sample sends 2e9 to an actuator whose bounds it had given.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check casadi==3.8.2 numpy==2.3.5
"$folder/venv/bin/python" - <<'END'
import sys

import casadi as ca
import numpy as np

x = ca.SX.sym("x", 2)
problem = {"x": x, "f": ca.sumsqr(x), "g": x[0] + x[1]}
solver = ca.qpsol("solver", "osqp", problem, {"error_on_fail": False, "osqp": {"verbose": False}})
found = np.array(solver(lbx=0, ubx=1, lbg=5, ubg=6)["x"]).ravel()  # a sum of 5 to 6 of two numbers up to 1
stats = solver.stats()
print(f"CasADi {ca.__version__}, OSQP: minimum of x1^2 + x2^2, 0 <= x <= 1, 5 <= x1 + x2 <= 6")
print(f"  x = {found}")
for name in ("success", "return_status", "unified_return_status"):
    print(f"  {name}: {stats[name]}")
unknown = stats["unified_return_status"] == "SOLVER_RET_UNKNOWN" and not stats["success"]
sys.exit(not (np.isfinite(found).all() and found.max() > 1e6 and unknown))
END
