#!/bin/sh
# package: python-control 0.10.2 with slycot 0.7.1
# guess: `h2syn` and `hinfsyn` of a plant with a sampling time give a sampled controller, as `lqr` of a sampled system does, or refuse it.
# happens: The sampling time is not read: the result is for a continuous plant with these matrices. For a double integrator at 10 Hz the loop with the H2 controller has a pole of size 1.69; the norm of `hinfsyn` is 6.5 instead of 0.26.
# why: The returned loop has all poles in the left half-plane and looks stable; the machine is not. The only sign is `K.dt`, which is 0. Design for the continuous plant and sample the controller, which is stable here (0.89).
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check control==0.10.2 slycot==0.7.1 numpy==2.3.5 scipy==1.16.3
cd "$folder"
venv/bin/python - <<'END'
import sys

import control as ct
import numpy as np

STEP = 0.1  # s
FORCE = np.array([[0.0], [1.0]])
# inputs: disturbing force, sensor noise, force; outputs: position, 0.1 force, position with noise
plant = ct.ss(
    [[0.0, 1.0], [0.0, 0.0]],
    np.hstack([FORCE, np.zeros((2, 1)), FORCE]),
    [[1.0, 0.0], [0.0, 0.0], [1.0, 0.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.1, 0.0]],
)
sampled = ct.c2d(plant, STEP)
cart = ct.ss(sampled.A, sampled.B[:, [2]], sampled.C[[2]], 0, STEP)


def largest(controller):
    """Size of the largest pole of the sampled cart with the sampled controller; its sign is within it."""
    return np.abs(ct.feedback(cart, ct.c2d(controller, STEP, "tustin"), sign=1).poles()).max()


print(f"python-control {ct.__version__}: a double integrator, {STEP} s")
found = {}
for name, given in (("continuous", plant), ("sampled", sampled)):
    controller = ct.h2syn(given, 1, 1)
    _, loop, norm, _ = ct.hinfsyn(given, 1, 1)
    found[name] = largest(controller), norm, controller.dt, loop.poles().real.max()
    print(f"  designed for the {name} plant: dt of K {controller.dt}, largest pole {largest(controller):.2f}, "
          f"norm of hinfsyn {norm:.2f}, rightmost pole of its loop {found[name][3]:.2f}")
right, wrong = found["continuous"], found["sampled"]
stable = right[0] < 0.95 and abs(right[1] - 0.26) < 0.01
sys.exit(not (stable and wrong[0] > 1.5 and wrong[1] > 6 and wrong[2] == 0 and wrong[3] < 0))
END
