"""Velocities from tracked positions: a Kalman smoother with outlier rejection.

The steps are: (1) fit a steady clock to the time stamps (:mod:`.clock`); (2) select the pieces of the pose
that one craft could have followed (:mod:`.reject`); (3) estimate the noise by maximum likelihood and smooth
(:mod:`.kalman`); (4) remove single outliers from the smoothed pose and repeat step 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter, percentile_filter

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.logs.clock import Clock, fit_clock, measured, moved
from hovercontrol.logs.kalman import Estimate, fit_noise, run_filter, run_smoother
from hovercontrol.logs.log import POSE, VELOCITY, Floats, Log, Mask
from hovercontrol.logs.reject import REJECTION, follow, wrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class SmoothingCriteria:
    """Thresholds for outliers and for measured velocities in the smoother.

    In clean recorded runs one sample in ten thousand reaches a relative squared distance of 90, because the
    noise of a moving marker body is uneven. The other values have no published source; they are tested in
    tests/logs/test_smooth.py.

    Attributes
    ----------
    coasting : float
        Longest time without an accepted sample over which velocities count as measured [s].
    stands_out : float
        Squared distance above which a sample is an outlier, relative to the usual distance around it.
    around : int
        Number of surrounding samples from which the usual distance is estimated.
    """

    coasting: float = 0.3
    stands_out: float = 120.0
    around: int = 51


#: The values in use.
SMOOTHING = SmoothingCriteria()


MOST_ROWS = 500_000
"""Rows that are smoothed at once; more would take gigabytes."""

FIT_ROWS = 1000
"""Rows in each of the (at most four) stretches from which the noise is estimated."""

GROUPS = ((0, 1), (2,))
"""x and y share their noise: the craft turns."""

WIDEST = np.array([[1.0, 25.0, 1e4], [1.0, 25.0, 1e4], [1.0, 1e3, 1e6]])
"""Variances of position, speed and acceleration of x, y, psi where nothing is known."""


@checked
@dataclass(frozen=True)
class Span:
    """Consecutive samples that were rejected.

    Attributes
    ----------
    start, stop : float
        Times of the first and the last of them [s].
    rows : int
        Their number.
    reason : str
        "heading flip", "heading jump", "position jump" or "outlier".

    Examples
    --------
    >>> Span(1.0, 1.04, 3, "heading flip").rows
    3
    """

    start: float
    stop: float
    rows: int
    reason: str


@checked
@dataclass(frozen=True, eq=False)
class Smoothed:
    """A pose log with velocities.

    Attributes
    ----------
    log : Log
        All rows, with steady times, smoothed ``x, y, psi``, body velocities ``u, v`` [m/s], ``r``
        [rad/s] and the other columns unchanged.
    pose, velocity, acceleration : ndarray (n, 3)
        x, y, psi in the earth frame and their derivatives.
    pose_std, velocity_std, acceleration_std : ndarray (n, 3)
        Standard deviations of these.
    accepted : ndarray (n,) of bool
        Samples that were used; false in rows without a pose.
    valid : ndarray (n,) of bool
        Rows that are accepted or lie between accepted samples at most ``SMOOTHING.coasting`` apart. In other
        rows the motion is extrapolated.
    rejected : tuple of Span
        Samples that were not used; rows without a pose are not included.
    noise_std : tuple of float
        Measurement noise of x, y [m] and psi [rad].
    jerk_density : tuple of float
        Process noise of x, y [m^2/s^5] and psi [rad^2/s^5].
    clock : Clock
        The clock fitted to the time stamps.

    Examples
    --------
    >>> t = 0.02 * np.arange(200)
    >>> found = smooth_pose(Log("turn", t, {"x": np.sin(t), "y": 1 - np.cos(t), "psi": t}))
    >>> found.velocity.shape, bool(found.accepted.all())
    ((200, 3), True)
    """

    log: Log
    pose: Floats
    velocity: Floats
    acceleration: Floats
    pose_std: Floats
    velocity_std: Floats
    acceleration_std: Floats
    accepted: Mask
    valid: Mask
    rejected: tuple[Span, ...]
    noise_std: tuple[float, ...]
    jerk_density: tuple[float, ...]
    clock: Clock

    __repr__ = short_repr

    def plot(self) -> Figure:
        """Return a figure of pose and body velocities, with rejected samples and rows that are not valid."""
        from hovercontrol.logs.display import smoothed_figure

        return open_in_pyplot(smoothed_figure(self))

    def usable(self) -> Log:
        """Return the log without the rows that are not valid (they become gaps)."""
        return self.log.select(self.valid)

    def body_acceleration(self) -> Floats:
        """Return u', v' [m/s^2], r' [rad/s^2], shape (n, 3): derivatives of the body velocities."""
        # u' = x'' cos psi + y'' sin psi + r v,  v' = -x'' sin psi + y'' cos psi - r u.
        ahead, left = _turn(self.acceleration, self.log["psi"])
        u, v, r = (self.log[name] for name in VELOCITY)
        return np.column_stack([ahead + r * v, left - r * u, self.acceleration[:, 2]])


@checked
def smooth_pose(log: Log) -> Smoothed:
    """Estimate velocities from the pose ``x, y, psi`` of a log.

    Process and measurement noise are estimated by maximum likelihood from the accepted samples. The
    three channels are accepted or rejected together, as one marker body. Velocities ``u, v, r``
    that the log already has are kept. Rows without a pose (NaN, because a command changed between two
    samples) get the smoothed motion at their time.

    Parameters
    ----------
    log : Log
        With ``x, y`` [m] and ``psi`` [rad]; 8 to 500 000 rows with a pose.

    Returns
    -------
    Smoothed

    Raises
    ------
    InputError
        If a pose column is missing, or there are too few or too many rows.

    Examples
    --------
    >>> t = 0.02 * np.arange(200)
    >>> turning = Log("demo", t, {"x": np.sin(t), "y": 1 - np.cos(t), "psi": t})
    >>> result = smooth_pose(turning)
    >>> bool(np.allclose(result.log["u"], 1.0, atol=1e-3)), result.rejected
    (True, ())
    """
    every = log.stack(*POSE)
    seen = np.isfinite(every).all(axis=1)
    raw = every[seen]
    if len(raw) < 8 or len(log) > MOST_ROWS:
        raise InputError(f"{log.name}: expected 8 to {MOST_ROWS} rows to smooth, found {len(raw)}")
    clock = fit_clock(log.time[seen], log.stack(*measured(log))[seen])
    time = clock.time
    accepted, z = follow(time, raw)
    chained = accepted.copy()
    for _ in range(2):
        jerk, noise = _fit(time, z, accepted)
        before = accepted
        accepted, estimate = _drop_outliers(time, z, accepted, jerk, noise)
        if (accepted == before).all():
            break
    else:
        estimate = _smooth(time, z, accepted, jerk, noise)
    spans = _spans(time, raw - estimate.mean[:, :, 0], accepted, chained)
    if not seen.all():
        time = moved(log.time, log.time[seen], time)
        z = z[np.maximum(np.cumsum(seen) - 1, 0)]
        rows, accepted = np.flatnonzero(seen)[accepted], np.zeros(seen.size, dtype=bool)
        accepted[rows] = True
        estimate = _smooth(time, z, accepted, jerk, noise)

    pose, velocity, acceleration = np.moveaxis(estimate.mean, -1, 0)
    spread = np.sqrt(np.maximum(np.diagonal(estimate.covariance, axis1=-2, axis2=-1), 0.0))
    u, v = _turn(velocity, pose[:, 2])
    columns = dict(zip((*POSE, *VELOCITY), (*pose.T, u, v, velocity[:, 2]), strict=True))
    columns |= {name: log[name] for name in VELOCITY if log.has(name)}
    return Smoothed(
        replace(log, time=time, columns={**log.columns, **columns}),
        pose,
        velocity,
        acceleration,
        spread[:, :, 0],
        spread[:, :, 1],
        spread[:, :, 2],
        accepted,
        _seen(time, accepted),
        spans,
        tuple(np.sqrt(noise).tolist()),
        tuple(jerk.tolist()),
        clock,
    )


def _turn(earth: Floats, psi: Floats) -> tuple[Floats, Floats]:
    """Return the body components (forward, left) of earth vectors, shape (n, 2 or more)."""
    c, s = np.cos(psi), np.sin(psi)
    return c * earth[:, 0] + s * earth[:, 1], c * earth[:, 1] - s * earth[:, 0]


def _restarts(time: Floats, accepted: Mask) -> Mask:
    """Return the rows at which the filter restarts: the first, and the first after a long loss of sight."""
    rows = np.flatnonzero(accepted)
    restart = np.zeros(time.size, dtype=bool)
    restart[rows[1:][np.diff(time[rows]) > REJECTION.forget]] = True
    restart[0] = True
    return restart


def _smooth(time: Floats, z: Floats, accepted: Mask, jerk: Floats, noise: Floats) -> Estimate:
    return run_smoother(run_filter(time, z, accepted, _restarts(time, accepted), jerk, noise, WIDEST))


def _fit(time: Floats, z: Floats, accepted: Mask) -> tuple[Floats, Floats]:
    """Estimate jerk density and noise variance on up to four stretches of the accepted samples."""
    rows = np.flatnonzero(accepted)
    restart = _restarts(time, accepted)[rows]
    if rows.size > 4 * FIT_ROWS:
        starts = np.linspace(0, rows.size - FIT_ROWS, 4).astype(int)
        restart[starts] = True
        part = (starts[:, None] + np.arange(FIT_ROWS)).ravel()
        rows, restart = rows[part], restart[part]
    restart[0] = True
    return fit_noise(time[rows], z[rows], np.ones(rows.size, dtype=bool), restart, GROUPS)


def _drop_outliers(
    time: Floats, z: Floats, accepted: Mask, jerk: Floats, noise: Floats
) -> tuple[Mask, Estimate]:
    """Remove the samples that are far from the smoothed motion, compared with nearby samples.

    The returned estimate covers all samples if none is removed.
    """
    # d = sum over x, y, psi of (z - p_s)^2 / (R - P_s), p_s and P_s smoothed. A sample is an outlier where d
    # is a local maximum and d > stands_out max(median(d)/2.37, q90(d)/6.25, 1), quantiles of nearby samples.
    kept = accepted.copy()
    rows = np.arange(time.size)
    for _ in range(10):
        estimate = _smooth(time[rows], z[rows], kept[rows], jerk, noise)
        # variance of sample minus smoothed position, R - P_s
        variance = np.maximum(noise - estimate.covariance[:, :, 0, 0], 1e-3 * noise)
        distance = ((z[rows] - estimate.mean[:, :, 0]) ** 2 / variance).sum(axis=1) * kept[rows]
        # 2.37, 6.25: median and 90 % quantile of chi squared with three degrees of freedom
        middle = median_filter(distance, size=SMOOTHING.around) / 2.37
        usual = np.maximum(
            np.maximum(middle, percentile_filter(distance, 90, size=SMOOTHING.around) / 6.25), 1.0
        )
        peak = distance == maximum_filter1d(distance, 7)
        out = rows[peak & (distance > SMOOTHING.stands_out * usual)]
        if not out.size:
            break
        kept[out] = False
        # removing them changes only the samples around them
        near = np.zeros(time.size, dtype=bool)
        near[out] = True
        rows = np.flatnonzero(maximum_filter1d(near, 101))
    return kept, estimate


def _seen(time: Floats, accepted: Mask) -> Mask:
    """Return the rows that are accepted or within a loss of sight of at most ``SMOOTHING.coasting``."""
    rows = np.flatnonzero(accepted)
    after = np.minimum(np.searchsorted(rows, np.arange(time.size)), rows.size - 1)
    before = np.maximum(np.searchsorted(rows, np.arange(time.size), side="right") - 1, 0)
    loss = time[rows[after]] - time[rows[before]]
    inside = (time >= time[rows[0]]) & (time <= time[rows[-1]])
    seen: Mask = accepted | (inside & (loss <= SMOOTHING.coasting))
    return seen


def _spans(time: Floats, missed: Floats, accepted: Mask, chained: Mask) -> tuple[Span, ...]:
    """Describe the runs of rejected rows; ``missed`` is sample minus smoothed pose, (n, 3)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], accepted, [True]]).astype(int)))
    spans = []
    for first, behind in edges.reshape(-1, 2).tolist():
        far = np.abs(missed[first:behind])
        turn = float(np.abs(wrap(missed[first:behind, 2])).max())
        if turn > np.pi / 2:
            reason = "heading flip"
        elif chained[first:behind].all():
            reason = "outlier"
        else:
            reason = "position jump" if far[:, :2].max() * 10 > turn else "heading jump"
        spans.append(Span(float(time[first]), float(time[behind - 1]), behind - first, reason))
    return tuple(spans)
