"""Dead reckoning as K06 writes it, and what it is fed with."""

import numpy as np


def turned(psi):
    """K06's B(psi)."""
    return np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])


def shaken(rng, ticks=300):
    """Samples of an IMU that is shaken, and aids that come now and then."""
    return {
        "acceleration_x": rng.normal(0.5, 1.0, ticks),
        "acceleration_y": rng.normal(-0.3, 1.0, ticks),
        "yaw_rate": rng.normal(2.0, 1.0, ticks),
        "heading_aid": rng.uniform(-10, 10, ticks),
        "heading_aid_valid": (rng.random(ticks) < 0.3).astype(float),
        "fix_x": rng.normal(size=ticks),
        "fix_y": rng.normal(size=ticks),
        "fix_valid": (rng.random(ticks) < 0.1).astype(float),
    }


def by_hand_342(imu, dt, pose=(0.0, 0.0, 0.0), heading=None):
    """(3.42): psi, v, r at each tick; `heading` resolves the specific force if given."""
    psi, v, r = [pose[2]], [np.zeros(2)], [np.array(pose[:2])]
    F = np.array([imu["acceleration_x"], imu["acceleration_y"]]).T
    w = imu["yaw_rate"]
    for k in range(1, len(w)):
        psi.append(psi[-1] + dt / 2 * (w[k] + w[k - 1]))
    resolved = psi if heading is None else heading
    f = [turned(p) @ a for p, a in zip(resolved, F, strict=True)]
    for k in range(1, len(w)):
        r.append(r[-1] + v[-1] * dt + dt**2 / 6 * (f[k] + 2 * f[k - 1]))
        v.append(v[-1] + dt / 2 * (f[k] + f[k - 1]))
    return np.array(psi), np.array(v).T, np.array(r).T
