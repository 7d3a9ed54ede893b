"""The estimation problem: one model and the rows of the logs, linearised from each row to the next.

The N steps from row to row are integrated in sub-steps of the classical Runge-Kutta method, with the inputs
held at their mean over each sub-step (:mod:`.steps`). States that depend on the commands alone are computed
beforehand; the other states are free and are estimated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.follow import follow
from hovercontrol.blocks.backends.shoot import Columns, shoot, shoot_with_slopes
from hovercontrol.blocks.block import Block
from hovercontrol.craft.models.base import output_for_channel
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.inputs import Inputs
from hovercontrol.identification.engine.steps import HELD, Counts, Steps
from hovercontrol.identification.engine.subject import (
    FOLLOWED,
    Subject,
    followed_rate,
    rate_key,
    structure,
    timing,
    unknowns,
)
from hovercontrol.identification.engine.unknowns import Unknowns

#: Longest sub-step [s].
STEP = 0.01

#: Number of sub-steps between two rows: initial number if rows are far apart, and maximum.
FEW, MOST = 4, 64

#: Fraction of the steps for which sub-steps are short enough if all steps have the same number of sub-steps,
#: as in simulations over many steps.
ENOUGH = 0.95

#: Standard deviation of a block's first states about the path, relative to the spread of each state.
LOOSE = 10.0

#: Growth of a state from row to row above which sub-steps are too long for friction at rest. An explicit step
#: h along a slope s is unstable for h s > 2.8 (Hairer and Wanner, Solving ODEs II, IV.2); the states of an
#: unstable craft grow only by a few per cent.
GROWTH = 2.0

#: A state of an effect that exceeds its nominal value by this factor has diverged.
DIVERGED = 1e3

#: Smallest spread of the bristle states of a friction model, relative to their nominal value.
SHORTEST = 1e-6

#: Relative size of the perturbations of one-sided differences.
NUDGE = 1e-6


@dataclass(frozen=True, eq=False)
class Linear:
    """A problem linearised about a path; n free states, P unknowns.

    With F the state at the next row, y the channels, dx and dz the deviations of states and unknowns (the
    latter in scaled coordinates z, :class:`.Unknowns`)::

        dx(k+1) = A dx(k) + B dz + defect(k),    residual(k) = H dx(k) + D dz + noise
        A = dF/dx,  B = dF/dz,  defect = F(x(k)) - x(k+1),  H = dy/dx,  D = dy/dz

    Attributes
    ----------
    A : ndarray, shape (K-1, W, n, n)
    B : ndarray, shape (K-1, W, n, P)
    defect : ndarray, shape (K-1, W, n)
        State that the model reaches from a row, minus the path at the next row.
    H : ndarray, shape (K, W, C, n)
    D : ndarray, shape (K, W, C, P)
    residual : ndarray, shape (K, W, C)
        Measured minus path; zero where nothing was measured.
    start : ndarray, shape (n,)
        Standard deviation of a block's first states about the path.
    jolt : ndarray, shape (K-1, W, n), or None
        Change of the next state if commands whose time of change is uncertain change one standard deviation
        later.
    fresh : ndarray of bool, shape (K-1, W), or None
        Steps in which such a change begins to act. Its lateness affects later steps while the command lags.
    """

    A: Array
    B: Array
    defect: Array
    H: Array
    D: Array
    residual: Array
    start: Array
    jolt: Array | None = None
    fresh: NDArray[np.bool_] | None = None

    @property
    def resolved(self) -> bool:
        """Whether sub-steps are short enough for friction at rest, so that sensitivities are meaningful."""
        return bool(np.abs(np.diagonal(self.A, axis1=2, axis2=3)).max(initial=0.0) < GROWTH)


class Problem(Unknowns):
    """A model, the logs in terms of its Block, and the unknowns to estimate.

    Parameters
    ----------
    model : Model or BlockModel
        Its values are the initial values of the unknowns.
    names : sequence of str, optional
        Unknowns; default: all.
    pieces : int or ndarray, shape (N,), optional
        Minimum number of sub-steps of all N steps from row to row, or of each.

    Attributes
    ----------
    period : float
        Sampling period of a sampled model [s], whose rows are its ticks; 0 for a continuous one.
    tempo : float
        By which lengths of time are multiplied (:mod:`.tempo`).
    each : ndarray of int, shape (N,)
        Number of sub-steps of each step.
    pieces : int
        The largest number of sub-steps.
    free : tuple of int
        States that are estimated: all except those that follow from the commands alone.
    driven : tuple of int
        Positions in `free` of the states on which forces act or may act. They have process noise.
    driven_names : tuple of str
    hidden : ndarray of bool, shape (n,)
        Free states of which the logs tell nothing without the model.
    unguessed : bool
        Whether a driven state is one of these.
    """

    def __init__(
        self, model: Subject, data: Data, names: Sequence[str] | None = None, pieces: int | Counts = 1
    ) -> None:
        self.model, self.data, self.logs, self.rows = model, data, data.logs, data.rows
        self.period, self.tempo = model.period, data.tempo
        self.block: Block = structure(model)
        shape = self.rows.time.shape
        self.guess = np.stack(
            [self.rows.guess.get(s.name, np.full(shape, s.start)) for s in self.block.states], axis=-1
        )
        paths = {state.name: self.guess[..., i] for i, state in enumerate(self.block.states)}
        super().__init__(model, self.block, paths, names)
        self.inputs = Inputs(self.block, model, self.logs, self.tempo)
        self.known = self.inputs.known
        self.free = tuple(i for i in range(len(self.block.states)) if i not in self.known)
        self.driven = tuple(j for j, i in enumerate(self.free) if self._is_driven(i))
        outputs, names_ = [s.name for s in self.block.outputs], [s.name for s in self.block.states]
        self.driven_names = tuple(self.block.states[self.free[j]].name for j in self.driven)
        self._picked = [
            (names_.index(c), True)
            if c in names_ and output_for_channel(outputs, c) == c
            else (outputs.index(output_for_channel(outputs, c)), False)
            for c in self.rows.channels
        ]
        functions = self.block.to_numpy()
        self._outputs = functions.array_outputs
        self._output_slopes, self._output_entries = functions.array_partials("outputs")
        self._moves_commands = self._depends_on_inputs()
        self.seen = np.isfinite(self.rows.values)
        self.dt = np.diff(self.rows.time, axis=0)
        steps = self.dt[self.dt > 0]
        self.shortest = float(np.median(steps))
        self.longest = max(0.25 * float(np.median(self.rows.seconds)), 2.0 * self.shortest)
        within = self.guess[..., list(self.free)]
        free = [self.block.states[i] for i in self.free]
        hidden = [s.name not in self.rows.guess or s.name in data.hidden for s in free]
        self.hidden = np.array(hidden, dtype=bool)
        self.unguessed = any(hidden[j] for j in self.driven)
        # A state without a guess from the logs may lie anywhere within its nominal range.
        least = [
            1e-3 * min(float(np.abs(x).max()) or s.nominal, s.nominal)
            if s.name in self.rows.guess
            else s.nominal
            for s, x in zip(free, np.moveaxis(within, 2, 0), strict=True)
        ]
        self.spread = np.maximum(within.std(axis=(0, 1)), least)
        self.accelerations = np.array([self._acceleration(i) for i in self.driven])
        usual = 1 if self.period else math.ceil(float(np.max(self.dt)) / (STEP * self.tempo) - 1e-9)
        pieces = np.maximum(pieces, min(usual, FEW))
        keys = list(self.block.default_parameters)
        if (limit := rate_key(self.block)) in keys and not self.period:
            rate = followed_rate(float(self.dt.max()) / MOST, self.tempo)
            self._every[keys.index(limit)] = rate
            pieces = np.maximum(pieces, np.ceil(self.dt.ravel() * rate / FOLLOWED).astype(np.intp))
        self._steps: dict[bytes, Steps] = {}  # shared by copies: the times of the rows are theirs, too
        self.set_pieces(pieces)

    def of(self, model: Subject) -> Problem:
        """Return the problem for another model on the same rows.

        Its unknowns are the unknowns of this problem that the model has, and the parameters of effects that
        are new in the model.
        """
        mine = self.model.coefficients()
        names = [name for name in unknowns(model) if name in self.names or name not in mine]
        return Problem(model, self.data, names)

    def _acceleration(self, i: int) -> float:
        """Return the root mean square rate of change of a free state along the initial path."""
        own = self.dt > 0
        slopes = np.diff(self.guess[..., self.free[i]], axis=0)[own] / self.dt[own]
        return float(np.sqrt(np.mean(slopes**2))) or float(self.spread[i])

    @property
    def bristles(self) -> list[int]:
        """Estimated states that are not motion: bristle states of friction, which follow it closely."""
        return [i for i in self.free if self.block.states[i].name not in self.model.motion]

    # ---- what the model is ------------------------------------------------------------------------------

    def _is_driven(self, i: int) -> bool:
        """Whether a force may act on a state: its derivative has a parameter or an input of the Block."""
        name = self.block.states[i].name
        if name in self.model.pushed:
            return True
        if name not in self.model.motion:
            return False  # bristle states of friction follow from the motion
        own = {s.symbol for s in (*self.block.parameters, *self.block.inputs)}
        own |= {self.block.states[k].symbol for k in self.known}
        return bool(self.block.expand(self.block.derivatives[name]).free_symbols & own)

    def _depends_on_inputs(self) -> list[int]:
        """Return the indices of the unknowns that change the delay or the lag of the commands."""
        symbols = {self.block.states[i].symbol for i in self.known}
        laws = [self.block.derivatives[s.name].free_symbols for s in self.block.states if s.symbol in symbols]
        acting: set[str] = set().union(*({str(s) for s in law} for law in laws))
        acting |= {name for name in timing(self.model) if name}
        return [j for j, name in enumerate(self.names) if self.block.parameter(name).name in acting]

    def without(self, samples: NDArray[np.bool_]) -> Problem:
        """Return the problem without some samples, a mask of shape (K, W, C)."""
        other = copy(self)
        other.data = self.data.without(samples)
        other.rows, other.seen = other.data.rows, self.seen & ~samples
        return other

    def weighted(self, variance: Array) -> Problem:
        """Return the problem with noise variances of samples relative to their channels', (K, W, C)."""
        other = copy(self)
        other.data = replace(self.data, variance=variance)
        return other

    def path_of(self, block: Block, path: Array, p: Array) -> Array:
        """Return the path of another Block in the states of this problem.

        States that the other Block lacks keep the initial guess, except bristle states of friction. These
        follow the motion from rest with the unknowns `p`.
        """
        other = [s.name for s in block.states]
        found = self.guess.copy()
        for i, s in enumerate(self.block.states):
            if s.name in other:
                found[..., i] = path[..., other.index(s.name)]
        return self.with_bristles(found, p, other)

    def with_bristles(self, path: Array, p: Array, known: Sequence[str] = ()) -> Array:
        """Return a path whose bristle states follow the motion, except the bristle states in `known`."""
        states = [s.name for s in self.block.states]
        new = [i for i in self.bristles if states[i] not in known]
        if not new:
            return path
        parameters = self.parameters(p)
        steps = self.steps.in_time(parameters)
        x = steps.between(path)
        for i, values in steps.lagged.items():
            x[i] = values
        every = follow(self.block, new, steps.t + 0.5 * steps.h, steps.h, x, steps.u, parameters)
        values = every[:, steps.begin, np.arange(steps.begin.shape[1])]
        usual = np.array([self.block.states[i].nominal for i in new])[:, None, None]
        path = path.copy()
        path[..., new] = np.moveaxis(np.where(np.abs(values) < DIVERGED * usual, values, 0.0), 0, -1)
        return path

    # ---- simulation ----------------------------------------------------------------------------------------

    def set_pieces(self, pieces: int | Counts) -> None:
        """Set the number of sub-steps of all steps from row to row, or of each step, shape (N,)."""
        each = np.broadcast_to(np.clip(pieces, 1, MOST), self.dt.size).astype(np.intp)
        key = each.tobytes()
        found = self._steps.pop(key, None) or Steps(self.rows, self.inputs, each)
        while len(self._steps) >= HELD:
            del self._steps[next(iter(self._steps))]
        self.steps = self._steps[key] = found
        self.each, self.pieces = self.steps.each, self.steps.pieces

    @property
    def euler(self) -> bool:
        """Whether the steps are Euler's: those of a sampled model from tick to tick."""
        return self.period > 0.0

    @property
    def longest_piece(self) -> float:
        """Length of a sub-step that is short enough for nearly all steps [s].

        The longest step divided by :attr:`usual_pieces`.
        """
        return float(self.dt.max()) / self.usual_pieces

    def divided(self, begin: Array, end: Array, longest: float = math.inf) -> tuple[Array, Array]:
        """Return begins and lengths of sub-steps of spans, equally many of each, shapes (S, N).

        Parameters
        ----------
        begin, end : ndarray, shape (N,)
        longest : float, optional
            Longest sub-step [s]; at most :attr:`longest_piece`. Those of a sampled model last a period; spans
            of fewer ticks end in sub-steps of length zero.
        """
        if self.period:
            ticks = np.rint((end - begin) / self.period)
            k = np.arange(max(1, int(ticks.max(initial=1))))[:, None]
            return begin + np.minimum(k, ticks) * self.period, np.where(k < ticks, self.period, 0.0)
        finest = min(longest, self.longest_piece or longest)
        S = max(1, int(np.ceil(float((end - begin).max()) / finest - 1e-9)))
        h = np.broadcast_to((end - begin) / S, (S, begin.size))
        return begin + np.arange(S)[:, None] * h, h

    @property
    def usual_pieces(self) -> int:
        """Number of sub-steps that nearly all steps do not exceed."""
        return math.ceil(np.quantile(self.each, ENOUGH))

    def channels_at(self, x: Array, parameters: Sequence[float], t: Array, log: NDArray[np.intp]) -> Array:
        """Return the channels at states, shape (C, N).

        Parameters
        ----------
        x : ndarray, shape (n_states, N)
        t, log : ndarray, shape (N,)
        """
        u = self.inputs.at(parameters, t, log)
        with np.errstate(all="ignore"):
            y = self._outputs(t, x, u, list(parameters))
        return np.stack(
            [x[i] if is_state else np.broadcast_to(y[i], t.shape) for i, is_state in self._picked]
        )

    def columns(self, unknowns: bool = True) -> Columns:
        """Return the columns of the sensitivities: free states, then unknowns."""
        n = len(self.free)
        of_state, of_parameter = [-1] * len(self.block.states), [-1] * len(self.block.parameters)
        for j, i in enumerate(self.free):
            of_state[i] = j
        for j, places in enumerate(self._at if unknowns else []):
            for at in places:
                of_parameter[at] = n + j
        return Columns(of_state, of_parameter)

    def _nudged(self, p: Array, j: int) -> tuple[Array, float]:
        """Return the unknowns with one of them perturbed, and the perturbation."""
        step = NUDGE * max(abs(p[j]), 0.1 * self.size[j])
        step = step if p[j] + step <= self.upper[j] else -step
        other = p.copy()
        other[j] += step
        return other, step

    def advance(
        self,
        x: Array,
        p: Array,
        *,
        jacobian: bool = True,
        unknowns: bool = True,
        late: bool = False,
    ) -> tuple[Array, Array, Array]:
        """Return the free states that the model reaches from each row at the next row, with derivatives.

        Parameters
        ----------
        x : ndarray, shape (K, W, n_states)
        p : ndarray, shape (P,)
        jacobian, unknowns : bool, optional
            Whether to return derivatives, and whether these include the unknowns.
        late : bool, optional
            Whether commands whose time of change is uncertain act one standard deviation later.

        Returns
        -------
        ndarray, shape (K-1, W, n)
            F, the states reached.
        ndarray, shape (K-1, W, n, n)
            dF/dx
        ndarray, shape (K-1, W, n, P)
            dF/dp
        """
        parameters, n = self.parameters(p), len(self.free)
        columns = self.columns(unknowns) if jacobian else None
        start = np.moveaxis(x[:-1], 2, 0).reshape(x.shape[2], -1)
        end, slopes = self._shot(start, parameters, columns, late)
        F = np.moveaxis(end.reshape(n, *self.dt.shape), 0, 2)
        if columns is None:
            return F, np.empty(0), np.empty(0)
        J = np.moveaxis(slopes.reshape(n, columns.count, *self.dt.shape), (0, 1), (2, 3))
        A, B = J[..., :n], J[..., n:]
        # Unknowns that also change the commands: one-sided difference (F(p + d e_j) - F(p)) / d
        for j in self._moves_commands if unknowns else ():
            other, step = self._nudged(p, j)
            every = self.parameters(other)
            there = self._shot(start, every)[0]
            B[..., j] = np.moveaxis((there - end).reshape(n, *self.dt.shape), 0, 2) / step
        return F, A, B

    def _shot(
        self, start: Array, parameters: Sequence[float], columns: Columns | None = None, late: bool = False
    ) -> tuple[Array, Array]:
        """Return the free states after the steps from row to row, shape (n, N), and their derivatives."""
        free = list(self.free)
        end = np.empty((len(free), start.shape[1]))
        slopes = np.empty((len(free), columns.count if columns else 0, start.shape[1]))
        for at, s in self.steps.divided(parameters, late):
            known = {i: v[:, None] for i, v in s.lagged.items()}
            begin = start if at.size == start.shape[1] else start[:, at]
            given = (self.block, s.t[:, None], s.h[:, None], s.u[:, :, None], known, parameters, begin)
            if columns:
                states, found = shoot_with_slopes(*given, columns, euler=self.euler)
                slopes[..., at] = found[free]
            else:
                states = shoot(*given, euler=self.euler)
            end[:, at] = states[1, free]
        return end, slopes

    def observe(self, x: Array, p: Array) -> tuple[Array, Array, Array]:
        """Return the channels y, dy/dx and dy/dp at all rows; (K, W, C), (K, W, C, n) and (K, W, C, P)."""
        K, W, _ = x.shape
        n, P, C = len(self.free), len(p), len(self._picked)
        y, H, D = np.empty((K, W, C)), np.zeros((K, W, C, n)), np.zeros((K, W, C, P))
        computed = [c for c, (_, is_state) in enumerate(self._picked) if not is_state]
        for c, (i, is_state) in enumerate(self._picked):
            if is_state:
                y[..., c] = x[..., i]
                if i in self.free:
                    H[..., c, self.free.index(i)] = 1.0
        if computed:
            parameters, columns = self.parameters(p), self.columns()
            at = (self.rows.time, np.moveaxis(x, 2, 0), self._inputs_at_rows(parameters), parameters)
            with np.errstate(all="ignore"):
                found = self._outputs(*at)
                slopes = self._output_slopes(*at)
            for c in computed:
                y[..., c] = found[self._picked[c][0]]
            of = {self._picked[c][0]: c for c in computed}
            column_of = (*columns.of_state, *columns.of_parameter)
            for (i, k), value in zip(self._output_entries, slopes, strict=True):
                if i in of and (j := column_of[k]) >= 0:
                    part, j = (H, j) if j < n else (D, j - n)
                    part[..., of[i], j] += np.where(np.isfinite(value), value, 0.0)
        return y, H, D

    def _inputs_at_rows(self, parameters: Sequence[float]) -> Array:
        """Return the commands that hold at the rows, (n_inputs, K, W)."""
        log = np.broadcast_to(self.rows.log, self.rows.time.shape)
        return self.inputs.at(parameters, self.rows.time, log)

    def sizes_alone(self) -> Array:
        """Return the size of each unknown at which its term alone explains an observed acceleration, (P,).

        If an unknown acts on several driven states, the smallest size counts.
        """
        # size_j = min over driven states i of rms(x_i') / rms(df_i/dp_j), df_i/dp_j by a one-sided difference
        part = slice(None, None, max(1, self.dt.shape[0] // 40))
        x = np.moveaxis(self.guess[:-1][part], 2, 0)
        u = self._inputs_at_rows(self.parameters(self.start))[:, :-1][:, part]
        t, every = self.rows.time[:-1][part], self.parameters(self.start)
        function = self.block.to_numpy().array_derivatives
        with np.errstate(all="ignore"):
            base = function(t, x, u, every)
            sizes = np.full(len(self.names), np.inf)
            for j, places in enumerate(self._at):
                other = list(every)
                for at in places:
                    other[at] = every[at] + self.sign[j] * self.size[j]
                new = function(t, x, u, other)
                for k, i in enumerate(self.driven):
                    change = np.asarray(new[self.free[i]] - base[self.free[i]])
                    rms = float(np.sqrt(np.nanmean(change**2))) / self.size[j]
                    if rms > 0 and np.isfinite(rms):
                        sizes[j] = min(sizes[j], self.accelerations[k] / rms)
        return np.where(np.isfinite(sizes), sizes, self.size)

    def linearise(self, x: Array, p: Array, *, unknowns: bool = True) -> Linear:
        """Linearise about a path, with the unknowns in scaled coordinates (:class:`.Unknowns`)."""
        F, A, B = self.advance(x, p, unknowns=unknowns)
        y, H, D = self.observe(x, p)
        if not unknowns:
            B, D = B[..., :0], D[..., :0]
        slope = self.slope(p) if unknowns else np.empty(0)
        residual = np.where(self.seen, self.rows.values - y, 0.0)
        still = self.dt <= 0
        jolt = fresh = None
        if self.inputs.unsure:
            jolt = self.advance(x, p, jacobian=False, late=True)[0] - F
            jolt[still] = 0.0
            fresh = self._fresh(self.inputs.delay(self.parameters(p)))
        defect = F - x[1:][..., list(self.free)]
        A, B = np.array(A, order="C"), np.array(B, order="C") * slope
        A[still], B[still], defect[still] = np.eye(len(self.free)), 0.0, 0.0
        H[~self.seen] = 0.0
        if D.any():
            D = np.where(self.seen[..., None], D * slope, 0.0)
        return Linear(A, B, defect, H, D, residual, self._starts(x), jolt, fresh)

    def _starts(self, path: Array) -> Array:
        """Return the standard deviation of a block's first states about the path, shape (n,).

        It is wide for states of motion; for bristle states it is their standard deviation along the path.
        """
        found = LOOSE * self.spread
        for i in self.bristles:
            own = float(path[..., i].std())
            found[self.free.index(i)] = max(own, SHORTEST * self.block.states[i].nominal)
        return found

    def _fresh(self, delay: float) -> NDArray[np.bool_]:
        """Return the steps in which a command of uncertain time of change begins to act, (K-1, W)."""
        found = np.zeros(self.dt.shape, dtype=bool)
        for w, log in enumerate(self.rows.log.tolist()):
            step = np.searchsorted(self.rows.time[:, w], self.inputs.unsure[log] + delay, side="right") - 1
            found[step[(step >= 0) & (step < len(found))], w] = True
        return found
