"""Kalman filter and fixed-interval smoother of a linearised problem, for many stretches of rows at once.

The model is linearised about a path, a trajectory of the states. With x the deviation from that path, theta
the steps of the unknowns, w ~ N(0, Q) and e ~ N(0, R)::

    x(k+1) = A x(k) + drive(k) [1; theta] + w(k),    seen(k) [1; theta] = H x(k) + e(k)

The filter is linear in its inputs. One sequence of gains therefore whitens all columns: the residuals
(column 0) and the sensitivities to each unknown and each candidate term. Least squares on the whitened
columns gives the maximum likelihood estimate under process noise (Kristensen, Madsen, Jorgensen, Automatica
40 (2004); de Jong, Biometrika 76 (1989): the augmented filter). The smoother uses adjoint variables (Durbin
and Koopman, Time Series Analysis by State Space Methods, 2nd ed., 4.4). It inverts no state covariance, so
process noise may be zero.

A stretch that follows another begins with the state that the filter of that one ends with. Each innovation is
therefore the error of a prediction from all rows before it. Under feedback this matters: an input depends on
the measurement errors before it, so that a filter that begins anew has innovations that are correlated with
the inputs (Ljung, System Identification, 2nd ed. (1999), 13.4).

A compiled library does the work as soon as it is built. Until then, and without a compiler, NumPy does; the
two agree up to rounding errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.kalman_compiled import compiled


@dataclass(frozen=True, eq=False)
class Forces:
    """Missing accelerations, which follow the plain states of a system as further states.

    Attributes
    ----------
    of : tuple of int
        The plain states that they drive.
    moments : ndarray, shape (5, K-1, W, q)
        Over each step, of an acceleration of 1 at its start: the mean at its end, the mean of its integral.
        Then the variance of the stochastic part of the integral, its covariance with that of the
        acceleration, and the variance of the latter.
    states : int
        Number n of plain states.
    sampled : bool
        Whether they are added to the next values of a sampled model.
    """

    of: tuple[int, ...]
    moments: Array
    states: int
    sampled: bool = False

    def gamma(self, A: Array) -> Array:
        """Return the effect at the end of a step of a velocity change during it, (K-1, W, n, q).

        Mean of a change at the start and one at the end: column j is ``(A + I) e_j / 2``, by driven state.
        """
        eye = np.eye(self.states)[:, list(self.of)]
        plain = A[..., : self.states, list(self.of)]
        return np.broadcast_to(eye, plain.shape) if self.sampled else 0.5 * (plain + eye)


@dataclass(frozen=True, eq=False)
class System:
    """A linear system over W stretches of K rows, in deviations from a path.

    It has N states: n plain ones and the missing accelerations, or (with Q) all in A, H and the columns.

    Attributes
    ----------
    A : ndarray, shape (K-1, W, n, n)
        Transition matrix from each row to the next.
    H : ndarray, shape (K, W, C, n)
        Measurement matrix of the channels; zero where not measured.
    R : ndarray, shape (K, W, C)
        Variance of the measurements; 1 where not measured.
    columns : tuple of (ndarray or None, ndarray or None)
        Groups of m columns; shapes (K-1, W, n, m) and (K, W, C, m), None for zeros. The first array is the
        input of each column to the state; column 0 of all is the defect of the path. The second one, column
        0: measured minus path. Other columns: minus their direct contribution to the channel.
    P0 : ndarray, shape (W, N, N)
        Covariance of the first state.
    forces : Forces
    Q : ndarray, shape (K-1, W, N, N), optional
        Covariance of the process noise; by default that of the missing accelerations.
    follows : ndarray of bool, shape (W,), optional
        Stretches whose first state is the last state of the stretch before; by default none.
    """

    A: Array
    H: Array
    R: Array
    columns: tuple[tuple[Array | None, Array | None], ...]
    P0: Array
    forces: Forces
    Q: Array | None = None
    follows: NDArray[np.bool_] | None = None

    @property
    def counts(self) -> list[int]:
        """Number of columns of each group."""
        return [next(a.shape[-1] for a in pair if a is not None) for pair in self.columns]

    def whole(self) -> System:
        """Return the system with all states in its matrices, and one group of columns."""
        # Missing acceleration a, its integral b over a step of length h, their stochastic parts xi and eta:
        #   x <- A x + Gamma b,  b = tau (1 - exp(-h/tau)) a + xi,  a <- exp(-h/tau) a + eta
        #   Q = [[Gamma var(xi) Gamma', Gamma cov(xi, eta)], [., var(eta)]]
        N, n, (K, W, C) = self.P0.shape[-1], self.A.shape[-1], self.R.shape
        drive, seen = np.zeros((K - 1, W, N, sum(self.counts))), np.zeros((K, W, C, sum(self.counts)))
        for (one, other), end in zip(self.columns, np.cumsum(self.counts).tolist(), strict=True):
            if one is not None:
                drive[..., :n, end - one.shape[-1] : end] = one
            if other is not None:
                seen[..., end - other.shape[-1] : end] = other
        A, Q, H = self.A, self.Q, self.H
        if Q is None:
            fade, held, pushed, both, own = self.forces.moments
            gamma, missing = self.forces.gamma(A), range(n, N)
            A, Q, H = np.zeros((K - 1, W, N, N)), np.zeros((K - 1, W, N, N)), np.zeros((K, W, C, N))
            A[..., :n, :n], H[..., :n] = self.A, self.H
            A[..., :n, n:] = gamma * held[..., None, :]
            A[..., missing, missing] = fade
            cross = gamma * both[..., None, :]
            Q[..., :n, :n] = (gamma * pushed[..., None, :]) @ np.swapaxes(gamma, -1, -2)
            Q[..., :n, n:], Q[..., n:, :n] = cross, np.swapaxes(cross, -1, -2)
            Q[..., missing, missing] = own
        return replace(self, A=A, H=H, Q=Q, columns=((drive, seen),))

    @property
    def chains(self) -> NDArray[np.intp]:
        """First stretch of each chain of stretches that follow each other, and the number of stretches."""
        W = len(self.P0)
        first = np.ones(W, dtype=bool) if self.follows is None else ~self.follows
        return np.append(np.flatnonzero(first), W)

    def turns(self) -> list[NDArray[np.intp]]:
        """Return the first stretches of all chains, then the second ones, and so on."""
        chains = self.chains
        place = np.concatenate([np.arange(count) for count in np.diff(chains)])
        return [np.flatnonzero(place == turn) for turn in range(int(place.max(initial=-1)) + 1)]


@dataclass(frozen=True, eq=False)
class Filtered:
    """Result of a filter run.

    Attributes
    ----------
    products : ndarray, shape (W, m, m)
        Inner products of the whitened columns of each stretch.
    log_dets : ndarray, shape (W,)
        Sums of the logarithms of the variances of the innovations of each stretch.
    P, Z : ndarray, shapes (W, N, N), (W, N, m)
        Covariance of the state at the begin of each stretch, and what each column makes of it.
    """

    products: Array
    log_dets: Array
    P: Array
    Z: Array
    _white: Array | None = None
    _log_det: Array | None = None

    @property
    def white(self) -> Array:
        """Whitened innovations of every column, ``L^-1 (seen - H Z)`` with ``S = L L'``, (K, W, C, m)."""
        assert self._white is not None
        return self._white

    @property
    def log_det(self) -> Array:
        """Logarithm of the variance of each innovation given those before it, shape (K, W, C).

        The sum over the channels of a row is the logarithm of the determinant of S.
        """
        assert self._log_det is not None
        return self._log_det

    @property
    def cost(self) -> float:
        """Minus twice the log likelihood of column 0, up to a constant: ``sum w'w + log det S``."""
        return float(self.products[:, 0, 0].sum() + self.log_dets.sum())


def run_filter(system: System, *, rows: bool = False) -> Filtered:
    """Run the filter over all stretches.

    Parameters
    ----------
    rows : bool, optional
        Whether to keep the innovations of each row, beside their products.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance of innovations is not positive definite.
    """
    (K, W, C), N, m = system.R.shape, system.P0.shape[-1], sum(system.counts)
    library = compiled(N, C)
    each = (np.zeros((K, W, C, m)), np.zeros((K, W, C))) if rows or not library else (None, None)
    found = Filtered(np.zeros((W, m, m)), np.zeros(W), np.zeros((W, N, N)), np.zeros((W, N, m)), *each)
    if library:
        library.filter(system, found)
        return found
    system = system.whole()
    P, Z = system.P0.copy(), np.zeros((W, N, m))
    for turn, own in enumerate(system.turns()):
        if turn:
            P[own], Z[own] = P[own - 1], Z[own - 1]
        found.P[own], found.Z[own] = P[own], Z[own]
        P[own], Z[own], kept = _filter_stretches(system, own, P[own], Z[own])
        found.white[:, own], found.log_det[:, own] = kept.white, kept.log_det
    flat = found.white.transpose(1, 0, 2, 3).reshape(W, K * C, m)
    return replace(found, products=np.swapaxes(flat, 1, 2) @ flat, log_dets=found.log_det.sum(axis=(0, 2)))


@dataclass(frozen=True, eq=False)
class _Kept:
    """What a filter run in NumPy makes of each row of some stretches."""

    P: Array
    Z: Array
    white: Array
    log_det: Array
    half: Array
    back: Array


def _filter_stretches(
    system: System, own: NDArray[np.intp], P: Array, Z: Array
) -> tuple[Array, Array, _Kept]:
    """Filter some stretches side by side from their first states; return their last states, and all rows."""
    ((every, all_seen),) = system.columns
    arrays = (system.A, system.Q, every, system.H, all_seen, system.R)
    A, Q, drive, H, seen, R = (a[:, own] for a in arrays if a is not None)
    eye, shape = np.arange(seen.shape[2]), R.shape
    Ht, At = np.swapaxes(H, 2, 3), np.swapaxes(A, 2, 3)
    some = np.any(H, axis=(1, 2, 3))
    found = _Kept(
        np.empty((len(R), *P.shape)), np.empty((len(R), *Z.shape)), np.zeros_like(seen), np.zeros(shape),
        np.zeros((*shape, P.shape[-1])), np.zeros((*shape, P.shape[-1])),
    )  # fmt: skip
    for k in range(len(seen)):
        found.P[k], found.Z[k] = P, Z
        if some[k]:
            # S = H P H' + R = L L',  w = L^-1 (y - H Z),  half = L^-1 H P
            # Z <- Z + P H' S^-1 (y - H Z) = Z + half' w,  P <- P - P H' S^-1 H P = P - half' half
            # log det S = 2 sum log L_ii
            PH = P @ Ht[k]
            S = H[k] @ PH
            S[:, eye, eye] += R[k]
            L = np.linalg.cholesky(S)
            Li = np.linalg.inv(L)
            found.log_det[k] = 2.0 * np.log(L[:, eye, eye])
            half, w = Li @ np.swapaxes(PH, 1, 2), Li @ (seen[k] - H[k] @ Z)
            found.half[k], found.back[k], found.white[k] = half, Li @ H[k], w
            gain = np.swapaxes(half, 1, 2)
            Z, P = Z + gain @ w, P - gain @ half
        if k < len(A):
            # Prediction: P <- A P A' + Q,  Z <- A Z + drive
            P = A[k] @ P @ At[k] + Q[k]
            P = 0.5 * (P + np.swapaxes(P, 1, 2))
            Z = A[k] @ Z + drive[k]
    return P, Z, found


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smoothed deviations from the path.

    Attributes
    ----------
    state, variance : ndarray, shape (K, W, N)
        Variance given the weights of the columns, without their own uncertainty.
    known : ndarray, shape (K, W, C)
        Variance of each channel, ``h V h'``.
    forces : ndarray, shape (W, q, 2)
        Of missing acceleration j with its share Q_j of Q, the sums over steps of ``r' Q_j r`` and
        ``tr(Q_j N)``, with r and N of Durbin and Koopman (4.38), (4.42) after each step. The derivative of
        the log likelihood by the logarithm of its variance is half of their difference.
    """

    state: Array
    variance: Array
    known: Array
    forces: Array


def run_smoother(system: System, filtered: Filtered, weights: Array) -> Smoothed:
    """Return smoothed deviations from the path.

    Parameters
    ----------
    filtered : Filtered
        Result of :func:`run_filter`.
    weights : ndarray, shape (m,) or (W, m)
        Weight of each column: 1 for the residual, the step for each unknown.
    """
    (K, W, C), N = system.R.shape, system.P0.shape[-1]
    weights = np.broadcast_to(weights, (W, sum(system.counts)))
    shapes = (K, W, N), (K, W, N), (K, W, C), (W, len(system.forces.of), 2)
    found = Smoothed(*(np.zeros(shape) for shape in shapes))
    library = compiled(N, C)
    if library:
        library.smoother(system, filtered, weights, found)
        return found
    whole = system.whole()
    r, X = np.zeros((W + 1, N)), np.zeros((W + 1, N, N))
    turns = system.turns()
    for own in reversed(turns):
        # The last stretch of a chain ends with r = N = 0, others with those of the one that follows.
        after = np.where(np.isin(own + 1, system.chains), W, own + 1)
        _, _, kept = _filter_stretches(whole, own, filtered.P[own], filtered.Z[own])
        r[own], X[own] = _smooth_stretches(whole, kept, weights[own], found, own, r[after], X[after])
    return found


def _smooth_stretches(
    system: System,
    kept: _Kept,
    weights: Array,
    found: Smoothed,
    own: NDArray[np.intp],
    r: Array,
    N: Array,
) -> tuple[Array, Array]:
    """Smooth some stretches side by side from r and N at their ends; return these at their begins."""
    half, back, Ps, Zs = kept.half, kept.back, kept.P, kept.Z
    A, H, forces = system.A[:, own], system.H[:, own], system.forces
    gamma, n = forces.gamma(A), forces.states
    z = np.einsum("kwnm,wm->kwn", Zs, weights)
    e = np.einsum("kwcm,wm->kwc", kept.white, weights)
    eye = np.eye(Zs.shape[2])
    # Backward recursion, Durbin and Koopman (4.38), (4.42), with G = A (I - P H' S^-1 H) and v = y - H z:
    #   r <- H' S^-1 v + G' r,  N <- H' S^-1 H + G' N G,  x = z + P r,  V = P - P N P
    # In whitened form: back = L^-1 H, half = L^-1 H P, e = L^-1 v, so H' S^-1 v = back' e.
    # Share of acceleration j, with its column g of Gamma and e_j its own state:
    #   Q_j = g var(xi) g' + (g e_j' + e_j g') cov(xi, eta) + e_j var(eta) e_j'
    for k in range(len(Zs) - 1, -1, -1):
        if k < len(A):
            for j in range(len(forces.of)):
                pushed, both, of_own = forces.moments[2:, k, own, j]
                g, Ng = gamma[k, ..., j], (N[:, :n, :n] @ gamma[k, ..., j, None])[..., 0]
                along, last = (r[:, :n] * g).sum(axis=-1), r[:, n + j]
                cross = (N[:, n + j, :n] * g).sum(axis=-1)
                found.forces[own, j, 0] += pushed * along**2 + 2.0 * both * along * last + of_own * last**2
                found.forces[own, j, 1] += (
                    pushed * (Ng * g).sum(axis=-1) + 2.0 * both * cross + of_own * N[:, n + j, n + j]
                )
            r = (np.swapaxes(A[k], 1, 2) @ r[..., None])[..., 0]
            N = np.swapaxes(A[k], 1, 2) @ N @ A[k]
        T = np.swapaxes(back[k], 1, 2)  # len(own), n, C
        I_KH = eye - np.swapaxes(half[k], 1, 2) @ back[k]
        r = (np.swapaxes(I_KH, 1, 2) @ r[..., None])[..., 0] + (T @ e[k][..., None])[..., 0]
        N = np.swapaxes(I_KH, 1, 2) @ N @ I_KH + T @ back[k]
        V = Ps[k] - Ps[k] @ N @ Ps[k]
        found.state[k, own] = z[k] + (Ps[k] @ r[..., None])[..., 0]
        found.variance[k, own] = np.diagonal(V, axis1=1, axis2=2)
        found.known[k, own] = ((H[k] @ V) * H[k]).sum(axis=-1)
    return r, N
