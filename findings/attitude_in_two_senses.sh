#!/bin/sh
# package: AHRS 0.4.0
# guess: `to_angles` gives the same roll, pitch and yaw for one attitude, whether it is a `Quaternion` or a `DCM`, and `DCM(rpy=...)` is undone by `to_rpy`.
# happens: `DCM.to_angles` (and `q2euler`) gives the angles of the inverse rotation: a roll of 0.3 is -0.3. `DCM(rpy=(0.3, 0, 0))` is a yaw of 0.3 (a note tells the order), which `to_rpy` calls (0, 0, -0.3); `Quaternion(rpy=...)` is a roll.
# why: Attitudes from a filter, a log and a formula are compared in these forms. A roll with the wrong sign passes near level flight and turns a levelling controller round. Convert by `Quaternion`, which agrees with SciPy.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ahrs==0.4.0 numpy==2.3.5 scipy==1.16.3
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version

import numpy as np
from ahrs import DCM, Quaternion
from ahrs.common.orientation import q2euler, q2rpy
from scipy.spatial.transform import Rotation


def said(angles):
    return "(" + ", ".join(f"{a + 0.0:.3f}" for a in np.round(angles, 6)) + ")"


print(f"AHRS {version('ahrs')}: roll, pitch, yaw [rad]")
same = True
for angles in ([0.3, 0.0, 0.0], [0.3, -0.4, 1.2]):
    q = np.asarray(Quaternion(rpy=np.array(angles)))
    rotation = Rotation.from_quat(q, scalar_first=True)
    found = {
        "SciPy, of Quaternion(rpy=...)": rotation.as_euler("ZYX")[::-1],
        "SciPy, of its inverse": rotation.inv().as_euler("ZYX")[::-1],
        "Quaternion(q).to_angles()": Quaternion(q).to_angles(),
        "q2rpy(q)": q2rpy(q),
        "DCM(q=q).to_angles()": DCM(q=q).to_angles(),
        "q2euler(q)": q2euler(q),
        "DCM(rpy=...).to_rpy()": DCM(rpy=angles).to_rpy(),
    }
    print(f"  {said(angles)}")
    for name, value in found.items():
        print(f"    {name:31}{said(value)}")
    right, inverse, *values = found.values()
    same &= np.allclose(right, angles) and np.allclose(values[:2], right) and np.allclose(values[2:4], inverse)
    same &= not np.allclose(right, inverse) and not np.allclose(values[4], angles)
same &= np.allclose(Rotation.from_matrix(np.asarray(DCM(rpy=[0.3, 0.0, 0.0]))).as_rotvec(), [0.0, 0.0, 0.3])
sys.exit(not same)
END
