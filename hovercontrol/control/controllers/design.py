"""The linear model of a controller design: chosen states and inputs of a plant about an operating point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.arrays import Array, Mask
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.backends.friction_slopes import Point, Slope
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.linear_systems import over_period
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers import operating_point
from hovercontrol.control.controllers.friction_feedforward import Friction, frictions_at_rest
from hovercontrol.control.controllers.reduction import closure, eliminated
from hovercontrol.control.controllers.state_names import StateNames, is_angle

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.backends.trim import Trim


#: Largest rate of a state that counts as zero [its unit/s, or per step]: trims are solved to about 1e-9.
STEADY = 1e-5


@dataclass(frozen=True)
class Measured:
    """One quantity that a controller reads.

    Parameters
    ----------
    signal : Signal
        With the name used for wiring; its start is the value at the operating point.
    angle : bool
        Whether a change by 2 pi is the same state.
    estimated : bool
        Whether an estimator of the plant's states has it; an output that is no state is read itself.
    state : str
        The plant's own name of the state, by which an estimator gives it (default: that of the signal).
    """

    signal: Signal
    angle: bool
    estimated: bool = True
    state: str = ""


@dataclass(frozen=True)
class Design:
    """The linear model for which a controller is designed.

    Parameters
    ----------
    states : tuple of Measured
        States that are fed back.
    inputs : tuple of Signal
        Inputs that are commanded; their start is the value at the operating point.
    A, B : ndarray, shapes (n_states, n_states) and (n_states, n_inputs)
        ``(x - x0)' = A (x - x0) + B (u - u0)``; of a sampled model the next value of ``x - x0``.
    integrals : tuple of Measured
        Quantities whose error is integrated.
    C : ndarray, shape (n_integrals, n_states)
        Each as a combination of the states.
    frictions : tuple of Friction
        Dry friction of states at rest, by index among `states`.
    E : ndarray, shape (n_states, n_frictions)
        How each friction acts on the states.
    period : float
        0 of a continuous model; of a sampled one, whose A, B and E give the next state, the time of a
        step [s].
    """

    states: tuple[Measured, ...]
    inputs: tuple[Signal, ...]
    A: Array
    B: Array
    integrals: tuple[Measured, ...]
    C: Array
    frictions: tuple[Friction, ...]
    E: Array
    period: float

    @property
    def names(self) -> list[str]:
        """The names of the states."""
        return [m.signal.name for m in self.states]

    @property
    def integral_names(self) -> list[str]:
        """The names of the integrals: ``integral_y``."""
        return [f"integral_{m.signal.name}" for m in self.integrals]

    @property
    def input_names(self) -> list[str]:
        """The names of the inputs."""
        return [s.name for s in self.inputs]

    def over(self, where: str, period: float | None) -> Design:
        """Return the model over a period [s], exact for inputs that hold; None: as it is.

        Raises
        ------
        InputError
            If the period is not positive, or no multiple of the step of a sampled model.
        """
        if period is None:
            return self
        acting = np.hstack([self.B, self.E])
        A, acting = over_period(f"{where}: period", self.A, acting, self.period, period)
        m = len(self.inputs)
        return replace(self, A=A, B=acting[:, :m], E=acting[:, m:], period=period)

    def with_integrals(self) -> tuple[Array, Array]:
        """Return A and B of the states followed by the integrals, ``z' = C (x - x0)``.

        Of a model with the step h, ``z+ = z + h C (x - x0)``.
        """
        n, p, m = len(self.states), len(self.integrals), len(self.inputs)
        C, own = (self.period * self.C, np.eye(p)) if self.period else (self.C, np.zeros((p, p)))
        return np.block([[self.A, np.zeros((n, p))], [C, own]]), np.vstack([self.B, np.zeros((p, m))])

    def disturbances(self) -> Array:
        """Return how each friction at rest acts on the states and integrals, shape (n, n_frictions)."""
        return np.vstack([self.E, np.zeros((len(self.integrals), self.E.shape[1]))])


def design_of(
    where: str,
    plant: Block,
    trim: Trim | control.OperatingPoint | Mapping[str, float],
    *,
    friction: Slope,
    amplitude: Mapping[str, float] | None = None,
    states: Sequence[str] | None = None,
    inputs: Iterable[str] | None = None,
    weighted: Iterable[str] | None = None,
    integrate: Sequence[str] = (),
    compensate: bool = False,
    estimated: bool = False,
) -> Design:
    """Return the linear model of chosen states and inputs.

    Parameters
    ----------
    where : str
        Name of the design function, for error messages.
    plant : Block
        Continuous or sampled.
    friction, amplitude
        As for :meth:`hovercontrol.Block.linearize`.
    states : sequence of str, optional
        Which states are fed back. Default: those of `weighted` and all on which these depend; without
        `weighted` all that do not move at the operating point. Of these only states that equal an output;
        other states, such as lags of actuators, are taken as infinitely fast.
    inputs : iterable of str, optional
        Which inputs are commanded (default: all).
    weighted : iterable of str, optional
        States with a weight.
    integrate : sequence of str, optional
        States or outputs whose error is integrated.
    compensate : bool, optional
        Whether dry friction of states at rest is part of the design.
    estimated : bool, optional
        Whether an estimator shows every state.

    Raises
    ------
    InputError
        If a name is unknown, or a state that is fed back moves at the operating point.
    """
    point = operating_point.point_of(plant, trim)
    A, B, C, D = operating_point.linear_model(plant, point, friction, amplitude)
    names = StateNames(where, plant)
    rates = operating_point.rates(plant, point)
    moving = np.abs(rates) * max(plant.period, 1.0) > STEADY  # per second, or per step if that is longer
    columns = _columns(where, plant, inputs)
    rows, integrals = _integrals(where, plant, names, point, integrate, C, D[:, columns])
    hidden = set() if estimated else set(range(len(A))) - names.shown()
    if states is not None:
        kept = [names.index(s) for s in states]
    elif weighted is None:
        kept = [k for k in range(len(A)) if not moving[k] and k not in hidden]
    else:
        needed = {k for row in rows for k in np.flatnonzero(row).tolist()}
        named = {names.index(s) for s in weighted} | needed
        kept = [k for k in closure(A, named) if k in named or k not in hidden]
    chosen = tuple(_measured(plant, names, k, point.x[k]) for k in kept)
    commanded = tuple(
        plant.inputs[j].replace(start=_inside(where, plant.inputs[j], point.u[j])) for j in columns
    )
    _check_feedback(where, plant, kept, hidden, moving, rates)
    sampled, every = plant.period > 0.0, [s.name for s in plant.states]
    A, B = eliminated(where, A, B[:, columns], kept, hidden, every, sampled=sampled)
    C_kept = np.array([row[kept] for row in rows]).reshape(len(rows), len(kept))
    frictions = tuple(
        replace(f, state=kept.index(f.state)) for f in frictions_at_rest(plant, point, kept) if compensate
    )
    E = np.zeros((len(kept), len(frictions)))
    for column, at_rest in enumerate(frictions):
        E[at_rest.state, column] = at_rest.level
    return Design(chosen, commanded, A, B, integrals, C_kept, frictions, E, plant.period)


def _check_feedback(
    where: str, plant: Block, kept: Sequence[int], hidden: set[int], moving: Mask, rates: Array
) -> None:
    """Raise if a state fed back is shown by no output, or has no constant setpoint."""
    if not kept:
        raise InputError(f"{where}: expected one or more states to feed back, found none")
    for k in kept:
        if k in hidden:
            raise InputError(
                f"{where}: no output of block {plant.name!r} shows the state {plant.states[k].name!r}; leave "
                "it out or estimate it (measured='{}_hat')"
            )
    for k in kept:
        if moving[k]:
            s = plant.states[k]
            raise InputError(
                f"{where}: {s.name} moves by {rates[k]:.3g} {s.unit} per second at the operating"
                " point and has no constant setpoint; leave it out of the states and weights"
            )


def _columns(where: str, plant: Block, inputs: Iterable[str] | None) -> list[int]:
    names = [s.name for s in plant.inputs]
    wanted = names if inputs is None else list(inputs)
    for name in wanted:
        check_known(name, names, f"{where}: block {plant.name!r} has no input {name!r}")
    if not wanted:
        raise InputError(f"{where}: expected one or more inputs to command, found none")
    return [k for k, name in enumerate(names) if name in wanted]


def _integrals(
    where: str, plant: Block, names: StateNames, point: Point, integrate: Sequence[str], C: Array, D: Array
) -> tuple[list[Array], tuple[Measured, ...]]:
    """Return each integrated quantity as a row over all states, and its signal."""
    rows, found = [], []
    outputs = [s.name for s in plant.outputs]
    for name in integrate:
        k = names.find(name)
        if k is not None:
            rows.append(np.eye(len(plant.states))[k])
            found.append(_measured(plant, names, k, point.x[k]))
            continue
        if name not in outputs:
            hint = did_you_mean(name, [*(s.name for s in plant.states), *outputs])
            raise InputError(f"{where}: block {plant.name!r} has no state or output {name!r}{hint}")
        j = outputs.index(name)
        if np.abs(D[j]).max() > 0.0:
            raise InputError(
                f"{where}: the output {name!r} depends on an input directly and cannot be integrated"
            )
        rows.append(C[j])
        level = operating_point.outputs(plant, point)[j]
        found.append(Measured(plant.outputs[j].replace(start=level), angle=False, estimated=False))
    return rows, tuple(found)


def _measured(plant: Block, names: StateNames, k: int, start: float) -> Measured:
    state = plant.states[k]
    return Measured(names.signal(k).replace(start=start), is_angle(plant, state), state=state.name)


def _inside(where: str, signal: Signal, value: float) -> float:
    """Return an input's value at the operating point; one a rounding outside its bounds is at the bound."""
    nearest = min(max(value, signal.lower), signal.upper)
    if abs(nearest - value) <= 1e-9 * (1.0 + abs(value)):
        return nearest
    try:
        return signal.check(value)
    except InputError as error:
        raise InputError(f"{where}: the operating point is out of reach: {error}") from None


def by_name(given: object) -> list[str] | None:
    """Return the names of weights that are given by name, None of others."""
    return list(given) if isinstance(given, Mapping) else None
