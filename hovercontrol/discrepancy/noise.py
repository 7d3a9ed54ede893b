"""The noise of measurements, of their clock and of the process; residuals whitened by it.

The force and torque that no effect explains are Ornstein-Uhlenbeck processes (gusts, an uneven floor). A
Kalman filter along each window turns residuals and all columns of their Jacobian into numbers that are
independent with variance one, so that least squares on them is maximum likelihood (de Jong, Annals of
Statistics 19, 1991). The window's initial states are columns, not noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.navigation import Errors
from hovercontrol.discrepancy.reduce import Normal, reduce, scaled_inverse
from hovercontrol.discrepancy.response import Response

Array = NDArray[np.float64]

#: Windows at most from which the noise is estimated, spread evenly.
WINDOWS = 120

#: Rounds of the estimate, and the factors a level is tried at in each.
ROUNDS, FACTORS = 8, (0.25, 0.5, 2.0, 4.0)

#: Correlation times that are tried [s].
SECONDS = (0.1, 0.3, 1.0)


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations.

    Attributes
    ----------
    measured : ndarray, shape (C,)
        Of each channel.
    process : ndarray, shape (n,)
        Of the unexplained addition to each free state's derivative; zero where there is none.
    seconds : float
        Its correlation time.
    clock : float
        Of the rows' times [s].
    """

    measured: Array
    process: Array
    seconds: float = 0.3
    clock: float = 0.0

    @property
    def has_process(self) -> bool:
        """Whether there is process noise."""
        return bool((self.process > 0).any())

    def like(self, states: int) -> Noise:
        """Return this noise for a model of more or fewer free states behind these."""
        process = np.zeros(states)
        process[: len(self.process)] = self.process[:states]
        return self.but(process=process)

    def but(self, **changes: Any) -> Noise:
        """Return a copy with some fields changed."""
        return replace(self, **changes)


def whiten(
    columns: Array,
    seen: Array,
    noise: Noise | Sequence[Noise],
    response: Response | None,
    errors: Errors | None = None,
) -> tuple[Array, Array]:
    """Return whitened columns and the logarithm of the determinant of each window's covariance.

    Parameters
    ----------
    columns : ndarray, shape (W, K, C, M)
        Zero where nothing was measured.
    seen : ndarray of bool, shape (W, K, C)
    noise : Noise or sequence of Noise
        Of all windows, or of each; then all have process noise in the same states.
    response : Response or None
        Needed with noise of process or clock.
    errors : Errors, optional
        Of a navigation that wrote logs; then noise is that of the measurements alone.

    Returns
    -------
    ndarray, shape (W, K, C, M)
    ndarray, shape (W,)
    """
    every = [noise] if isinstance(noise, Noise) else list(noise)
    measured = np.array([n.measured for n in every])  # 1 or W, C
    clock = np.array([n.clock for n in every])
    process = np.array([n.process for n in every])
    acting = np.flatnonzero(process.any(axis=0))
    plain = (seen * (2.0 * np.log(measured))[:, None, :]).sum(axis=(1, 2))
    if errors:
        white, gained = errors.whiten(columns, columns / measured[:, None, :, None], measured[0])
        return white, plain + gained
    if response is None or (not acting.size and not clock.any()):
        return columns / measured[:, None, :, None], plain
    variance = np.zeros((len(every), 1, len(measured[0]), len(measured[0])))
    variance[:, 0, range(variance.shape[2]), range(variance.shape[2])] = measured**2
    if clock.any():
        pace = response.pace * clock[:, None, None]  # W, K, C
        variance = variance + pace[..., :, None] * pace[..., None, :]
    if not acting.size:
        L = np.linalg.cholesky(variance)
        size = 2.0 * np.log(np.diagonal(L, axis1=2, axis2=3))
        return np.linalg.inv(L) @ columns, (seen * size).sum(axis=(1, 2))
    variance = np.broadcast_to(variance, (len(columns), columns.shape[1], *variance.shape[2:]))
    seconds = np.array([n.seconds for n in every])
    return _filter(columns, seen, variance, process[:, acting] ** 2, seconds, acting, response)


def _filter(
    columns: Array,
    seen: Array,
    variance: Array,
    Q: Array,
    seconds: Array,
    acting: NDArray[np.intp],
    response: Response,
) -> tuple[Array, Array]:
    """Whiten with process noise of variances Q (1 or W, m) in the states `acting`."""
    W, K, C, M = columns.shape
    n, m = response.A.shape[-1], len(acting)
    fade = np.exp(-response.dt / seconds)  # K-1, W
    size = Q[..., None] * np.eye(m)
    P = np.zeros((W, n + m, n + m))
    P[:, n:, n:] = size
    S = np.zeros((W, n + m, M))
    F = np.zeros((W, n + m, n + m))
    H = np.zeros((W, C, n + m))
    out, determinant = np.empty_like(columns), np.zeros(W)
    for k in range(K):
        if k:
            F[:, :n, :n] = response.A[k - 1]
            F[:, :n, n:] = response.B[k - 1][..., acting]
            F[:, n:, n:] = fade[k - 1][:, None, None] * np.eye(m)
            P = F @ P @ F.swapaxes(1, 2)
            P[:, n:, n:] += (1.0 - fade[k - 1] ** 2)[:, None, None] * size
            S = F @ S
        H[:, :, :n] = response.C[k]
        G = P @ H.swapaxes(1, 2)
        L = np.linalg.cholesky(H @ G + variance[:, k])
        inverse = np.linalg.inv(L)
        e = inverse @ (columns[:, k] - H @ S)
        gain = G @ inverse.swapaxes(1, 2)
        S = S + gain @ e
        P = P - gain @ gain.swapaxes(1, 2)
        out[:, k] = e
        spread = 2.0 * np.log(np.diagonal(L, axis1=1, axis2=2))
        determinant += np.where(seen[:, k], spread, 0.0).sum(axis=1)
    return np.where(seen[..., None], out, 0.0), determinant


def cost_of(normal: Normal, precision: Array, pull: Array, determinant: float) -> float:
    """Return minus twice the log likelihood at the linear best of all unknowns."""
    S, g = normal.S + np.diag(precision), normal.g - precision * pull
    step = scaled_inverse(S) @ g
    return normal.rest - float(g @ step) + determinant


def estimate(
    columns: Array,
    seen: Array,
    n: int,
    noise: Noise,
    response: Response,
    forced: Sequence[int],
    *,
    with_clock: bool = False,
    rough: bool = False,
) -> tuple[Noise, float]:
    """Return the noise of the largest likelihood, and the fall of minus twice the log likelihood.

    Parameters
    ----------
    columns : ndarray, shape (W, K, C, 1 + n + P)
        Residual, then the columns of the initial states, then those of the unknowns.
    seen : ndarray of bool, shape (W, K, C)
    n : int
        Free states.
    noise : Noise
        Where the search starts; its measured levels stay.
    response : Response
    forced : sequence of int
        Free states in whose derivatives forces act.
    with_clock : bool, optional
        Also estimate how far the rows' times scatter.
    rough : bool, optional
        Within a factor of two is enough.
    """
    W = len(columns)
    rounds: int = ROUNDS
    factors: tuple[float, ...] = FACTORS
    if rough:
        rounds, factors = ROUNDS // 2, (FACTORS[0], FACTORS[-1])
    some = np.unique(np.linspace(0, W - 1, min(W, WINDOWS // 4 if rough else WINDOWS)).astype(int))
    part, columns, seen = response.of(some), columns[some], seen[some]
    share = W / len(some)

    def costs(tried: Sequence[Noise]) -> list[float]:
        half = -(-len(tried) // 2)  # NumPy lets go of the interpreter's lock: two halves, two cores
        return [c for part in _pool().map(costs_of, (tried[:half], tried[half:])) for c in part]

    def costs_of(tried: Sequence[Noise]) -> list[float]:
        count = len(some) if tried else 0
        if not count:
            return []
        many = np.concatenate([columns] * len(tried))
        each = [t for t in tried for _ in range(count)]
        repeated = part.of(np.tile(np.arange(count), len(tried)))
        white, det = whiten(many, np.concatenate([seen] * len(tried)), each, repeated)
        found = []
        for j in range(len(tried)):
            own = slice(j * count, (j + 1) * count)
            normal = reduce(white[own], n)
            zero = np.zeros(len(normal.g))
            found.append(cost_of(normal, zero, zero, float(det[own].sum())))
        return found

    base = costs([noise.but(process=np.zeros_like(noise.process), clock=0.0)])[0]
    guess = noise.process.copy()
    if not noise.has_process:
        guess[list(forced)] = _guess(columns, noise, part, forced)
    best = noise.but(process=guess)
    cost = costs([best])[0]
    if with_clock and not best.clock:
        cost, best = min(
            zip(costs(tries := [best.but(clock=c) for c in (0.0, 3e-4, 1e-3, 3e-3)]), tries, strict=True),
            key=lambda c: c[0],
        )
    stays = False
    for round_ in range(rounds):
        power = 1.0 if round_ < ROUNDS // 2 else 0.35
        if stays and power == 1.0:
            continue  # the same would be tried again
        tried = []
        for i in forced:
            for factor in factors:
                process = best.process.copy()
                process[i] *= factor**power
                tried.append(best.but(process=process))
        tried += [best.but(seconds=s) for s in SECONDS if s != best.seconds]
        if best.clock:
            tried += [best.but(clock=best.clock * f**power) for f in FACTORS]
        found = costs(tried)
        steps = _best_of_each(tried, found, best, cost, forced)
        both = costs([steps])[0]
        least = int(np.argmin(found))
        new, new_cost = (steps, both) if both < found[least] else (tried[least], found[least])
        if cost - new_cost < 0.5 and (rough or power < 1.0):
            break
        stays = new_cost >= cost
        if not stays:
            best, cost = new, new_cost
    return best, share * (base - cost)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(2)


def _best_of_each(
    tried: Sequence[Noise], costs: Sequence[float], best: Noise, cost: float, forced: Sequence[int]
) -> Noise:
    """Return all single improvements taken together."""
    process, changed = best.process.copy(), best
    for i in forced:
        own = [
            (c, t.process[i]) for t, c in zip(tried, costs, strict=True) if t.process[i] != best.process[i]
        ]
        least = min(own)
        if least[0] < cost:
            process[i] = least[1]
    for field in ("seconds", "clock"):
        own = [
            (c, getattr(t, field))
            for t, c in zip(tried, costs, strict=True)
            if getattr(t, field) != getattr(best, field)
        ]
        if own and min(own)[0] < cost:
            changed = changed.but(**{field: min(own)[1]})
    return changed.but(process=process)


def _guess(columns: Array, noise: Noise, response: Response, forced: Sequence[int]) -> Array:
    """Return levels of process noise that a window's misfit would take, roughly."""
    span = float(response.dt.sum(axis=0).mean())
    squares = ((columns[..., 0] / noise.measured) ** 2).mean()
    reach = np.abs(response.B).max(axis=(0, 1)).max(axis=0)[list(forced)] / float(response.dt.mean())
    typical = float(np.median(noise.measured))
    return np.full(
        len(forced), max(float(squares) - 1.0, 0.05) ** 0.5 * typical / span / np.maximum(reach, 1e-9)
    )
