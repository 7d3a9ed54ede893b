"""The single filter for raw ranges, which K06 wished for (section 7.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.signals import Signal
from hovercontrol.errors import InputError
from hovercontrol.estimators.ins.coupled import arm_signals, placed
from hovercontrol.estimators.ins.imu import IMU_PERIOD, valid
from hovercontrol.estimators.ins.mechanisation import finite
from hovercontrol.estimators.ins.navigation import Aid, heading_aid, navigation_filter
from hovercontrol.estimators.ins.noise import InsNoise, noise_from_sensors
from hovercontrol.hardware.sensors.beacons import Beacons
from hovercontrol.hardware.sensors.cone import cone_ratio, cone_signals
from hovercontrol.io.tables import number, positive

RANGE_UNIT = Signal("range_unit", "1", "which unit's ranges these are, from 1; 0 for none")


@checked
def range_filter(
    beacons: Beacons,
    units: Sequence[Sequence[float]] = ((0.0, 0.0),),
    *,
    cone: tuple[float, float] | None = None,
    heading: bool = False,
    range_noise: float = 0.01,
    range_bias: float = 0.0,
    noise: InsNoise | None = None,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0),
    excitation: float = 0.1,
    period: float = IMU_PERIOD,
    name: str = "ins",
) -> Block:
    """Return the extended Kalman filter on raw ranges.

    Each range counts for itself, also where too few are there for a fix, by (5.6) from the unit's place:
    ``sqrt((x - x_i)^2 + (y - y_i)^2 + h^2) + b``. Two units apart show the heading.

    Two beacons do: `pose` tells on which side of their line the craft is. It should stay there: where it
    crosses, the ranges do not tell whether it turns back. A range bias shows itself only as the craft moves.

    Parameters
    ----------
    beacons : Beacons
    units : sequence of pairs of float, optional
        Where on the craft each ranging unit is, forward and sideways of the IMU [m].
    cone : tuple of 2 float, optional
        Coefficients of the ranges' cone-angle error (5.7); default: they have none.
    heading : bool, optional
        Whether there is a heading aid too.
    range_noise : float, optional
        Standard deviation of a range [m].
    range_bias : float, optional
        Standard deviation at the start of the bias common to all ranges [m]; 0: there is none.
    noise, pose, velocity, period, name, excitation
        As for :func:`coupled_filter`.

    Returns
    -------
    Block
        Sampled. Inputs as of :func:`coupled_filter`, but ``range_k`` [m] and ``range_k_valid`` for each
        beacon and, of several units, ``range_unit``, from 1: whose ranges these are. Outputs as of
        :func:`coupled_filter`, but ``range_k_innovation`` and its variance, and ``range_bias_hat``.

    Raises
    ------
    InputError
        If units are no pairs of finite numbers, a standard deviation is not positive, or as for
        :func:`coupled_filter`.

    Examples
    --------
    >>> block = range_filter(Beacons([(0, 0), (3, 0), (0, 3)], 2.0))
    >>> [s.name for s in block.inputs[3:]]
    ['range_1', 'range_1_valid', 'range_2', 'range_2_valid', 'range_3', 'range_3_valid']
    """
    noise = noise or noise_from_sensors(period=positive(f"{name}: period", period))
    measured = measured_ranges(
        name,
        beacons,
        units,
        cone=cone,
        heading=heading,
        range_noise=range_noise,
        range_bias=range_bias,
        noise=noise,
    )
    return navigation_filter(
        name,
        measured.aids,
        measured.parameters,
        noise=noise,
        pose=pose,
        velocity=velocity,
        period=period,
        excitation=excitation,
        extra=measured.bias,
        extra_variances=[range_bias**2] * len(measured.bias),
        inputs=measured.inputs,
        definitions=measured.definitions,
    )


class RangeAids(NamedTuple):
    """What raw ranges are, for any filter.

    Attributes
    ----------
    aids : tuple of Aid
    parameters, bias, inputs : tuple of Signal
        Of the aids; of all ranges, one or none; beside the aids' own, one or none.
    definitions : dict of str to sympy.Expr
        That the aids' expressions use.
    """

    aids: tuple[Aid, ...]
    parameters: tuple[Signal, ...]
    bias: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    definitions: dict[str, sp.Expr]


def measured_ranges(
    name: str,
    beacons: Beacons,
    units: Sequence[Sequence[float]],
    *,
    cone: tuple[float, float] | None,
    heading: bool,
    range_noise: float,
    range_bias: float,
    noise: InsNoise,
) -> RangeAids:
    """Return the ranges' equations (5.6), (5.7); arguments and errors as for :func:`range_filter`."""
    if not isinstance(beacons, Beacons):
        raise InputError(f"{name}: beacons must be Beacons, found {beacons!r:.60}")
    arms = [finite(f"{name}: units, number {k}", pair, 2) for k, pair in enumerate(units, 1)]
    if not arms:
        raise InputError(f"{name}: units: expected at least one pair of coordinates [m], found none")
    positive(f"{name}: range_noise", range_noise)
    if not 0 <= number(f"{name}: range_bias", range_bias) < math.inf:
        raise InputError(f"{name}: range_bias must not be negative, found {range_bias!r}")
    R = Signal("R_range", "m^2", "variance of a range's noise", start=range_noise**2, lower=0.0)
    bias = (Signal("range_bias", "m", "bias of all ranges"),) if range_bias else ()
    coefficients = () if cone is None else cone_signals(cone, name)
    mounts = [arm_signals(f"unit_{k}", arm) for k, arm in enumerate(arms, 1)]
    definitions = {f"arm_{axis}": _chosen([m[i].symbol for m in mounts]) for i, axis in enumerate("xy")}
    at = placed([sp.Symbol(key, real=True) for key in definitions])
    places = beacons.signals()
    aids = [heading_aid(noise)] if heading else []
    for k, (bx, by, height) in enumerate(places, 1):
        signal = Signal(f"range_{k}", "m", f"range to beacon {k}, measured")
        away = at - sp.Matrix([bx.symbol, by.symbol])
        true = sp.sqrt(away.dot(away) + height.symbol**2)
        if coefficients:
            true /= cone_ratio(_cone_angle(away, height.symbol))
        expected = true + sum(s.symbol for s in bias)
        aids.append(Aid(signal, valid(signal.name), expected, R, shows_heading=len(arms) > 1))
    return RangeAids(
        tuple(aids),
        (*(s for place in places for s in place), *(s for m in mounts for s in m), *coefficients),
        bias,
        (RANGE_UNIT,) if len(arms) > 1 else (),
        definitions,
    )


#: Most beacons: a Block has signals for each.
MOST_BEACONS = 1000


@checked
def range_arrivals(count: int, *, period: float = IMU_PERIOD, name: str = "range_arrivals") -> Block:
    """Return what leads from ranging units that hold their ranges to :func:`range_filter`.

    Ranges that are held for a slot must count once: at the first tick that sees another unit's, or any after
    none.

    Parameters
    ----------
    count : int
        Of beacons.
    period : float, optional
        Of the IMU [s].
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``range_valid``, ``range_unit``, ``range_1_heard``...; outputs ``range_1_valid``...

    Raises
    ------
    InputError
        If there is no beacon, if there are more than 1000, or if the period is not positive.

    Examples
    --------
    >>> from hovercontrol.simulation.hybrid import Ticking
    >>> block = Ticking(range_arrivals(1))
    >>> [block.tick(0.0, {"range_valid": v, "range_unit": u, "range_1_heard": 1})["range_1_valid"]
    ...  for v, u in ((1, 1), (1, 1), (1, 2), (0, 0), (1, 1))]
    [1, 0, 1, 0, 1]
    """
    if not 1 <= count <= MOST_BEACONS:
        raise InputError(f"{name}: count: expected 1 to {MOST_BEACONS} beacons, found {count!r:.40}")
    new = Signal("range_valid", "1", "1 while there are new ranges")
    heard = [Signal(f"range_{k}_heard", "1", "1 where the beacon was heard") for k in range(1, count + 1)]
    last_new, last_unit = (
        s.replace(name=f"last_{s.name}", description=f"{s.description}, at the last tick")
        for s in (new, RANGE_UNIT)
    )
    other = sp.Or(last_new.symbol <= 0, sp.Ne(RANGE_UNIT.symbol, last_unit.symbol))
    once = sp.And(new.symbol > 0, other)
    outputs = [valid(f"range_{k}") for k in range(1, count + 1)]
    return Block(
        name,
        states=(last_new, last_unit),
        inputs=(new, RANGE_UNIT, *heard),
        outputs=tuple(outputs),
        derivatives={last_new.name: new.symbol, last_unit.name: RANGE_UNIT.symbol},
        output_expressions={
            told.name: sp.Piecewise((h.symbol, once), (0, True))
            for told, h in zip(outputs, heard, strict=True)
        },
        period=positive(f"{name}: period", period),
    )


def _chosen(values: Sequence[sp.Symbol]) -> sp.Expr:
    """Return the value of the unit whose ranges these are."""
    if len(values) == 1:
        return values[0]
    pieces = [(v, RANGE_UNIT.symbol < k + sp.S.Half) for k, v in enumerate(values[:-1], 1)]
    return sp.Piecewise(*pieces, (values[-1], True))


def _cone_angle(away: sp.Matrix, height: sp.Symbol) -> sp.Expr:
    # Just off the vertical, where the angle has no derivative.
    return sp.atan2(sp.sqrt(away.dot(away) + sp.Float(1e-12) * height**2), height)
