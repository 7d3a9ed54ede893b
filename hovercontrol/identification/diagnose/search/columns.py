"""Columns of candidates: what each amplitude adds to the states and channels of a fit, along its path.

For the states, a column is the difference in slope with and without the effect, in the middles of sub-steps
along the fixed path of the fit, carried to the next row. For the channels, it is the difference in output.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import groupby, islice

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.follow import follow
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import Function, array_function
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.base import output_for_channel
from hovercontrol.identification.diagnose.search.candidates import Candidate
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.noise import Columns
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.subject import Subject, followed_rate, rate_key, structure, timing
from hovercontrol.identification.engine.substeps import within

#: Forms that are carried to the next rows at a time.
TOGETHER = 32


def columns(fit: Fit, tried: Sequence[Candidate]) -> tuple[list[Columns], list[tuple[int, ...]]]:
    """Return what each amplitude of each candidate adds to states and channels, and the columns of each.

    Returns
    -------
    groups : list of Columns
        For :func:`.augment`: first those that add to the free states from row to row, then those that add to
        the channels.
    own : list of tuple of int
        Columns of each candidate.
    """
    problem = fit.problem
    parts = [
        (i, None if c.trial.equation else _alone(c, key))
        for i, c in enumerate(tried)
        for key in (("value",) if c.trial.equation else c.amplitudes or ("",))
    ]
    shown = [k for k, (_, e) in enumerate(parts) if e is not None and _is_shown(problem, e)]
    order = [*(k for k in range(len(parts)) if k not in set(shown)), *shown]
    # each column is contiguous in memory
    drive = np.zeros((len(parts) - len(shown), *problem.dt.shape, len(problem.free)))
    seen = np.zeros((len(shown), *problem.seen.shape))
    own: list[list[int]] = [[] for _ in tried]
    runs = Along(fit)
    forms = runs.forcing_of_forms([c.trial for c in tried if c.trial.equation])
    for at, k in enumerate(order):
        i, alone = parts[k]
        own[i].append(at)
        with np.errstate(all="ignore"):
            if alone is None:
                drive[at] = _finite(next(forms))
            elif at < len(drive):
                drive[at] = _finite(runs.forcing(alone))
            else:
                seen[at - len(drive)] = -_finite(runs.seen(alone))
    groups: list[Columns] = [(np.moveaxis(drive, 0, -1), None)] if len(drive) else []
    groups += [(None, np.moveaxis(seen, 0, -1))] if len(seen) else []
    return groups, [tuple(at) for at in own]


def _is_shown(problem: Problem, e: Effect) -> bool:
    """Return whether an effect adds to the channels alone, not to the states."""
    late = timing(problem.model.with_effects([e])) != timing(problem.model)
    return type(e).kind() == "measurement" and not late


def _finite(column: Array) -> Array:
    """Return a column, or zeros if it is not finite: a trial that diverges carries no information."""
    return column if np.isfinite(column).all() else np.zeros_like(column)


def _alone(candidate: Candidate, key: str) -> Effect:
    """Return the trial with one amplitude and the others at their neutral values."""
    numbers, values = type(candidate.trial).numbers, dict(candidate.trial.values)
    for other in candidate.amplitudes:
        if other != key:
            values[other] = numbers[other].neutral
    return candidate.trial.within_bounds(**values)


class Along:
    """Forces and measurements of effects along a fit's path."""

    def __init__(self, fit: Fit) -> None:
        self.fit, self.problem = fit, fit.problem
        problem = self.problem
        self._values = dict(zip(problem.block.default_parameters, problem.parameters(fit.p), strict=True))
        self._within = within(fit)
        self._steps = self._within.steps
        self._rate = {rate_key(problem.block): followed_rate(float(self._steps.h.max()), problem.tempo)}
        # where rates are taken: in the middles of sub-steps, or at the ticks of a sampled model
        self._t = self._steps.t + (0.0 if problem.period else 0.5) * self._steps.h
        self._base: Array | None = None
        self._means: dict[float, Array] = {}
        self._lagged: dict[tuple[object, ...], list[Array]] = {}

    def forcing(self, e: Effect) -> Array:
        """Return what an effect adds to the free states from row to row, (K-1, W, n).

        With the slopes f in the middle of sub-step s of length h_s, and Phi_s the mean transition matrix from
        within this sub-step to the next row::

            drive = sum over s of h_s Phi_s (f with the effect - f without it)
        """
        problem = self.problem
        model = problem.model.with_effects([e])
        own = {f"{problem.block.name}.{e.parameter(k)}": v for k, v in e.values.items()}
        values = {**self._rate, **self._values, **own}
        added = self._difference(model, values)
        if added is None:
            if self._base is None:
                self._base = self._slopes(problem.model, self._values)
            added = self._slopes(model, values) - self._base
        return self._within.become(added)

    def forcing_of_forms(self, effects: Sequence[Effect]) -> Iterator[Array]:
        """Return what effects of one form add to the free states from row to row, each (K-1, W, n).

        As :meth:`forcing`, all by one function: the difference of the slopes is the effect's own term.

        Parameters
        ----------
        effects : sequence of Effect
            Each adds a coefficient times a form to one equation; at their trial values.
        """
        own = zip(effects, self._forms_in_turn(effects), strict=True)
        for equation, alike in groupby(own, key=lambda one: one[0].equation):
            while part := [e.values["value"] * form for e, form in islice(alike, TOGETHER)]:
                yield from self.carried(equation, np.stack(part))

    def _forms_in_turn(self, effects: Sequence[Effect]) -> list[Array]:
        """Return the form of each effect; one effect may be there several times, with other numbers."""
        turn = Counter[str]()
        order = [(turn.update([e.name]), turn[e.name])[1] for e in effects]
        found: dict[int, Array] = {}
        for now in sorted(set(order)):
            at = [k for k, one in enumerate(order) if one == now]
            found |= dict(zip(at, self.forms([effects[k] for k in at]), strict=True))
        return [found[k] for k in range(len(effects))]

    def forms(self, effects: Sequence[Effect]) -> list[Array]:
        """Return the form of each effect, its term per coefficient, in the middles of sub-steps (M, W)."""
        if not effects:
            return []
        model = self.problem.model.with_effects(effects)
        block = structure(model)
        x, u, every = self._path(model, block, {**self._rate, **self._values})
        function = array_function(block, [term_of(block, e) for e in effects])
        with np.errstate(all="ignore"):
            return [np.broadcast_to(f, self._t.shape) for f in function(self._t, x, u, every)]

    def carried(self, equation: str, rates: Array) -> Array:
        """Return what each of F rates of one state, (F, M, W), adds to the free states from row to row.

        Shape (F, K-1, W, n).
        """
        names = [s.name for s in self.problem.block.states]
        return self._within.carried(self.problem.free.index(names.index(equation)), rates)

    def _difference(self, model: Subject, values: Mapping[str, float]) -> Array | None:
        """Return the slopes of a model minus those of the fit, (n, M, W), from the changed terms alone.

        None if commands arrive at other times, or if parameters common to both differ.
        """
        problem, block = self.problem, structure(model)
        alike = timing(model) == timing(problem.model)
        alike = alike and all(values[k] == v for k, v in self._values.items())
        changed = _changed(block, problem.block, problem.free) if alike else None
        if changed is None:
            return None
        rows, function = changed
        x, u, every = self._path(model, block, values)
        added = np.zeros((len(problem.free), *self._t.shape))
        with np.errstate(all="ignore"):
            for row, found in zip(rows, function(self._t, x, u, every), strict=True):
                added[row] = found
        return added

    def _slopes(self, model: Subject, values: Mapping[str, float]) -> Array:
        """Return the slopes of the free states in the middles of sub-steps, (n, M, W)."""
        problem, block = self.problem, structure(model)
        x, u, every = self._path(model, block, values)
        with np.errstate(all="ignore"):
            slopes = block.to_numpy().array_derivatives(self._t, x, u, every)
        names = [s.name for s in block.states]
        rows = [names.index(problem.block.states[i].name) for i in problem.free]
        return np.stack([np.broadcast_to(slopes[i], self._t.shape) for i in rows])

    def _path(
        self, model: Subject, block: Block, values: Mapping[str, float]
    ) -> tuple[Array, Array, list[float]]:
        """Return states and inputs of a Block in the middles of sub-steps, and its parameters."""
        problem = self.problem
        every = [values.get(name, start) for name, start in block.default_parameters.items()]
        x = np.zeros((len(block.states), *self._t.shape))
        names = [s.name for s in problem.block.states]
        u, lagged = self._commands(model, block, every)
        new = []
        for i, s in enumerate(block.states):
            if s.name in names:
                x[i] = self._within.states[names.index(s.name)]
            elif i in lagged:
                x[i] = lagged[i]
            else:
                new.append(i)
        for i in lagged:
            x[i] = lagged[i]
        if new:
            self._simulate(block, new, x, u, every)
        return x, u, every

    def _simulate(self, block: Block, new: list[int], x: Array, u: Array, every: list[float]) -> None:
        """Simulate the states that only a candidate has, along the path, from zero in each stretch."""
        x[new] = follow(block, new, self._t, self._steps.h, x, u, every)[:, :-1]

    def _commands(self, model: Subject, block: Block, every: list[float]) -> tuple[Array, dict[int, Array]]:
        inputs, steps, log = self.problem.inputs.of(block, model), self._steps, self.problem.rows.log
        delay = inputs.delay(every)
        if delay not in self._means:
            self._means[delay] = inputs.means(delay, steps.t, steps.h, log)
        parameters = {s.symbol: value for s, value in zip(block.parameters, every, strict=True)}
        laws = [block.expand(block.derivatives[block.states[i].name]) for i in inputs.known]
        used = sorted(set().union(*(law.free_symbols for law in laws)) & parameters.keys(), key=str)
        key = delay, tuple(laws), tuple((s, parameters[s]) for s in used)
        if key not in self._lagged:
            self._lagged[key] = list(inputs.lagged(every, steps.t, steps.h, log).values())
        return self._means[delay], dict(zip(inputs.known, self._lagged[key], strict=True))

    def seen(self, e: Effect) -> Array:
        """Return what a measurement effect adds to the channels, (K, W, C)."""
        problem = self.problem
        block = structure(problem.model.with_effects([e]))
        own = {f"{problem.block.name}.{e.parameter(k)}": v for k, v in e.values.items()}
        values = {k: {**self._values, **own}.get(k, v) for k, v in block.default_parameters.items()}
        x = np.moveaxis(self.fit.path, 2, 0)
        u = problem._inputs_at_rows(problem.parameters(self.fit.p))
        after = block.to_numpy().outputs(problem.rows.time, x, u, values)
        before = problem.block.to_numpy().outputs(problem.rows.time, x, u, self._values)
        new = [s.name for s in block.outputs]
        old = [s.name for s in problem.block.outputs]
        found = np.zeros(problem.rows.values.shape)
        for c, channel in enumerate(problem.rows.channels):
            seen, was = (
                new.index(output_for_channel(new, channel)),
                old.index(output_for_channel(old, channel)),
            )
            found[..., c] = after[seen] - before[was]
        return np.where(problem.seen, found, 0.0)


def term_of(block: Block, e: Effect) -> sp.Expr:
    """Return the term of an effect of one form in a Block that has it, per coefficient."""
    own = block.parameter(e.parameter("value")).symbol
    terms = sp.Add.make_args(block.expand(block.derivatives[e.equation]))
    return sp.Add(*(sp.diff(term, own) for term in terms if own in term.free_symbols))


@lru_cache(maxsize=256)
def _changed(block: Block, base: Block, free: tuple[int, ...]) -> tuple[list[int], Function] | None:
    """Return the free states of a Block whose derivatives differ from those of another, and the differences.

    Parameters
    ----------
    block, base : Block
    free : tuple of int
        States of `base`.

    Returns
    -------
    list of int
        Indices in `free`.
    callable
        ``(t, x, u, p) -> tuple`` of arrays; arguments are those of `block`.

    None if the derivative of a state that is not free differs too.
    """
    rows, wanted = [], []
    for i, s in enumerate(base.states):
        law, before = block.derivatives[s.name], base.derivatives[s.name]
        if block.definitions != base.definitions:
            law, before = block.expand(law), base.expand(before)
        if law == before:
            continue
        if i not in free:
            return None
        rows.append(free.index(i))
        wanted.append(law - before)
    return rows, array_function(block, wanted)
