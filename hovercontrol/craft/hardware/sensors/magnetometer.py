"""A planar magnetometer and its heading [K06 eq 3.43, 3.44]."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import IMU_TICK, offset, pair, size, tick, turned

#: Horizontal part of the earth's field at K06's place [T], about; it points along the earth frame's x here.
K06_FIELD = (2.1e-5, 0.0)

_RAW = (
    Signal("magnetic_x", "T", "magnetic field along the bow", nominal=2e-5),
    Signal("magnetic_y", "T", "magnetic field to the left", nominal=2e-5),
)
_HEADING = Signal("heading_magnetic", "rad", "heading from the magnetometer")


def _known(name: str, field: Sequence[float]) -> tuple[Signal, ...]:
    values = pair(f"{name}: field", field)
    if values == (0.0, 0.0):
        raise InputError(f"{name}: field must not be zero: it has no direction")
    return tuple(
        offset(f"field_{axis}", "T", "known field, earth frame", name, value)
        for axis, value in zip("xy", values, strict=True)
    )


def _heading(measured: Sequence[Signal], known: Sequence[Signal]) -> sp.Expr:
    # (3.43) has acos(<B, b>) and (3.44) the sign of B x b; atan2 is both, without acos' loss of digits.
    bx, by, fx, fy = (s.symbol for s in (*measured, *known))
    return sp.atan2(bx * fy - by * fx, bx * fx + by * fy)


@checked
def magnetic_heading(
    *, field: Sequence[float] = K06_FIELD, period: float = 0.0, name: str = "magnetic_heading"
) -> Block:
    """Return the heading from a measured field (3.43)-(3.44): its angle to the known local field.

    Parameters
    ----------
    field : (float, float), optional
        The known field in earth axes [T].
    period : float, optional
        [s]; 0, the default, for a continuous Block.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``magnetic_x, magnetic_y`` [T], output ``heading_magnetic`` [rad] in -pi to pi. No states.

    Raises
    ------
    InputError
        If the field is zero or the period negative.

    Examples
    --------
    >>> magnetic_heading(field=(1.0, 0.0)).to_numpy().outputs(0.0, (), [0.0, -1.0]).round(4).tolist()
    [1.5708]
    """
    known = _known(name, field)
    e = _heading(_RAW, known)
    return Block(name, (), _RAW, (_HEADING,), known, {}, {_HEADING.name: e}, period=period)


@checked
def magnetometer(
    *,
    period: float = IMU_TICK,
    field: Sequence[float] = K06_FIELD,
    hard_iron: Sequence[float] = (0.0, 0.0),
    soft_iron: Sequence[float] = (0.0, 0.0, 0.0),
    disturbance: Sequence[float] = (0.0, 0.0),
    noise: float = 0.0,
    seed: int = 1,
    name: str = "magnetometer",
) -> Block:
    """Return a magnetometer with its heading; at 0, the default, each error is off.

    Parameters
    ----------
    period : float, optional
        [s]
    field : (float, float), optional
        The earth's field in earth axes [T], which the heading takes as known.
    hard_iron : (float, float), optional
        Field of magnets on the craft, in body axes [T].
    soft_iron : (float, float, float), optional
        Distortion by iron on the craft: ``xx``, ``yy`` and ``xy = yx`` of a matrix S; the reading is (I + S)
        B.
    disturbance : (float, float), optional
        Field of objects around, such as steel beams, in earth axes [T], unknown to the heading.
    noise : float, optional
        Standard deviation of each component [T].
    seed : int, optional
    name : str, optional

    Returns
    -------
    Block
        Input ``psi`` [rad]; outputs ``magnetic_x, magnetic_y`` [T] in the body's axes and
        ``heading_magnetic`` [rad], -pi to pi.

    Raises
    ------
    InputError
        If the period is not positive, the noise negative, the field zero, or a number is missing.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> round(Ticking(magnetometer()).tick(0.0, {"psi": 0.5})["heading_magnetic"], 9)
    0.5
    """
    seconds = tick(name, period).start
    known = _known(name, field)
    iron = [
        offset(f"hard_iron_{axis}", "T", "magnetic field of magnets on the craft", name, value)
        for axis, value in zip("xy", pair(f"{name}: hard_iron", hard_iron), strict=True)
    ]
    if not hasattr(soft_iron, "__len__") or len(soft_iron) != 3:
        raise InputError(f"{name}: soft_iron: expected three numbers (xx, yy, xy), found {soft_iron!r}")
    soft = [
        offset(f"soft_iron_{place}", "1", "distortion of the field by iron on the craft", name, value)
        for place, value in zip(("xx", "yy", "xy"), soft_iron, strict=True)
    ]
    around = [
        offset(f"disturbance_{axis}", "T", "magnetic field of objects around, earth frame", name, value)
        for axis, value in zip("xy", pair(f"{name}: disturbance", disturbance), strict=True)
    ]
    white = size("noise", "T", "standard deviation of each component", name, noise)
    drawn = random_numbers(2, salt=name, seed=seed, prefix="random")
    psi = Signal("psi", "rad", "heading")
    bx, by = turned(-psi.symbol, *(f.symbol + d.symbol for f, d in zip(known, around, strict=True)))
    xx, yy, xy = (s.symbol for s in soft)
    body = ((1 + xx) * bx + xy * by, xy * bx + (1 + yy) * by)
    raw = {
        s.name: b + h.symbol + white.symbol * n
        for s, b, h, n in zip(_RAW, body, iron, drawn.values, strict=True)
    }
    return Block(
        name,
        states=drawn.states,
        inputs=(psi,),
        outputs=(*_RAW, _HEADING),
        parameters=(*known, *iron, *soft, *around, white, *drawn.parameters),
        derivatives=drawn.next_values,
        definitions=drawn.definitions | raw,
        definition_signals=_RAW,
        output_expressions={
            _HEADING.name: _heading(_RAW, known),
        },
        period=seconds,
    )


@checked
def k06_magnetometer(*, period: float = IMU_TICK, seed: int = 1, name: str = "magnetometer") -> Block:
    """Return a magnetometer with the heading noise of K06's filter: R1 = 1.6e-4 rad^2 (5.4.5).

    Parameters
    ----------
    period, seed, name
        As for :func:`magnetometer`.

    Examples
    --------
    >>> k06_magnetometer().default_parameters["magnetometer.noise"]  # tesla
    2.656...e-07
    """
    return magnetometer(period=period, noise=1.6e-4**0.5 * K06_FIELD[0], seed=seed, name=name)
