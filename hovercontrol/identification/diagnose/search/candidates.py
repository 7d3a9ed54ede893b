"""Trials of the effects that a model may lack: each effect at a few values of its shape parameters."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.units import BASE, dimension
from hovercontrol.craft.effects import Effect, Shape
from hovercontrol.craft.effects.drag import per_second
from hovercontrol.craft.effects.law import Law
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject, structure


@dataclass(frozen=True)
class CandidateCriteria:
    """Settings of the trials of candidates.

    No published source: set by hand, exercised by tests/identification/diagnose/test_candidate_scores.py.

    Attributes
    ----------
    trial : float
        Trial value of a parameter that enters linearly, in its unit; the result does not depend on it.
    believed : tuple
        Smallest and largest amplitude of a shape parameter, relative to the trial's, for which the linear
        response is used.
    """

    trial: float = 1e-2
    believed: tuple[float, float] = (0.1, 1.3)


#: The values in use.
CANDIDATES = CandidateCriteria()


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect at trial values of its shape parameters.

    Attributes
    ----------
    name : str
        Name of the effect.
    trial : Effect
    amplitudes : tuple of str
        The parameters that scale the effect; each has a column. Without any, the whole trial has one column.
    """

    name: str
    trial: Effect
    amplitudes: tuple[str, ...]

    def at(self, parts: Sequence[float]) -> Effect:
        """Return the effect with amplitudes given relative to the trial's, within their bounds.

        An amplitude is the distance from the neutral value: ``value = neutral + part (trial - neutral)``.
        """
        if not self.amplitudes:
            return self.trial
        cls, values = type(self.trial), dict(self.trial.values)
        for key, part in zip(self.amplitudes, parts, strict=True):
            number = cls.numbers[key]
            if isinstance(number, Shape) and number.lower >= number.neutral:  # not linear far away
                part = float(np.clip(part, *CANDIDATES.believed))
            value = number.neutral + part * (values[key] - number.neutral)
            values[key] = value
        return cls.within_bounds(**values)

    def allowed(self, parts: Sequence[float]) -> bool:
        """Return whether these amplitudes are within their bounds: a drag, for instance, does not push."""
        if not self.amplitudes:
            return bool(0.3 < parts[0] < 3.0)
        for key, part in zip(self.amplitudes, parts, strict=True):
            number = type(self.trial).numbers[key]
            value = number.neutral + part * (self.trial.values[key] - number.neutral)
            if not number.lower <= value <= number.upper:
                return False
        return True


def catalogue(model: Subject, names: Sequence[str] | None = None) -> list[type[Effect]]:
    """Return the classes of the effects that a model may lack: those named, or all that it accepts."""
    have = {e.name for e in model.effects}
    shifted = any(e.shifts_time for e in model.effects)  # a second shift in time would be the same effect
    told = have | {e.same_as for e in model.effects}  # as would be one in another place
    found = model.candidates() if names is None else [model.effect_class(name) for name in names]
    new = (cls for cls in found if cls.name not in told and cls.same_as not in have)
    return [cls for cls in new if not (shifted and cls.shifts_time)]


def effects_outside_catalogue(model: Subject, names: Sequence[str] | None = None) -> list[str]:
    """Return the effects outside the catalogue that a model may lack, without those in `names`."""
    have = {*(e.name for e in model.effects), *(names or ())}
    return [cls.name for cls in model.outside() if cls.name not in have]


def candidates(fit: Fit, names: Sequence[str] | None = None) -> list[Candidate]:
    """Return trials of all effects that the model does not contain.

    Parameters
    ----------
    fit : Fit
    names : sequence of str, optional
        Effects to try; default: all that the model accepts.
    """
    scales = _scales(fit)
    found = []
    for cls in catalogue(fit.problem.model, names):
        amplitudes = tuple(k for k, n in cls.numbers.items() if not math.isnan(n.neutral))
        # Usual numbers are those of crafts; the machine may also be as fast or slow as its rows.
        paces = dict.fromkeys((fit.problem.tempo, 1.0))
        every = (dict(v) for pace in paces for v in itertools.product(*_grid(fit, cls, scales, pace)))
        # for a state that hardly moves, all trial values may lie at one bound
        trials = list(dict.fromkeys(cls.within_bounds(**v) for v in every))
        if not _fault(fit.problem.model, trials[0]):
            found += [Candidate(cls.name, trial, amplitudes) for trial in trials]
    return found


def _grid(
    fit: Fit, cls: type[Effect], scales: Mapping[str, float], pace: float
) -> list[list[tuple[str, float]]]:
    """Return the values of each number of an effect that are tried, for times `pace` times the usual ones."""
    grid = []
    for key, number in cls.numbers.items():
        slow = pace ** _seconds(fit, cls, number.unit)
        if isinstance(number, Shape) and number.of == "signal":
            grid.append([(key, v) for v in _levels(fit, cls, number)])
        elif isinstance(number, Shape) and number.search:
            scale = _scale(fit, cls, number.of, scales) if number.of else slow
            grid.append([(key, part * scale) for part in number.search])
        elif isinstance(number, Shape):
            default = slow * (number.default if number.default is not None else 0.01)
            is_width = cls.parameter(key) == cls.friction_width()
            grid.append([(key, _width(fit, cls, default) if is_width else default)])
        else:
            grid.append([(key, number.neutral + CANDIDATES.trial)])
    return grid


def _levels(fit: Fit, cls: type[Effect], number: Shape) -> list[float]:
    """Return quantiles of the signal of a law's curve along the logs; of its size, for a positive number."""
    local = cls.curve() if issubclass(cls, Law) else None
    assert local is not None
    problem = fit.problem
    states, inputs = ([s.name for s in group] for group in (problem.block.states, problem.block.inputs))
    if local.signal in states:
        along = fit.path[..., states.index(local.signal)].ravel()
    elif local.signal in inputs:
        along = np.concatenate([m.inputs[inputs.index(local.signal)] for m in problem.logs])
    else:
        along = np.concatenate([m.time - m.origin for m in problem.logs])
    values = along if number.lower < 0.0 else np.abs(along)
    found = np.unique(np.quantile(values, number.search))
    return [float(v) for v in found if v > number.lower]


def left_out(model: Subject, names: Sequence[str] | None = None) -> list[str]:
    """Return a warning for each user-defined effect that cannot act in a model and so is not tried.

    Parameters
    ----------
    model : Model or BlockModel
    names : sequence of str, optional
        Effects to look for.

    Raises
    ------
    InputError
        If an effect in `names` cannot act in the model.
    """
    said = []
    for cls in catalogue(model, names):
        if cls.in_package():
            continue
        fault = _fault(model, cls.small())
        if fault and names is not None:
            raise InputError(fault)
        if fault:
            said.append(f"not tried: {fault}")
    return said


def _fault(model: Subject, e: Effect) -> str:
    """Return why an effect (a user's own, perhaps for another machine) cannot act in a model; else empty."""
    try:
        structure(model.with_effects([e]))
    except (AttributeError, InputError) as error:
        return str(error) or type(error).__name__
    return ""


def _speed(v: NDArray[np.float64]) -> float:
    """Return (mean v^4 / mean v^2)^(1/2): the speed while a craft moves that mostly stands still.

    It is 0 where nothing moves and where a fit has run away.
    """
    largest = float(np.abs(v).max(initial=0.0))
    if not 0.0 < largest < math.inf:
        return 0.0
    squares = (v / largest) ** 2  # squares of v itself may overflow
    return largest * math.sqrt(float(np.mean(squares**2)) / float(np.mean(squares)))


def _scale(fit: Fit, cls: type[Effect], of: str, scales: Mapping[str, float]) -> float:
    """Return the scale of the trial values of a shape parameter."""
    if of == "input":
        problem = fit.problem
        names = [s.name for s in problem.block.inputs]
        return (
            max(
                (
                    problem.model.input_size(cls, dict(zip(names, m.inputs, strict=True)))
                    for m in problem.logs
                ),
                default=1.0,
            )
            or 1.0
        )
    return scales.get(f"speed_{cls.axis}" if of == "speed" else of, 1.0)


def _seconds(fit: Fit, cls: type[Effect], unit: str) -> int:
    """Return the power of time in a unit: 1 of s, -2 of 1/s^2, -1 of the rate of the state it acts on."""
    axis = {s.name: s.unit for s in fit.problem.block.states}.get(cls.axis, "1")
    if "{" in unit or unit == axis:  # "{thrust}": of an input
        return 0
    if unit == per_second(axis):
        return -1
    powers = list(dimension(unit))
    seconds = powers.pop(BASE.index("s"))
    return 0 if any(powers) else int(seconds)


def _width(fit: Fit, cls: type[Effect], default: float) -> float:
    """Return the fitted width of the model's own friction along the effect's axis, or the default."""
    problem = fit.problem
    for e in problem.model.effects:
        if e.axis and e.axis == cls.axis and e.friction_width():
            own = {**problem.model.coefficients(), **problem.coefficients(fit.p)}
            return own[e.friction_width()]
    return default


def _scales(fit: Fit) -> dict[str, float]:
    problem = fit.problem
    names = [s.name for s in problem.block.states]
    speeds = [_speed(fit.path[..., i]) for i in range(len(names))]
    found = {f"speed_{n}": v or 1.0 for n, v in zip(names, speeds, strict=True)}
    longest = max(float(m.time[-1] - m.origin) for m in problem.logs)
    return {**found, "time": longest, "step": problem.shortest}
