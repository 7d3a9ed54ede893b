"""One extended Kalman filter on raw ranges, which K06 names as future work (section 7.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.coupled import arm_signals, placed
from hovercontrol.control.observers.ins.imu import IMU_PERIOD, valid
from hovercontrol.control.observers.ins.mechanisation import finite
from hovercontrol.control.observers.ins.navigation import Aid, heading_aid, navigation_filter
from hovercontrol.control.observers.ins.noise import InsNoise, noise_from_sensors
from hovercontrol.craft.hardware.sensors.beacons import Beacons
from hovercontrol.craft.hardware.sensors.cone import cone_ratio, cone_signals

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

    Each range is a measurement by itself, even where there are too few for a fix. From the unit's position
    (x, y) the expected range is (5.6), ``sqrt((x - x_i)^2 + (y - y_i)^2 + h^2) + b``. Two units at a distance
    from each other make the heading observable.

    Two beacons are enough: `pose` says on which side of their line the craft is. The craft should stay on
    that side, because at a crossing the ranges do not show whether it turned back. A range bias is observable
    only while the craft moves.

    Parameters
    ----------
    beacons : Beacons
    units : sequence of pairs of float, optional
        Position of each ranging unit on the craft, forward and sideways of the IMU [m].
    cone : tuple of 2 float, optional
        Coefficients of the ranges' cone-angle error (5.7); default: no such error.
    heading : bool, optional
        Whether a heading aid is available too.
    range_noise : float, optional
        Standard deviation of a range [m].
    range_bias : float, optional
        Initial standard deviation of the bias common to all ranges [m]; 0: no bias is estimated.
    noise, pose, velocity, period, name, excitation
        As for :func:`coupled_filter`.

    Returns
    -------
    Block
        Sampled. Inputs as of :func:`coupled_filter`, but in place of the fix ``range_k`` [m] and
        ``range_k_valid`` for each beacon k. With several units also ``range_unit``, the number of the unit
        that measured the ranges, from 1. Outputs as of :func:`coupled_filter`, but in place of the fix's
        innovations ``range_k_innovation`` and its variance, and ``range_bias_hat`` if a bias is estimated.

    Raises
    ------
    InputError
        If units are not pairs of finite numbers, `range_noise` is not positive, `range_bias` is negative, or
        as for :func:`coupled_filter`.

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
    """The measurement equations of raw ranges, for any filter.

    Attributes
    ----------
    aids : tuple of Aid
        One for each beacon, after the heading aid if there is one.
    parameters, bias, inputs : tuple of Signal
        Parameters of the aids; the bias common to all ranges, one or none; inputs in addition to the aids'
        own, one or none.
    definitions : dict of str to sympy.Expr
        Definitions in the aids' expressions.
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
    not_negative(f"{name}: range_bias", range_bias)
    R = Signal("R_range", "m^2", "variance of a range's noise", start=range_noise**2, lower=0.0)
    bias = (Signal("range_bias", "m", "bias of all ranges"),) if range_bias else ()
    coefficients = () if cone is None else cone_signals(cone, name)
    mounts = [arm_signals(f"unit_{k}", arm) for k, arm in enumerate(arms, 1)]
    definitions = {f"arm_{axis}": _chosen([m[i].symbol for m in mounts]) for i, axis in enumerate("xy")}
    at = placed([sp.Symbol(key, real=True) for key in definitions])
    places = beacons.signals()
    aids = [heading_aid(noise)] if heading else []
    # rho_k = |(x, y) + B(psi) arm - (x_k, y_k), h_k| / e(phi) + b with the cone-angle ratio e (5.7), (5.9).
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


#: Maximum number of beacons; the Block has signals for each.
MOST_BEACONS = 1000


@checked
def range_arrivals(count: int, *, period: float = IMU_PERIOD, name: str = "range_arrivals") -> Block:
    """Return a Block that connects ranging units, which hold their ranges, to :func:`range_filter`.

    Ranges are held for a whole slot but must be used once. They are marked valid at the first tick at which
    the unit changes, or at which ranges arrive after a tick without.

    Parameters
    ----------
    count : int
        Number of beacons.
    period : float, optional
        Period of the IMU [s].
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
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
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
    """Return the value that belongs to the unit ``range_unit``."""
    if len(values) == 1:
        return values[0]
    pieces = [(v, RANGE_UNIT.symbol < k + sp.S.Half) for k, v in enumerate(values[:-1], 1)]
    return sp.Piecewise(*pieces, (values[-1], True))


def _cone_angle(away: sp.Matrix, height: sp.Symbol) -> sp.Expr:
    # phi = atan2(distance, h), evaluated slightly off the vertical: phi has no derivative at distance 0.
    return sp.atan2(sp.sqrt(away.dot(away) + sp.Float(1e-12) * height**2), height)
