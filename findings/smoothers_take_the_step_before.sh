#!/bin/sh
# package: filterpy 2.0.0
# guess: A smoother that gets the lists which the filter got, one time step or one F and Q a measurement, improves on the filter. All three `rts_smoother` of the package read such lists in the same way.
# happens: Only the method of `KalmanFilter` agrees with least squares. The function `filterpy.kalman.rts_smoother` and the unscented filter's method take the step before: at steps of 0.1 or 1 s a position filtered to 0.18 m is "smoothed" to 3 m and 0.66 m.
# why: Every log with uneven times is smoothed worse than it was filtered, and looks smooth. At even steps all three agree, so that a test does not show it. Use the method of `KalmanFilter`, or give the function `Fs[1:]` and `Qs[1:]`; the unscented one does not read its `Qs` at all.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check filterpy==2.0.0 numpy==2.3.5 scipy==1.16.3
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version

import numpy as np
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter, rts_smoother

NOISE = 0.2


def move(step):
    return np.array([[1.0, step], [0.0, 1.0]])


def drift(step):
    return 0.5 * np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])


def errors(steps):
    """RMS error of the position, by method, and the distance of KalmanFilter.rts_smoother from least squares."""
    rng = np.random.default_rng(1)
    state, truth = np.zeros(2), []
    for step in steps:
        state = move(step) @ state + rng.multivariate_normal([0, 0], drift(step))
        truth.append(state[0])
    measured = np.array(truth) + NOISE * rng.normal(size=len(steps))
    Fs, Qs = [move(step) for step in steps], [drift(step) for step in steps]
    linear = KalmanFilter(2, 1)
    linear.H, linear.R, linear.P, linear.x = np.array([[1.0, 0.0]]), np.eye(1) * NOISE**2, np.eye(2), np.zeros((2, 1))
    means, covariances, _, _ = linear.batch_filter(measured, Fs=Fs, Qs=Qs)
    points = MerweScaledSigmaPoints(2, 0.5, 2, 0)
    unscented = UnscentedKalmanFilter(2, 1, None, lambda x: x[:1], lambda x, step: move(step) @ x, points)
    unscented.R, unscented.P, unscented.x = np.eye(1) * NOISE**2, np.eye(2), np.zeros(2)
    kept = []
    for step, z in zip(steps, measured):
        unscented.Q = drift(step)
        unscented.predict(dt=step)
        unscented.update(np.array([z]))
        kept.append((unscented.x.copy(), unscented.P.copy()))
    xs, Ps = map(np.array, zip(*kept))
    found = {
        "KalmanFilter, filtered": means[:, 0, 0],
        "KalmanFilter.rts_smoother": linear.rts_smoother(means, covariances, Fs, Qs)[0][:, 0, 0],
        "rts_smoother": rts_smoother(means, covariances, Fs, Qs)[0][:, 0, 0],
        "rts_smoother, Fs[1:] and Qs[1:]": rts_smoother(means, covariances, Fs[1:], Qs[1:])[0][:, 0, 0],
        "UnscentedKalmanFilter.rts_smoother": unscented.rts_smoother(xs, Ps, Qs, list(steps))[0][:, 0],
    }
    rows, right = [], []  # all errors, each divided by its standard deviation: their least squares is the best estimate
    for k, (F, Q) in enumerate(zip(Fs, Qs)):
        whiten = np.linalg.inv(np.linalg.cholesky(Q if k else F @ F.T + Q))
        row = np.zeros((3, 2 * len(steps)))
        row[:2, 2 * k : 2 * k + 2] = whiten
        if k:
            row[:2, 2 * k - 2 : 2 * k] = -whiten @ F
        row[2, 2 * k] = 1 / NOISE
        rows.append(row)
        right += [0, 0, measured[k] / NOISE]
    best = np.linalg.lstsq(np.vstack(rows), np.array(right), rcond=None)[0][::2]
    distance = np.abs(found["KalmanFilter.rts_smoother"] - best).max()
    return {name: np.sqrt(np.mean((x - truth) ** 2)) for name, x in found.items()}, distance


print(f"filterpy {version('filterpy')}: RMS error [m] of 300 positions measured with {NOISE} m")
uneven, distance = errors(np.random.default_rng(0).choice([0.1, 1.0], 300))
even, _ = errors(np.full(300, 0.5))
print(f"  {'':36}0.1 s or 1 s   every 0.5 s")
for name in uneven:
    print(f"  {name:36}{uneven[name]:12.2f}{even[name]:14.2f}")
print(f"  KalmanFilter.rts_smoother from least squares: {distance:.0e}")
filtered, method, function, moved, unscented = uneven.values()
smoothed = list(even.values())[1:]
right = distance < 1e-9 and method < filtered and abs(moved - method) < 1e-9 and np.ptp(smoothed) < 1e-9
sys.exit(not (right and min(function, unscented) > 2 * filtered))
END
