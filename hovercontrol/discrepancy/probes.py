"""Signs of something that no effect of the catalogue says: what remains is then not to be named.

Each probe is a family of forces that the catalogue does not hold: coefficients that drift with time or differ
from place to place, forces that follow commands long past, a load that swings. A score test at the final
model and its noise tells whether a probe takes more than chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.stats import chi2

from hovercontrol.discrepancy.fit import Fit, forced_states
from hovercontrol.discrepancy.localize import rate
from hovercontrol.discrepancy.noise import Noise, whiten
from hovercontrol.discrepancy.reduce import inflation, reduce, scaled_inverse

Array = NDArray[np.float64]

#: Chance at which all probes together find something where there is nothing, and beside random forces: their
#: size is a guess too, so that chance does more than it says.
CHANCE, WITH_GUSTS = 1e-3, 1e-4

#: Cells along each axis of the visited floor.
CELLS = 3

#: How long past commands are [s].
PAST = (0.3, 0.6, 1.2)

#: Frequencies [rad/s] and damping of loads that may swing on the craft.
SWINGS, DAMPING = (2.0, 3.0, 4.5, 6.5, 10.0, 15.0, 22.0), 0.15

#: Part of what the model's own forces do beyond which random ones are no mere disturbance.
LARGE = 0.25

#: Rows apart at which whitened residuals are compared, and the rows of a window in which that says something.
LAGS, SHORTEST = 15, 40


@dataclass(frozen=True)
class Sign:
    """One probe that found something.

    Attributes
    ----------
    kind : str
        ``"drift"``, ``"place"``, ``"memory"``, ``"oscillation"``, ``"bursts"``, ``"process"``.
    text : str
        A sentence for a person.
    gain, numbers : float, int
        Fall of minus twice the log likelihood, with that many numbers.
    """

    kind: str
    text: str
    gain: float
    numbers: int


def probe(fit: Fit) -> list[Sign]:
    """Return what signs of something unknown a fit leaves, by falling weight.

    Parameters
    ----------
    fit : Fit
        The final model.
    """
    forcing, families = _families(fit)
    found = []
    if forcing.shape[-1]:
        S, g, whole = _scores(fit, forcing)
        level = (WITH_GUSTS if fit.noise.has_process else CHANCE) / max(len(families), 1)
        for kind, text, columns in families:
            gain, count = _gain(S, g, whole, columns)
            if count and chi2.sf(gain, count) < level:
                found.append(Sign(kind, text, gain, count))
    found += _residual_signs(fit) + large_process(fit, fit.noise)
    return sorted(found, key=lambda s: s.numbers - s.gain)


def _families(fit: Fit) -> tuple[Array, list[tuple[str, str, list[int]]]]:
    """Return forcing columns (K-1, W, n, M) and which belong together."""
    w = fit.windowed
    base = _regressors(fit, 0.0)  # K-1, W, n, coefficients
    names = [name for name in w.model.linear_coefficients() if np.any(base[..., _place(w.model, name)])]
    which = [_place(w.model, name) for name in names]
    base = base[..., which]
    begin = w.cut.time.T[:-1]
    columns, families, count = [], [], 0

    def add(kind: str, text: str, block: Array) -> None:
        nonlocal count
        columns.append(block)
        families.append((kind, text, list(range(count, count + block.shape[-1]))))
        count += block.shape[-1]

    span = max(w.data.duration, 1e-9)
    late = (begin / span - 0.5)[..., None, None]
    add("drift", "the coefficients drift during a log", base * late)
    add("drift", "the coefficients drift and come back during a log", base * (late**2 - 1 / 12))
    states = [s.name for s in w.block.states]
    if {"x", "y"} <= set(states):
        x, y = (w.x[:-1, states.index(name)] for name in ("x", "y"))
        for text, cell in _cells(x, y):
            add("place", f"the forces differ {text}", base * cell[..., None, None])
    for seconds in PAST:
        past = _regressors(fit, seconds)[..., which]
        moved = [j for j in range(len(which)) if np.any(past[..., j] != base[..., j])]
        if moved:
            add("memory", f"forces follow the commands of {seconds:g} s ago", past[..., moved])
    for k in forced_states(fit):
        name = w.block.states[w.free[k]].name
        for swing in SWINGS:
            text = f"{name}' answers like a load that swings at {swing / 2 / np.pi:.2g} Hz"
            add("oscillation", text, _swinging(fit, k, swing))
    return (np.concatenate(columns, axis=-1) if columns else np.zeros((*base.shape[:3], 0))), families


def _place(model: object, name: str) -> int:
    return list(model.linear_coefficients()).index(name)  # type: ignore[attr-defined]


def _regressors(fit: Fit, delay: float) -> Array:
    """Return the derivative of the free states' derivatives by the linear coefficients, rows' middles."""
    w = fit.windowed
    parameters = w.parameters(fit.p)
    params = dict(zip(w.block.default_parameters, parameters, strict=True))
    x = np.moveaxis(0.5 * (w.x[1:] + w.x[:-1]), 1, 0)
    t = w.cut.time.T[:-1]
    h = np.maximum(fit.response.dt, 1e-9)
    u = np.empty((len(w.block.inputs), *t.shape))
    for k, arrival in enumerate(w.arrivals):
        own = np.flatnonzero(w._log_of == k)
        u[..., own] = arrival.mean(t[..., own], t[..., own] + h[:, own], w.delay(parameters) + delay)
    J = w.block.to_numpy().jacobian(t, x, u, params, columns="parameters")
    J = np.broadcast_to(J.reshape(*J.shape, *[1] * (4 - J.ndim)), (*J.shape[:2], *t.shape))
    keys = [p.name for p in w.block.parameters]
    at = [keys.index(w.block.parameter(name).name) for name in w.model.linear_coefficients()]
    return np.moveaxis(J[w.free][:, at], (0, 1), (-2, -1))


def _swinging(fit: Fit, k: int, swing: float) -> Array:
    """Return the force of an oscillator that the acceleration of free state k shakes, (K-1, W, n, 2)."""
    w = fit.windowed
    forcing = np.zeros((*fit.response.dt.shape, len(w.free), 2))
    for i, log in enumerate(w.data.logs):
        speed = log.states[w.free[k]]
        speed = np.where(np.isfinite(speed), speed, 0.0)
        dt = float(np.median(np.diff(log.time)))
        A = np.array([[0.0, swing], [-swing, -2.0 * DAMPING * swing]])
        F = expm(A * dt)
        b = np.linalg.solve(A, (F - np.eye(2)) @ np.array([0.0, -1.0])) / dt
        states = np.zeros((speed.size, 2))
        state = np.zeros(2)
        for row, jump in enumerate(np.diff(speed).tolist()):
            state = F @ state + b * jump
            states[row + 1] = state
        for j in np.flatnonzero(w._log_of == i):
            _, first, stop = w.ranges[j]
            at = np.minimum(np.arange(first, first + len(forcing)), stop - 1)
            forcing[:, j, k] = swing * states[at]
    return forcing


def _cells(x: Array, y: Array) -> list[tuple[str, Array]]:
    """Return parts of the visited floor, with words for them."""
    edges = [np.quantile(v, np.linspace(0, 1, CELLS + 1)) for v in (x, y)]
    found = []
    for i in range(CELLS):
        for j in range(CELLS):
            (x0, x1), (y0, y1) = (edges[0][i], edges[0][i + 1]), (edges[1][j], edges[1][j + 1])
            inside = (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
            if inside.mean() > 0.01:
                text = f"where x is {x0:.2g} to {x1:.2g} m and y {y0:.2g} to {y1:.2g} m"
                found.append((text, inside.astype(float)))
    return found


def _scores(fit: Fit, forcing: Array) -> tuple[Array, Array, Array]:
    w = fit.windowed
    answer = fit.response.to(forcing)
    n, movable = len(w.free), fit.movable
    jacobian = fit.jacobian[..., np.concatenate([np.arange(n), n + movable])]
    columns = np.concatenate([fit.residual[..., None], jacobian, answer], axis=-1)
    white, _ = whiten(columns, w.seen, fit.noise, fit.response, w.errors)
    normal = reduce(white, n)
    P = len(movable)
    S, g = normal.S.copy(), normal.g.copy()
    S[np.arange(P), np.arange(P)] += fit.prior[movable]
    inverse = scaled_inverse(S[:P, :P])
    left, score = S[P:, P:] - S[P:, :P] @ inverse @ S[:P, P:], g[P:] - S[P:, :P] @ inverse @ g[:P]
    own = normal.scores[:, P:] - normal.scores[:, :P] @ inverse @ S[:P, P:]
    factor = inflation(own, left, w.blocks()) if fit.noise.has_process else 1.0
    return left, score / np.sqrt(factor), np.diag(S)[P:]


def _gain(S: Array, g: Array, whole: Array, columns: list[int]) -> tuple[float, int]:
    """Return the gain of columns together, and of how many that say something."""
    own = [c for c in columns if whole[c] > 0 and S[c, c] > 1e-6 * whole[c]]
    if not own:
        return 0.0, 0
    size = np.sqrt(np.diag(S)[own])
    M = S[np.ix_(own, own)] / np.outer(size, size)
    values, vectors = np.linalg.eigh(M)
    kept = values > 1e-6
    parts = vectors.T @ (g[own] / size)
    return float((parts[kept] ** 2 / values[kept]).sum()), int(kept.sum())


def large_process(fit: Fit, noise: Noise) -> list[Sign]:
    """Return signs that process noise is no mere disturbance but a force that the model should say."""
    w = fit.windowed
    values = dict(zip(w.names, fit.p.tolist(), strict=True))
    sizes = np.array([values[name] for name in w.model.linear_coefficients()])
    forces = _regressors(fit, 0.0) * sizes
    own = np.sqrt((forces**2).mean(axis=(0, 1)).sum(axis=-1))
    found = []
    for k in forced_states(fit):
        level, signal = float(noise.process[k]), w.block.states[w.free[k]]
        if level > LARGE * own[k]:
            text = (
                f"these logs take random forces of {level:.2g} {rate(signal.unit)} in {signal.name}' to "
                f"explain, {_beside(level, float(own[k]))}"
            )
            found.append(Sign("process", text, (level / float(w.data.noise.min())) ** 2, 1))
    return found


def _beside(level: float, own: float) -> str:
    """Return in words how large random forces are beside the model's own."""
    if own <= 0.0:
        return "where the model has no force at all"
    part = level / own
    much = f"about {100 * part:.2g} % of" if part < 0.95 else f"{part:.2g} times" if part > 1.05 else "about"
    return f"{much} the size of all forces that the model has there"


def _residual_signs(fit: Fit) -> list[Sign]:
    """Return signs that whitened residuals are not white, or come in bursts."""
    w = fit.windowed
    columns = np.concatenate([fit.residual[..., None], fit.jacobian], axis=-1)
    white, _ = whiten(columns, w.seen, fit.noise, fit.response, w.errors)
    n = len(w.free)
    z = np.where(w.seen, white[..., 0], 0.0)
    count = int(w.seen.sum())
    found = []
    scale = float((z**2).sum()) / count
    K = z.shape[1]
    lags = min(LAGS, K // 3)
    if K >= SHORTEST:  # in shorter windows the initial states take a part that shows
        r = np.array([float((z[:, lag:] * z[:, :-lag]).sum()) for lag in range(1, lags + 1)]) / (
            count * scale
        )
        ljung = count * float((r**2).sum())
        if chi2.sf(ljung / 3.0, lags) < CHANCE:
            period = _period(z, float(fit.response.dt.mean()))
            text = "what remains is correlated in time" + (
                f", strongest at {1 / period:.2g} Hz" if period else ""
            )
            found.append(Sign("oscillation", text, ljung, lags))
    per_window = (z**2).sum(axis=(1, 2)) / scale
    dof = np.maximum(w.seen.sum(axis=(1, 2)) - n, 1)
    spread = (per_window - dof) ** 2 / (2.0 * dof)
    total = float(spread.sum())
    if chi2.sf(total / 3.0, len(dof)) < CHANCE:
        found.append(Sign("bursts", "what remains comes in bursts", total, len(dof)))
    return found


def _period(z: Array, dt: float) -> float:
    power = (np.abs(np.fft.rfft(z, axis=1)) ** 2).sum(axis=(0, 2))[1:]
    frequencies = np.fft.rfftfreq(z.shape[1], dt)[1:]
    return float(1.0 / frequencies[int(power.argmax())]) if power.size else 0.0
