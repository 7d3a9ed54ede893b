"""A monitor: a filter with a bank of change tests that raises an alarm and names the change.

Interface of the Block. Inputs: the measured channels and the commands under their names, ``fresh`` or
``fresh_NAME`` where samples may be lost, and ``reset``. Outputs:

- ``alarm``: 1 from an alarm on until a reset, and while a sensor is dead;
- ``effect``: 0 none, 1 ... J the candidate, J + 1 ... J + m a dead sensor, then an unknown change
  (:func:`named_effects` returns their names);
- ``evidence``: the largest g (twice the log-likelihood ratio); the alarm comes above the parameter
  ``threshold``;
- ``change``, ``change_std``: present change of the named candidate's coefficient, or unknown acceleration,
  and its standard deviation, in its SI unit; ``rate``, ``rate_std``: the same of its rate per second;
- ``second``: 0, or the number of a candidate that has changed at once; ``second_change``,
  ``second_change_std``;
- ``ended``: 1 if the named change has ended; ``held`` [s]: time for which its size has held;
- ``since`` [s]: time since the estimated onset;
- ``evidence_NAME`` for each candidate, and ``possible_NAME``: 1 if an alarm may be due to it, that is if it
  cannot be told apart from the best yet;
- ``dead_NAME`` for each measured channel;
- ``unknown_NAME`` and ``possible_unknown_NAME`` for an acceleration in each equation with process noise, and
  for an offset of each sensor without a candidate ``NAME_bias``: 1 if no candidate explains the change, but
  this one most of it; and 1 if an alarm may be due to a change of this kind that is in no candidate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.control.observers.observed import owned, plant_of
from hovercontrol.control.observers.propagation import steps_between
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.monitor.candidates import Candidate, candidates_of, unknowns_of
from hovercontrol.identification.monitor.design import Design, estimation_model
from hovercontrol.identification.monitor.dispersion import dispersion_of, divided
from hovercontrol.identification.monitor.equations import monitor_block
from hovercontrol.identification.monitor.feed import candidates_in
from hovercontrol.identification.monitor.motion import motion_of
from hovercontrol.identification.monitor.pace import paced
from hovercontrol.identification.monitor.signatures import along_motion
from hovercontrol.identification.monitor.threshold import floors, threshold_for
from hovercontrol.logs.log import Log

#: Time without a sample after which a sensor is dead, and time until the tests begin [s] (:mod:`.pace`).
DEAD_AFTER, SETTLE = 1.0, 2.0

#: Time within which a few outliers are left out [s]; of a slow machine as many ticks as of one of 0.1 s.
OUTLIERS_WITHIN = 1.0

#: Length of the shortest window [s]; the windows' lengths grow by factors of 2.
SHORTEST = 0.25

#: Number of windows: the longest is 63 times as long as the shortest.
WINDOWS = 6


@checked
def monitor(
    model: AnyModel,
    candidates: Sequence[str | Effect] | None = None,
    *,
    false_alarms_per_hour: float,
    period: float,
    process_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    measured: Sequence[str] | None = None,
    gusts: Mapping[str, float] | None = None,
    gust_seconds: float = 1.0,
    coefficient_std: Mapping[str, float] | None = None,
    start_std: Mapping[str, float] | None = None,
    lost_samples: bool | Sequence[str] = False,
    dead_after: float | None = None,
    settle: float | None = None,
    repeats: bool | Sequence[str] = False,
    motion: Log | None = None,
    dispersion: bool = False,
    substeps: int | None = None,
    name: str = "monitor",
) -> Block:
    """Return a monitor of a craft: a sampled Block that says what has changed, by how much and since when.

    Parameters
    ----------
    model : Model, BlockModel or Block
        Continuous, or sampled with the monitor's period.
    candidates : sequence of str or Effect, optional
        Changes to look for: names of effects that the model lacks, of the model's own coefficients, or
        ``NAME_bias`` for a bias of a measured channel. An Effect gives the trial values of its shape
        parameters. Default: the parameters of a Block, linear or not, or the linear coefficients of a craft,
        and a bias of each measured channel.
    false_alarms_per_hour : float
        Wanted rate; 0.1 is one false alarm in 10 h.
    period : float
        Sampling period [s].
    process_noise : mapping of str to float
        Root spectral density of white noise in the derivatives of states, by their names
        [unit of the state / s^(1/2)]; of a sampled model standard deviation of what each step adds [unit of
        the state].
    measurement_noise : mapping of str to float
        Standard deviation of a sample, for each measured channel [its unit].
    measured : sequence of str, optional
        Outputs, or states, of the model (default: the keys of `measurement_noise`, in their order).
    gusts : mapping of str to float, optional
        Standard deviation of random accelerations of a correlation time, by the states in whose derivatives
        they act [unit of the state / s], or to whose next values they are added in a sampled model [unit of
        the state]. They raise no alarm.
    gust_seconds : float, optional
        Their correlation time [s].
    coefficient_std : mapping of str to float, optional
        Standard deviation of coefficients that are not exactly known [their unit]. The filter estimates them;
        an error of that size raises no alarm.
    start_std : mapping of str to float, optional
        Standard deviation of the error of the first estimate, by states [their unit] (default: nominal size).
    lost_samples : bool or sequence of str, optional
        As for :func:`~hovercontrol.control.observers.extended.extended_kalman`: inputs that say whether there
        is a sample.
    dead_after : float, optional
        Time without a new sample after which a sensor is dead [s] (default: 1 s; of a machine that is not a
        craft, at least 10 and at most 200 periods).
    settle : float, optional
        Time after the start and after a reset until the tests begin [s]: far from the true state, the
        filter's linearisation does not hold (default: 2 s, or 20 to 400 periods).
    repeats : bool or sequence of str, optional
        Whether a value equal to the one before is a new sample (a sensor of coarse resolution), or the
        channels of which it is; by default it is not.
    motion : Log, optional
        A typical run with the measured channels and the commands, along which the threshold is computed
        (default: 60 s of the model under random steps of its commands).
    dispersion : bool, optional
        Whether `motion` is a measured log in which nothing changes. Each candidate's evidence is then divided
        by the dispersion of its scores along it, if that exceeds 1: noise that is not white, or larger than
        stated, and errors of the model raise no more alarms than wanted.
    substeps : int, optional
        Runge-Kutta steps per period (default: from the model's fastest mode).
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs, outputs and parameters: :mod:`hovercontrol.identification.monitor.monitor`.

    Raises
    ------
    InputError
        If a name is unknown, a candidate never shows in the measured channels, or a number is out of range.

    Source: generalised likelihood ratio tests of a Kalman filter's innovations, Willsky and Jones, IEEE TAC
    21, 1976.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, F, m = hc.Signal("v", "m/s"), hc.Signal("F", "N"), hc.Signal("m", "kg", start=2.0)
    >>> cart = hc.Block("cart", [v], [F], [v], [m], {"v": F.symbol / m.symbol})
    >>> watch = hc.monitor(
    ...     cart, ["v_bias"], false_alarms_per_hour=1.0, period=0.1, measured=["v"],
    ...     process_noise={"v": 0.1}, measurement_noise={"v": 0.05},
    ... )
    >>> [s.name for s in watch.outputs][:5]
    ['alarm', 'effect', 'evidence', 'change', 'change_std']
    """
    tick, wanted = (
        positive(f"{name}: period", period),
        positive(f"{name}: false_alarms_per_hour", false_alarms_per_hour),
    )
    craft = as_model(model)
    dead_after, settle, shortest = (
        paced(stated, tick, is_craft=craft.is_craft) if given is None else given
        for given, stated in ((dead_after, DEAD_AFTER), (settle, SETTLE), (None, SHORTEST))
    )
    for what, number in (("gust_seconds", gust_seconds), ("dead_after", dead_after), ("settle", settle)):
        positive(f"{name}: {what}", number)
    if dispersion and motion is None:
        raise InputError(f"{name}: dispersion=True needs a measured log as motion")
    plant = plant_of(craft, name, "monitor")
    measured = list(measurement_noise) if measured is None else measured
    known = estimation_model(
        plant, measured, process_noise, measurement_noise, gusts or {}, gust_seconds, coefficient_std or {},
        start_std or {}, name, lost_samples,
    )  # fmt: skip
    if plant.period and tick != plant.period:
        raise InputError(f"{name}: period: expected that of the model, {plant.period:g} s, found {tick:g} s")
    steps = steps_between(plant, tick, name, substeps)
    path = motion_of(plant, measured, tick, motion, name, is_craft=craft.is_craft)
    found = candidates_of(craft, candidates, measured, path.sizes, name, tick)
    design = Design(
        known,
        tuple(found),
        tick,
        dead_after,
        tuple(measured if repeats is True else repeats or ()),
        WINDOWS,
        max(1, round(shortest / tick)),
        steps,
        settle,
        max(OUTLIERS_WITHIN, paced(OUTLIERS_WITHIN, tick, is_craft=craft.is_craft)),
        tuple(unknowns_of(plant, list(process_noise), measured, found)),
    )
    design, shown, innovations = along_motion(design, path)
    phi = dispersion_of(shown, innovations) if dispersion else np.ones(len(design.every))
    shown = divided(shown, phi)
    floor, J = floors(shown), len(found)
    shown = replace(shown, eta=shown.eta[:, :, :J], information=shown.information[:, :, :J])
    lower, upper = bounds_of(plant, found, name)
    rate, rest = wanted * tick / 3600.0, round(settle / tick)
    threshold = threshold_for(shown, floor[:J], lower, upper, rate, rest=rest)
    return monitor_block(design, threshold, list(floor), list(phi) if dispersion else ())


def bounds_of(plant: Block, found: Sequence[Candidate], name: str) -> tuple[Array, Array]:
    """Return the bounds of each candidate's theta, at the start values of the coefficients."""
    own = (*owned(plant, name).parameters, *(p for c in found for p in c.parameters))
    start = {p.symbol: p.start for p in own}
    lower, upper = (
        np.array([float(e.subs(start)) for e in some])
        for some in ([c.lower for c in found], [c.upper for c in found])
    )
    return np.minimum(lower, 0.0), np.maximum(upper, 0.0)


def named_effects(block: Block) -> list[str]:
    """Return what the numbers 1, 2, ... of a monitor's output ``effect`` stand for."""
    names = [s.name for s in block.outputs]
    return [
        *candidates_in(block),
        *(n.removeprefix("dead_") for n in names if n.startswith("dead_")),
        *(n for n in names if n.startswith("unknown_")),
    ]
