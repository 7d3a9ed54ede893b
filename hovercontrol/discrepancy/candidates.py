"""What each effect of the catalogue would add to the logs, and how much of the misfit it takes.

The signature of an effect is the linearised answer of the measured channels to it, at one trial value of each
of its shapes; where it is linear in its coefficient, that is all there is to know near the present model.
Gains are those of a score test: the fall of twice the negative log likelihood if the effect's coefficient
and all unknowns of the model moved to their linear best (Rao 1948).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.discrepancy.arrival import input_states
from hovercontrol.discrepancy.fit import Fit
from hovercontrol.discrepancy.noise import Noise, whiten
from hovercontrol.discrepancy.reduce import inflation, reduce, scaled_inverse
from hovercontrol.discrepancy.subject import Subject, structure, timing
from hovercontrol.discrepancy.windowed import Windowed
from hovercontrol.effects import Effect, Shape, effect_class, effect_names
from hovercontrol.errors import InputError

Array = NDArray[np.float64]

#: Points between two rows at which an effect's force is looked at.
POINTS = 3

#: Size of the trial of a number that enters linearly; in units of its own, the answer being linear.
TRIAL = 1e-2

#: A signature of which less than this part is left, after the model's own unknowns, says nothing.
VANISHING = 1e-7


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect at trial values of its shapes.

    Attributes
    ----------
    name : str
        Of the effect.
    trial : Effect
    amplitudes : tuple of str
        Its numbers that scale it; each has a column. Without any the trial as a whole has one.
    """

    name: str
    trial: Effect
    amplitudes: tuple[str, ...]

    def at(self, parts: Sequence[float]) -> Effect:
        """Return the effect with its amplitudes at parts of the trial's, within their bounds."""
        if not self.amplitudes:
            return self.trial
        cls, values = type(self.trial), dict(self.trial.values)
        for key, part in zip(self.amplitudes, parts, strict=True):
            number = cls.numbers[key]
            value = number.neutral + part * (values[key] - number.neutral)
            values[key] = float(np.clip(value, number.lower, number.upper))
        return cls(**values)

    def allowed(self, parts: Sequence[float]) -> bool:
        """Tell whether those amplitudes are within their bounds: a drag does not push."""
        if not self.amplitudes:
            return bool(0.3 < parts[0] < 3.0)
        for key, part in zip(self.amplitudes, parts, strict=True):
            number = type(self.trial).numbers[key]
            value = number.neutral + part * (self.trial.values[key] - number.neutral)
            if not number.lower <= value <= number.upper:
                return False
        return True


@dataclass(frozen=True, eq=False)
class Scored:
    """What a candidate would gain.

    Attributes
    ----------
    candidate : Candidate
    gain : float
        Fall of minus twice the log likelihood.
    parts : ndarray
        Amplitudes, in parts of the trial's.
    columns : tuple of int
        Which columns of the signatures are its own.
    allowed : bool
        Whether the amplitudes are within bounds.
    """

    candidate: Candidate
    gain: float
    parts: Array
    columns: tuple[int, ...]
    allowed: bool

    @property
    def effect(self) -> Effect:
        """The effect at its linear best."""
        return self.candidate.at(self.parts.tolist())


def candidates(fit: Fit, names: Sequence[str] | None = None) -> list[Candidate]:
    """Return trials of all effects that the model does not have.

    Parameters
    ----------
    fit : Fit
    names : sequence of str, optional
        Effects to try; default: all that are known and fit the craft.
    """
    w = fit.windowed
    have = {e.name for e in w.model.effects}
    scales = _scales(w)
    found = []
    for name in names if names is not None else effect_names():
        cls = effect_class(name)
        if name in have or not w.model.accepts(cls):
            continue
        amplitudes = tuple(k for k, n in cls.numbers.items() if not math.isnan(n.neutral) and k != "width_")
        grid = []
        for key, number in cls.numbers.items():
            if isinstance(number, Shape) and number.search:
                scale = scales.get(
                    f"speed_{getattr(cls, 'axis', '')}" if number.of == "speed" else number.of, 1.0
                )
                grid.append([(key, part * scale) for part in number.search])
            elif isinstance(number, Shape):
                grid.append([(key, _width(w, fit, cls, number.default))])
            else:
                grid.append([(key, number.neutral + TRIAL)])
        trials = [cls(**dict(values)) for values in itertools.product(*grid)]
        if names is not None or _fits(w.model, trials[0]):
            found += [Candidate(name, trial, amplitudes) for trial in trials]
    return found


def _fits(model: Subject, e: Effect) -> bool:
    """Whether an effect, somebody's own perhaps and meant for another machine, can act in a model."""
    try:
        structure(model.with_effects([e]))
    except (AttributeError, InputError):
        return False
    return True


def zoom(fit: Fit, scored: Scored) -> Scored:
    """Return a candidate with the time of its jump found to a row, by score; others as they are."""
    cls = type(scored.candidate.trial)
    jumps = [k for k, n in cls.numbers.items() if isinstance(n, Shape) and n.of == "time"]
    if not jumps:
        return scored
    key = jumps[0]
    rows = float(np.median(fit.response.dt))
    reach = fit.windowed.data.duration / len(cls.numbers[key].search)  # type: ignore[attr-defined]
    best = scored
    while reach > 0.5 * rows:
        centre = best.candidate.trial.values[key]
        places = centre + reach * np.linspace(-1.0, 1.0, 9)
        tried = [
            Candidate(
                cls.name, cls(**{**best.candidate.trial.values, key: float(t)}), best.candidate.amplitudes
            )
            for t in places
        ]
        signatures = Signatures(fit, tried)
        scores = Scores(fit, signatures)
        best = max((scores.of(i) for i in range(len(tried))), key=_worth)
        reach *= 0.25
    return best


def _width(w: Windowed, fit: Fit, cls: type[Effect], default: float | None) -> float:
    """Return the width of friction along the effect's axis, as found for the model's own."""
    axis = getattr(cls, "axis", "")
    for e in w.model.effects:
        if getattr(e, "axis", None) == axis and e.parameter("width") in w.names:
            return float(fit.p[w.names.index(e.parameter("width"))])
    return default or 0.01


def _scales(w: Windowed) -> dict[str, float]:
    names = [s.name for s in w.block.states]
    # of a craft that stands still most of the time the speed while it moves
    squares = [w.x[:, i] ** 2 for i in range(len(names))]
    speeds = [math.sqrt(float(np.mean(x**2)) / max(float(np.mean(x)), 1e-300)) for x in squares]
    found = {f"speed_{n}": v or 1.0 for n, v in zip(names, speeds, strict=True)}
    thrusts = [i for i, s in enumerate(w.block.inputs) if s.name != "rudder"]
    largest = max((float(np.abs(m.inputs[thrusts]).max(initial=0.0)) for m in w.data.logs), default=0.0)
    return {**found, "input": largest or 1.0, "time": w.data.duration}


class Signatures:
    """The signatures of candidates along a fit's free runs.

    Parameters
    ----------
    fit : Fit
    tried : sequence of Candidate

    Attributes
    ----------
    columns : ndarray, shape (W, K, C, M)
        A column for each amplitude of each candidate.
    own : list of tuple of int
        Each candidate's columns.
    """

    def __init__(self, fit: Fit, tried: Sequence[Candidate]) -> None:
        self.fit, self.tried = fit, list(tried)
        w = self._w = fit.windowed
        self._parameters = w.parameters(fit.p)
        self._commands: tuple[Array, Array] | None = None
        self._values = dict(zip(w.block.default_parameters, self._parameters, strict=True))
        parts = (np.arange(POINTS) + 0.5) / POINTS
        dt = np.diff(w.cut.time, axis=1).T
        self._h = dt / POINTS
        self._t = w.cut.time.T[None, :-1] + (parts - 0.5 / POINTS)[:, None, None] * dt
        x = w.x
        between = x[None, :-1] + parts[:, None, None, None] * (x[1:] - x[:-1])[None]
        self._x = np.moveaxis(between, 2, 0)  # n_states, POINTS, K-1, W
        self._base = self._slopes(w.model, self._values, {})
        self.own, blocks = [], []
        forces: list[Array] = []
        places: list[tuple[int, int]] = []
        width = 0
        for candidate in self.tried:
            mine = []
            for key in candidate.amplitudes or ("",):
                alone = self._alone(candidate, key)
                mine.append(width)
                if type(alone).kind() == "measurement" and not self._is_late(alone):
                    blocks.append((width, self._seen(alone)))
                else:
                    places.append((width, len(forces)))
                    forces.append(self._forcing(alone))
                width += 1
            self.own.append(tuple(mine))
        W, K, C = w.seen.shape
        self.columns = np.zeros((W, K, C, width))
        if forces:
            answer = fit.response.to(np.stack(forces, axis=-1))
            for column, j in places:
                self.columns[..., column] = answer[..., j]
        for column, values in blocks:
            self.columns[..., column] = np.where(w.seen, values, 0.0)

    @staticmethod
    def _alone(candidate: Candidate, key: str) -> Effect:
        """Return the trial with one amplitude, the others neutral."""
        numbers, values = type(candidate.trial).numbers, dict(candidate.trial.values)
        for other in candidate.amplitudes:
            if other != key:
                values[other] = numbers[other].neutral
        return type(candidate.trial)(**values)

    def _is_late(self, e: Effect) -> bool:
        """Whether the effect is a shift of the log's clock, which commands that act late do as well."""
        w = self._w
        return timing(w.model.with_effects([e])) != timing(w.model)

    def _forcing(self, e: Effect) -> Array:
        """Return what an effect adds to the free states' derivatives, (K-1, W, n)."""
        w = self._w
        model = w.model.with_effects([e])
        own = {f"{w.block.name}.{e.parameter(k)}": v for k, v in e.values.items()}
        added = self._slopes(model, {**self._values, **own}, own) - self._base
        return np.moveaxis(added, 0, -1)

    def _slopes(self, model: Subject, values: Mapping[str, float], own: Mapping[str, float]) -> Array:
        """Return a model's derivatives of the free states, the means from row to row, (n, K-1, W)."""
        w, block = self._w, structure(model)
        every = [values.get(name, start) for name, start in block.default_parameters.items()]
        delay = sum(values[name] for name in timing(model) if name)
        x = np.empty((len(block.states), *self._t.shape))
        x[: len(self._x)] = self._x
        known = input_states(block)
        same = timing(model) == timing(w.model)
        if self._commands and same and all(i < len(self._x) for i in known):
            u, x = self._commands
            return self._mean(block, x, u, every)
        u = np.empty((len(block.inputs), *self._t.shape))
        for k, log in enumerate(w.data.logs):
            windows = np.flatnonzero(w._log_of == k)
            begin, h = self._t[..., windows], np.maximum(self._h[:, windows], 1e-9)
            arrival = w.arrivals[k] if block is w.block else w.arrival(block, log)
            u[..., windows] = arrival.mean(begin, begin + h, delay)
            for i, lagged in arrival.lagged(begin + 0.5 * h, every, delay).items():
                x[i][..., windows] = lagged
        if block is w.block:
            self._commands = u, x
        return self._mean(block, x, u, every)

    def _mean(self, block: Block, x: Array, u: Array, every: Sequence[float]) -> Array:
        t = self._t + 0.5 * self._h
        with np.errstate(all="ignore"):
            slopes = block.to_numpy().vector[0](t, x, u, every)
        names = [s.name for s in block.states]
        rows = [names.index(self._w.block.states[i].name) for i in self._w.free]
        return np.stack([np.broadcast_to(slopes[i], t.shape).mean(axis=0) for i in rows])

    def _seen(self, e: Effect) -> Array:
        """Return what a measurement effect adds to the channels, (W, K, C)."""
        w = self._w
        model = w.model.with_effects([e])
        block = structure(model)
        x, u = np.moveaxis(w.x, 1, 0), np.moveaxis(w.cut.inputs, 2, 1)
        t = w.cut.time.T
        found = np.zeros((*t.shape, len(w.picked)))
        own = {f"{w.block.name}.{e.parameter(k)}": v for k, v in e.values.items()}
        values = {k: {**self._values, **own}.get(k, v) for k, v in block.default_parameters.items()}
        after = block.to_numpy().outputs(t, x, u, values)
        before = w.block.to_numpy().outputs(t, x, u, self._values)
        outputs = [s.name for s in block.outputs]
        old = [s.name for s in w.block.outputs]
        for c, channel in enumerate(w.data.channels):
            new_name = f"{channel}_measured" if f"{channel}_measured" in outputs else channel
            old_name = f"{channel}_measured" if f"{channel}_measured" in old else channel
            found[..., c] = after[outputs.index(new_name)] - before[old.index(old_name)]
        return found.transpose(1, 0, 2) / w.scale


class Scores:
    """Gains of candidates, alone and together, at one noise.

    Parameters
    ----------
    fit : Fit
    signatures : Signatures
    noise : Noise, optional
        Default: the fit's.

    Attributes
    ----------
    cost : float
        Minus twice the log likelihood of the model without candidates, at this noise.
    inflation : float
        What gains are divided by where gusts make windows depend on each other.
    """

    def __init__(self, fit: Fit, signatures: Signatures, noise: Noise | None = None) -> None:
        w = fit.windowed
        noise = noise or fit.noise
        n, movable = len(w.free), fit.movable
        held = np.setdiff1d(np.arange(len(fit.p)), movable)  # by a bound, from which they may come back
        order = np.concatenate([movable, held])
        own = fit.jacobian[..., np.concatenate([np.arange(n), n + order])]
        columns = np.concatenate([fit.residual[..., None], own, signatures.columns], axis=-1)
        white, det = whiten(columns, w.seen, noise, fit.response, w.errors)
        normal = reduce(white, n)
        P, every = len(movable), np.arange(len(order))
        S, g = normal.S.copy(), normal.g.copy()
        S[every, every] += fit.prior[order]
        inverse = scaled_inverse(S[:P, :P])
        left = S[P:, P:] - S[P:, :P] @ inverse @ S[:P, P:]
        pull = g[P:] - S[P:, :P] @ inverse @ g[:P]
        self._S, self._g, self._held = left, pull, len(held)
        self._inward = np.where(fit.p[held] <= w.lower[held] + 1e-6 * w.size[held], 1.0, -1.0)
        self.S, self.g = left[len(held) :, len(held) :], pull[len(held) :]
        self._whole = np.diag(S)[P + len(held) :]
        each = normal.scores[:, P:] - normal.scores[:, :P] @ inverse @ S[:P, P:]
        each = each[:, len(held) :]
        self.inflation = inflation(each, self.S, w.blocks()) if noise.has_process else 1.0
        self.cost = normal.rest - float(g[:P] @ inverse @ g[:P]) + float(det.sum())
        self._signatures = signatures

    def of(self, candidate: int) -> Scored:
        """Return the score of a candidate alone, by its place."""
        own = list(self._signatures.own[candidate])
        tried = self._signatures.tried[candidate]
        gain, parts = self.together(own)
        allowed = tried.allowed(parts.tolist())
        return Scored(tried, gain, parts, tuple(own), allowed)

    def together(self, columns: Sequence[int]) -> tuple[float, Array]:
        """Return gain and amplitudes of columns together."""
        own = list(columns)
        S, g = self.S[np.ix_(own, own)], self.g[own]
        left = np.diag(S) > VANISHING * self._whole[own]
        if not left.all():
            return 0.0, np.zeros(len(own))
        held = np.arange(self._held)
        while True:  # unknowns at a bound move along where that is inwards
            both = np.concatenate([held, self._held + np.array(own)])
            S, g = self._S[np.ix_(both, both)], self._g[both]
            size = np.sqrt(np.maximum(np.diag(S), 1e-300))
            parts = np.linalg.solve(S / np.outer(size, size) + 1e-9 * np.eye(len(both)), g / size) / size
            outwards = parts[: len(held)] * self._inward[held] < 0.0
            if not outwards.any():
                return float(g @ parts) / self.inflation, parts[len(held) :]
            held = held[~outwards]

    def best(self) -> list[Scored]:
        """Return the best trial of each effect, by falling gain."""
        top: dict[str, Scored] = {}
        for i in range(len(self._signatures.tried)):
            scored = self.of(i)
            name = scored.candidate.name
            if name not in top or _worth(scored) > _worth(top[name]):
                top[name] = scored
        return sorted(top.values(), key=lambda s: -_worth(s))

    def correlation(self, one: Sequence[int], other: Sequence[int]) -> float:
        """Return the largest correlation of two sets of signatures, the model's unknowns projected out."""
        a, b = list(one), list(other)
        whiten_a, whiten_b = (_root_of_inverse(self.S[np.ix_(own, own)]) for own in (a, b))
        between = whiten_a @ self.S[np.ix_(a, b)] @ whiten_b.T
        return float(np.linalg.svd(between, compute_uv=False).max(initial=0.0))


def _root_of_inverse(M: Array) -> Array:
    """Return R with R M R' = 1 in the directions of which M says something."""
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    kept = values > 1e-9
    root: Array = (vectors[:, kept] / np.sqrt(values[kept])).T / size
    return root


def _worth(scored: Scored) -> float:
    return scored.gain if scored.allowed else 0.0
