"""Free runs of a model over windows of logs, linearised: the residuals that all else is made of.

A window begins at states of its own, which are unknown and eliminated (Schur complement), so that errors
cannot pile up over a log and the problem stays nearly linear (Bock 1987). States that follow from the
commands alone come from the whole log (:mod:`.arrival`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.discrepancy.arrival import Arrival, input_states
from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.navigation import Errors, Navigated
from hovercontrol.discrepancy.subject import Subject, same_widths, structure, timing, unknowns
from hovercontrol.identify.measure import Measured
from hovercontrol.identify.shooting import cut, stable_step
from hovercontrol.identify.windows import windows
from hovercontrol.targets.shoot import shoot

Array = NDArray[np.float64]

#: Longest sub-step [s].
STEP = 0.01

#: Most sub-steps between two rows.
MOST = 64

#: What half as long sub-steps may change, in standard deviations of the noise, in this part of the windows: a
#: few may begin where a hair decides whether the craft sticks.
ACCURATE, MANY = 0.1, 0.9

#: A change, in such deviations, beyond which it is just huge: commands in wrong units lead far.
HUGE = 1e9

#: Rows to either side between which a measured state's slope is taken.
REACH = 3

#: Relative size of the perturbations of one-sided differences.
NUDGE = 1e-6

#: Narrowest friction [m/s, rad/s] that a fit tells from a jump.
NARROWEST = 5e-4

#: Widest, in parts of the speed while the craft moves.
WIDEST = 0.3


class Windowed:
    """One model over windows of one length.

    Channels of logs that are noisier than others are as much smaller here (`scale`), and so are residuals and
    their Jacobian: all have the same noise then.

    Parameters
    ----------
    model : Model or BlockModel
    data : Data
    length : float
        Of the windows [s].
    guess : sequence of ndarray, shape (n_states, n), optional
        Where the states of each log may be; default: as measured.

    Attributes
    ----------
    names : tuple of str
        Unknown parameters: coefficients, friction widths, shapes of effects.
    x : ndarray, shape (K, n_states, W)
        States at every row of the last simulation.
    scale : ndarray, shape (W, 1, C)
        In which channels are counted: the noise of each window's log over that of all logs.
    errors : Errors or None
        Of the velocities, where a navigation wrote the logs.
    """

    def __init__(
        self, model: Subject, data: Data, length: float, guess: Sequence[Array] | None = None
    ) -> None:
        self.model, self.data, self.length = model, data, length
        self.block: Block = structure(model)
        self.names = unknowns(model)
        values = model.coefficients()
        signals = [self.block.parameter(name) for name in self.names]
        keys = [p.name for p in self.block.parameters]
        self._same = {one: other for one, other in same_widths(model).items() if other in self.names}
        self._at = [
            [keys.index(self.block.parameter(n).name) for n in (name, *self._like(name))]
            for name in self.names
        ]
        self.lower = np.array([s.lower for s in signals])
        self.upper = np.array([s.upper for s in signals])
        self.is_width = np.array([name.endswith("_width") for name in self.names], dtype=bool)
        self.lower = np.where(self.is_width, np.maximum(self.lower, NARROWEST), self.lower)
        self.start = np.array([values[name] for name in self.names])
        self.size = np.array([abs(v) or 1.0 for v in self.start])
        self._every = [
            values.get(key.rpartition(".")[2], s) for key, s in self.block.default_parameters.items()
        ]
        self._timing = [keys.index(name) if name else None for name in timing(model)]
        known = input_states(self.block)
        self.free = [i for i in range(len(self.block.states)) if i not in known]
        self.ranges = windows(data.logs, length)
        self.ranges.sort(key=lambda r: r[1] - r[2])
        states = [_states(self.block, m) for m in data.logs]
        self._bound_widths(states)
        for found, near in zip(states, guess or (), strict=False):
            count = min(len(found), len(near))
            found[:count] = np.where(np.isfinite(near[:count]), near[:count], found[:count])
        self._log_of = np.array([i for i, _, _ in self.ranges])
        self.scale = data.scales[self._log_of][:, None, :]
        whole = cut(data.logs, states, data.channels, self.ranges)
        self.cut = replace(whole, values=whole.values / self.scale.transpose(2, 0, 1))
        self.seen = np.isfinite(self.cut.values).transpose(1, 2, 0)  # W, K, C
        own = [data.logs[i] for i, _, _ in self.ranges]
        rows = self.cut.values.transpose(1, 2, 0)
        drifting = any(isinstance(m, Navigated) for m in own)
        self.errors = Errors(own, data.channels, rows, self.seen, self.cut.time) if drifting else None
        self.arrivals = [self.arrival(self.block, m) for m in data.logs]
        outputs, names = [s.name for s in self.block.outputs], [s.name for s in self.block.states]
        self.picked = [
            (outputs.index(f"{c}_measured"), False)
            if f"{c}_measured" in outputs
            else ((names.index(c), True) if c in names else (outputs.index(c), False))
            for c in data.channels
        ]
        self._outputs = self.block.to_numpy().vector[1]
        self._in_motion = self._depends_on_inputs()
        self._arrived: tuple[Array, dict[int, Array]] | None = None
        self.x = np.empty(0)

    def _like(self, name: str) -> list[str]:
        """Return which parameters are the same number as an unknown."""
        return [one for one, other in self._same.items() if other == name]

    @staticmethod
    def arrival(block: Block, log: Measured) -> Arrival:
        """Return the commands of a log on their way to a Block."""
        return Arrival(block, log.time - log.origin, log.inputs)

    def _depends_on_inputs(self) -> list[int]:
        """Return which unknowns change how commands arrive."""
        symbols = {self.block.states[i].symbol for i in input_states(self.block)}
        laws = [self.block.derivatives[s.name].free_symbols for s in self.block.states if s.symbol in symbols]
        acting: set[str] = set().union(*({str(s) for s in law} for law in laws))
        acting |= {name for name in timing(self.model) if name}
        return [j for j, name in enumerate(self.names) if self.block.parameter(name).name in acting]

    def _bound_widths(self, states: Sequence[Array]) -> None:
        """Let no dry friction grow as wide as the motion is fast: it would be a linear drag."""
        axes = [s.name for s in self.block.states]
        for e in self.model.effects:
            axis = getattr(e, "axis", "")
            if "width" not in e.numbers or axis not in axes or e.parameter("width") not in self.names:
                continue
            squares = np.concatenate([x[axes.index(axis)] for x in states]) ** 2
            j = self.names.index(e.parameter("width"))
            widest = WIDEST * np.sqrt(np.nanmean(squares**2) / max(float(np.nanmean(squares)), 1e-300))
            self.upper[j] = max(min(self.upper[j], widest), self.start[j], self.lower[j])

    def blocks(self, seconds: float = 2.0) -> NDArray[np.intp]:
        """Return which windows lie in the same stretch of so many seconds, as numbers from 0, shape (W,)."""
        places = [(i, int(self.data.logs[i].time[a] // seconds)) for i, a, _ in self.ranges]
        order = {place: k for k, place in enumerate(sorted(set(places)))}
        return np.array([order[place] for place in places], dtype=np.intp)

    def tracks(self) -> list[Array]:
        """Return the states of the last simulation by log, (n_states, n); NaN outside the windows."""
        found = [np.full((len(self.block.states), m.time.size), np.nan) for m in self.data.logs]
        for w, (i, first, stop) in enumerate(self.ranges):
            found[i][:, first:stop] = self.x[: stop - first, :, w].T
        return found

    def plainly_white(self, residual: Array) -> Array:
        """Return residuals, (W, K, C), whitened by the noise of the measurements alone."""
        white: Array = residual / self.data.noise
        if self.errors:
            white = self.errors.whiten(residual[..., None], white[..., None], self.data.noise)[0][..., 0]
        return white

    # ---- simulation ------------------------------------------------------------------------------------

    def parameters(self, p: Array) -> list[float]:
        """Return every parameter of the Block, the unknowns as in `p`."""
        every = list(self._every)
        for places, value in zip(self._at, p.tolist(), strict=True):
            for at in places:
                every[at] = value
        return every

    def coefficients(self, p: Array) -> dict[str, float]:
        """Return the unknowns and what is the same as one, by name."""
        found = dict(zip(self.names, p.tolist(), strict=True))
        return {**found, **{one: found[other] for one, other in self._same.items()}}

    def set_step(self, p: Array, x0: Array, least: int = 1, *, enough: bool = False) -> None:
        """Choose sub-steps: stable in friction as stiff as now, and fine enough for the noise.

        Parameters
        ----------
        p : ndarray, shape (P,)
        x0 : ndarray, shape (n_states, W)
        least : int, optional
            Sub-steps between two rows that are known to be needed.
        enough : bool, optional
            Whether they are known to be fine enough.
        """
        step = 2.0 * stable_step(self.block, self.cut, self.parameters(p), 0.5 * STEP)
        longest = float(np.diff(self.cut.time, axis=1).max())
        self._set_pieces(max(int(np.ceil(longest / step - 1e-9)), least))
        while self.pieces < MOST and not enough:
            coarse, now = self.linearise(p, x0, jacobian=False)[0], self.pieces
            self._set_pieces(2 * now)
            change = (self.linearise(p, x0, jacobian=False)[0] - coarse) / self.data.noise
            known = np.clip(np.where(np.isfinite(change), change, 0.0), -HUGE, HUGE)
            if float(np.quantile((known**2).mean(axis=(1, 2)), MANY)) < ACCURATE**2:
                self._set_pieces(now)
                return

    def _set_pieces(self, pieces: int) -> None:
        self.pieces = int(np.clip(pieces, 1, MOST))
        self._arrived = None
        dt = np.diff(self.cut.time, axis=1).T
        self.h = dt / self.pieces  # K-1, W
        parts = np.arange(self.pieces)[:, None, None]
        self.t = self.cut.time.T[None, :-1] + parts * self.h  # S, K-1, W

    def delay(self, parameters: Sequence[float]) -> float:
        """Return how late commands act on what is measured, against the log's clock [s]."""
        return sum(parameters[at] for at in self._timing if at is not None)

    def commands(self, parameters: Sequence[float], t: Array, h: Array) -> tuple[Array, dict[int, Array]]:
        """Return inputs' means over steps from t to t + h, and input states in their middles.

        Parameters
        ----------
        parameters : sequence of float
        t, h : ndarray, shapes (S, K-1, W) and (K-1, W)

        Returns
        -------
        ndarray, shape (n_inputs, S, K-1, W)
        dict of int to ndarray, shape (S, K-1, W)
        """
        delay = self.delay(parameters)
        u = np.empty((len(self.block.inputs), *t.shape))
        lagged = {i: np.empty(t.shape) for i in input_states(self.block)}
        padded = np.where(h > 0, h, 1e-9)
        for k, arrival in enumerate(self.arrivals):
            own = np.flatnonzero(self._log_of == k)
            begin, width = t[..., own], padded[:, own]
            u[..., own] = arrival.mean(begin, begin + width, delay)
            for i, values in arrival.lagged(begin + 0.5 * width, parameters, delay).items():
                lagged[i][..., own] = values
        return u, lagged

    def linearise(
        self, p: Array, x0: Array, *, jacobian: bool = True, unknowns: bool = True
    ) -> tuple[Array, Array]:
        """Simulate all windows.

        Parameters
        ----------
        p : ndarray, shape (P,)
        x0 : ndarray, shape (n_states, W)
        jacobian, unknowns : bool, optional
            Whether slopes are wanted, and whether by the unknowns too.

        Returns
        -------
        residual : ndarray, shape (W, K, C)
            Measured minus simulated; zero where nothing was measured.
        jacobian : ndarray, shape (W, K, C, n + P)
            Of the channels by the free initial states and the unknowns.
        """
        n, P = len(self.free), len(p) if jacobian and unknowns else 0
        n = n if jacobian else 0
        values: list[float | Array] = list(self.parameters(p))
        lanes = np.repeat(x0[:, None, :], 1 + n + P, axis=1)
        width = np.empty(n + P)
        for j, i in enumerate(self.free[:n]):
            width[j] = NUDGE * self.block.states[i].nominal
            lanes[i, 1 + j] += width[j]
        moved: dict[int, list[float]] = {}
        for j, places in enumerate(self._at[:P]):
            step = NUDGE * max(abs(p[j]), 0.1 * self.size[j])
            width[n + j] = step if p[j] + step <= self.upper[j] else -step
            column = np.full((lanes.shape[1], 1), p[j])
            column[1 + n + j] += width[n + j]
            for at in places:
                values[at] = column
            if j in self._in_motion:
                other = p.copy()
                other[j] += width[n + j]
                moved[1 + n + j] = self.parameters(other)
        x = self._run(lanes, values, self.parameters(p), moved)
        y = self._channels(x, values)
        self.x = x[:, :, 0]
        residual = np.where(
            self.seen, self.cut.values.transpose(1, 2, 0) - y[:, :, 0].transpose(2, 0, 1), 0.0
        )
        if not jacobian:
            return residual, np.empty(0)
        J = (y[:, :, 1:] - y[:, :, :1]) / width[:, None]  # K, C, n+P, W
        return residual, np.where(self.seen[..., None], J.transpose(3, 0, 1, 2), 0.0)

    def _run(
        self,
        lanes: Array,
        values: Sequence[float | Array],
        parameters: Sequence[float],
        moved: dict[int, list[float]],
    ) -> Array:
        """Return the states at every row, (K, n_states, L, W): classical Runge-Kutta."""
        if not self._arrived or self._in_motion:  # else no unknown moves them
            self._arrived = self.commands(parameters, self.t, self.h)
        u, lagged = self._arrived
        u, lagged = u[:, :, :, None, :], {i: v[:, :, None, :] for i, v in lagged.items()}
        if moved:
            L = lanes.shape[1]
            u = np.repeat(u, L, axis=3)
            lagged = {i: np.repeat(v, L, axis=2) for i, v in lagged.items()}
            for lane, other in moved.items():
                own, states = self.commands(other, self.t, self.h)
                u[:, :, :, lane] = own
                for i, v in states.items():
                    lagged[i][:, :, lane] = v
        p = np.array([np.broadcast_to(np.ravel(v), lanes.shape[1]) for v in values])
        return shoot(self.block, self.t, self.h, u, lagged, p, lanes)

    def _channels(self, x: Array, values: Sequence[float | Array]) -> Array:
        """Return the channels at every row, (K, C, L, W)."""
        y = np.empty((x.shape[0], len(self.picked), *x.shape[2:]))
        computed: Sequence[Array] = ()
        if not all(is_state for _, is_state in self.picked):
            time = self.cut.time.T[:, None, :]
            u = np.moveaxis(self.cut.inputs, 2, 1)[:, :, None, :]
            with np.errstate(all="ignore"):
                computed = self._outputs(time, np.moveaxis(x, 1, 0), u, values)
        for c, (i, is_state) in enumerate(self.picked):
            y[:, c] = x[:, i] if is_state else computed[i]
        if (self.scale != 1.0).any():
            y /= self.scale.transpose(1, 2, 0)[:, :, None]
        return y


def _states(block: Block, measured: Measured) -> Array:
    """Return a guess of all states at all rows: as measured, or the slope of what was, else their start."""
    found = np.full((len(block.states), measured.time.size), 0.0)
    found[:] = np.array([s.start for s in block.states])[:, None]
    count = min(len(measured.states), len(found))
    known = np.isfinite(measured.states[:count])
    found[:count] = np.where(known, measured.states[:count], found[:count])
    for i, j in _slopes(block):
        if j < count and known[j].all() and not (i < count and known[i].any()):
            at = np.arange(measured.time.size)
            before, after = np.maximum(at - REACH, 0), np.minimum(at + REACH, at[-1])
            rise = found[j, after] - found[j, before]
            found[i] = rise / np.maximum(measured.time[after] - measured.time[before], 1e-12)
    return found


def _slopes(block: Block) -> list[tuple[int, int]]:
    """Return which states are just the slope of another, with that one: ``position' = velocity``."""
    symbols = [s.symbol for s in block.states]
    slopes = [block.expand(block.derivatives[s.name]) for s in block.states]
    return [(symbols.index(e), j) for j, e in enumerate(slopes) if e in symbols]
