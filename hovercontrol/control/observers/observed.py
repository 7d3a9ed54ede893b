"""The estimation model of a plant: its measured outputs, its process noise and its measurement noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.base.errors import InputError, check_known, shown
from hovercontrol.base.tables import finite, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, suffixed
from hovercontrol.blocks.units import simplified
from hovercontrol.craft.models.interface import AnyModel


@dataclass(frozen=True)
class Observed:
    """A plant with its measured outputs and noise; made by :func:`observed`.

    Attributes
    ----------
    name : str
        Name of the estimator.
    plant : Block
        The plant; its parameter names are prefixed with the estimator's name.
    measured : tuple of Signal
        The measured outputs, as inputs of the estimator.
    process : dict of int to Signal
        Parameters: root spectral density of the process noise, of a sampled plant its standard deviation per
        step, by the index of the state.
    noise : tuple of Signal
        Parameters: noise of each measurement.
    start_std : tuple of float
        Initial standard deviation of each state's error.
    lost : tuple of Signal or None
        For each measurement the input that is 1 with a sample and 0 without, or None if samples are never
        missing.
    """

    name: str
    plant: Block
    measured: tuple[Signal, ...]
    process: dict[int, Signal]
    noise: tuple[Signal, ...]
    start_std: tuple[float, ...]
    lost: tuple[Signal | None, ...]

    @property
    def fresh(self) -> list[sp.Expr]:
        """1 for each measurement that is never missing, else the symbol of its input ``fresh``."""
        return [s.symbol if s else sp.S.One for s in self.lost]

    @property
    def intensities(self) -> dict[int, sp.Expr]:
        """Q: intensity of each state's noise [unit^2/s; sampled unit^2], by the index of the state."""
        return {i: s.symbol**2 for i, s in self.process.items()}

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Measured outputs, the plant's inputs, then the inputs that mark samples as present."""
        return (*self.measured, *self.plant.inputs, *dict.fromkeys(s for s in self.lost if s))

    @property
    def parameters(self) -> tuple[Signal, ...]:
        """Process noise, measurement noise, then the plant's parameters."""
        return (*self.process.values(), *self.noise, *self.plant.parameters)

    @property
    def estimates(self) -> tuple[Signal, ...]:
        """Outputs ``NAME_hat`` of each state."""
        return tuple(
            s.replace(
                name=suffixed(s.name, "hat"), description=f"estimate of {s.name}", lower=-sp.oo, upper=sp.oo
            )
            for s in self.plant.states
        )

    @property
    def deviations(self) -> tuple[Signal, ...]:
        """Outputs ``NAME_std`` of each state."""
        return tuple(
            Signal(suffixed(s.name, "std"), s.unit, f"standard deviation of the error of {s.name}")
            for s in self.plant.states
        )

    def output_values(self, x: Sequence[sp.Expr], P: sp.Matrix) -> dict[str, sp.Expr]:
        """Return the output expressions, given the estimates and their covariance."""
        hats = {s.name: e for s, e in zip(self.estimates, x, strict=True)}
        return hats | {s.name: sp.sqrt(sp.Max(P[i, i], 0)) for i, s in enumerate(self.deviations)}


def unit_over(plant: Block, state: str, time: str) -> str:
    """Return the unit of a state over that of a time; of a sampled plant, per step, the state's."""
    unit = plant.signal(state).unit
    return unit if plant.period else simplified(f"({unit})/{time}")


def plant_of(plant: AnyModel, name: str, what: str) -> Block:
    """Return the plant of a model or a Block itself.

    Raises
    ------
    InputError
        If it is hybrid, its inputs are delayed, or it has no states.
    """
    block = plant if isinstance(plant, Block) else plant.plant()
    block.need_no_ticks(what)
    block.need_prompt_inputs(f"the {what}")
    if not block.states:
        raise InputError(f"{name}: block {block.name!r} has no states to estimate")
    return block


def observed(
    plant: Block,
    measured: Sequence[str] | None,
    process_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    start_std: Mapping[str, float] | None,
    name: str,
    *,
    continuous: bool,
    lost_samples: bool | Sequence[str] = False,
) -> Observed:
    """Return the estimation model of a plant.

    Parameters
    ----------
    measured : sequence of str or None
        Outputs, or states, of the plant; None for the keys of `measurement_noise`.
    process_noise, measurement_noise, start_std
        As for :func:`~hovercontrol.control.observers.extended.extended_kalman`.
    name : str
        Name of the estimator.
    continuous : bool
        Whether measurements are continuous; their noise is then given as a root spectral density.
    lost_samples : bool or sequence of str, optional
        Whether samples may be missing, of all measurements together or of those named.

    Raises
    ------
    InputError
        If a name is unknown or missing, or a number is out of range.
    """
    own = owned(plant, name)
    if measured is None:
        channels = measured_signals(plant, list(measurement_noise), name, "measurement_noise")
    else:
        channels = measured_signals(plant, measured, name)
    names = [s.name for s in plant.states]
    process = _numbers(f"{name}: process_noise", process_noise, names)
    noise = _numbers(f"{name}: measurement_noise", measurement_noise, [s.name for s in channels])
    start = _numbers(f"{name}: start_std", start_std or {}, names)
    for s in channels:
        if not noise.get(s.name):
            found = f"found {noise[s.name]:g}" if s.name in noise else "found none"
            raise InputError(f"{name}: measurement_noise: expected a positive number for {s.name!r}, {found}")
    root = "*s^(1/2)" if continuous else ""
    size = "standard deviation per step" if plant.period else "root spectral density"
    return Observed(
        name,
        own,
        channels,
        {
            names.index(state): Signal(
                f"{name}.process_noise_{state}",
                unit_over(plant, state, "s^(1/2)"),
                f"{size} of the noise in {plant.update_text(state)}",
                start=value,
                lower=0.0,
            )
            for state, value in sorted(process.items(), key=lambda item: names.index(item[0]))
        },
        tuple(
            Signal(
                f"{name}.measurement_noise_{s.name}",
                simplified(f"({s.unit}){root}"),
                f"{'root spectral density' if continuous else 'standard deviation'} of the noise of {s.name}",
                start=noise[s.name],
                lower=0.0,
            )
            for s in channels
        ),
        tuple(start.get(s.name, s.nominal) for s in plant.states),
        _lost(channels, lost_samples, name),
    )


def _lost(channels: Sequence[Signal], lost: bool | Sequence[str], name: str) -> tuple[Signal | None, ...]:
    """Return for each measurement the input that says whether a sample is present, or None."""
    if isinstance(lost, bool):
        fresh = Signal("fresh", "1", "1 with samples, 0 without", start=1.0, lower=0.0, upper=1.0)
        return (fresh if lost else None,) * len(channels)
    known = [s.name for s in channels]
    for key in lost:
        check_known(key, known, f"{name}: lost_samples: expected measured outputs, found {shown(key)}")
    return tuple(
        Signal(f"fresh_{key}", "1", f"1 with a sample of {key}, 0 without", start=1.0, lower=0.0, upper=1.0)
        if key in lost
        else None
        for key in known
    )


def tick_of(plant: Block, period: float | None, where: str) -> float:
    """Return the given period of an estimator [s], by default that of a sampled plant.

    Raises
    ------
    InputError
        If it is not positive, or the plant has none.
    """
    if period is None and not plant.period:
        raise InputError(f"{where}: expected the time between samples in seconds, found none")
    return positive(where, plant.period if period is None else period)


def owned(plant: Block, name: str) -> Block:
    """Return a plant whose parameter names, including those of its parts, start with the estimator's name."""
    before = f"{plant.name}."
    parts = {p.name: f"{name}.{p.name}" for p in plant.parameters if "." in p.name}
    parts |= {
        p.name: f"{name}.{p.name.removeprefix(before)}"
        for p in plant.parameters
        if p.name.startswith(before) or "." not in p.name
    }
    return plant.with_parameter_names(parts).named(name)


def measured_signals(
    plant: Block, measured: Sequence[str], name: str, argument: str = "measured"
) -> tuple[Signal, ...]:
    """Return the measured outputs; a state that is not an output may be measured, too.

    Parameters
    ----------
    measured : sequence of str
    name, argument : str
        The function and its argument that names them, for error messages.

    Raises
    ------
    InputError
        If there are none, or one is named twice or unknown (the message suggests the nearest name).
    """
    if isinstance(measured, str) or not len(measured) or len(set(measured)) < len(measured):
        raise InputError(f"{name}: {argument}: expected different names of outputs, found {shown(measured)}")
    known = {s.name: s for s in (*plant.states, *plant.outputs)}
    for one in measured:
        check_known(one, known, f"{name}: {argument}: block {plant.name!r} has no output {shown(one)}")
    return tuple(
        Signal(one, known[one].unit, f"measured {one}", nominal=known[one].nominal) for one in measured
    )


def measured_expressions(plant: Block, measured: Sequence[Signal]) -> Block:
    """Return the plant with the measured signals as its outputs, in the given order."""
    known = {s.name: s.symbol for s in plant.states} | dict(plant.output_expressions)
    return plant.unchecked(
        outputs=tuple(measured),
        output_expressions=Expressions((s.name, known[s.name]) for s in measured),
    )


def _numbers(where: str, given: Mapping[str, float], known: Sequence[str]) -> dict[str, float]:
    """Return the numbers by name; raise InputError for an unknown name or a negative number."""
    for key, value in given.items():
        check_known(key, known, f"{where}: unknown name {shown(key)}")
        if finite(f"{where}: {key}", value) < 0:
            raise InputError(f"{where}: {key} must not be negative, found {value:g}")
    return {key: float(value) for key, value in given.items()}
