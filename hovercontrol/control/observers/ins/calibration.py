"""Calibration at rest: the platform's misalignment, the gyro's bias, and a restart of the navigation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy as sp

from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.imu import IMU, IMU_PERIOD

#: A rise begins a calibration, K06's "Calibrate" (K06 figure 5.2).
CALIBRATE = Signal("calibrate", "1", "a rise begins a calibration at rest")
#: 1 at the tick at which a calibration has ended.
CALIBRATED = Signal("calibrated", "1", "1 at the tick at which a calibration has ended")
_GRAVITY = Signal("gravity", "m/s^2", "standard gravity", start=9.80665, nominal=10.0)


def rest_calibration(
    *, seconds: float = 2.0, period: float = IMU_PERIOD, name: str = "rest_calibration"
) -> Block:
    """Return a Block that measures the IMU's offsets at rest and subtracts them from then on.

    It averages the samples over some seconds. The accelerometers' means are stored as roll and pitch of the
    platform, K06's "Store Misalignment". The gyro's mean is stored as its bias, which K06's IMU has
    "resampled" at rest, "a process that takes several seconds" (section 5.4.1). Accelerometer biases cannot
    be distinguished from a tilt. The craft must not move during a calibration.

    Parameters
    ----------
    seconds : float, optional
        Averaging time [s].
    period : float, optional
        Period of the IMU [s].

    Returns
    -------
    Block
        Sampled. Inputs ``acceleration_x_raw``, ``acceleration_y_raw`` [m/s^2], ``yaw_rate_raw`` [rad/s] and
        ``calibrate``; outputs the same three without ``_raw`` and less the stored offsets, ``platform_roll,
        platform_pitch`` [rad], ``gyro_offset`` [rad/s], ``calibrating`` (1 while it averages) and
        ``calibrated``, 1 at the tick at which a calibration ends.

    Raises
    ------
    InputError
        If a time is not positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> run = Ticking(rest_calibration(seconds=0.02, period=0.01))
    >>> still = {"acceleration_x_raw": 0.0981, "acceleration_y_raw": 0.0, "yaw_rate_raw": 0.2}
    >>> seen = [run.tick(0.01 * k, {**still, "calibrate": float(k > 0)}) for k in range(3)]
    >>> [round(row["yaw_rate"], 9) for row in seen], round(seen[-1]["platform_pitch"], 4)
    ([0.2, 0.2, 0.0], 0.01)
    """
    ticks = max(1, round(positive(f"{name}: seconds", seconds) / positive(f"{name}: period", period)))
    raw = tuple(s.replace(name=f"{s.name}_raw") for s in IMU)
    stored = (
        Signal("platform_roll", "rad", "misalignment of the platform, right side down"),
        Signal("platform_pitch", "rad", "misalignment of the platform, bow up"),
        Signal("gyro_offset", "rad/s", "bias of the gyro, stored"),
    )
    last = Signal("last_calibrate", "1", "the order at the last tick", start=0.0)
    left = Signal("ticks_left", "1", "ticks still to be averaged")
    sums = tuple(s.replace(name=f"{s.name}_sum", description=f"{s.description}, sum") for s in raw)
    kept = tuple(s.replace(name=f"last_{s.name}") for s in stored)
    working = Signal("calibrating", "1", "1 while a calibration averages")
    begins = sp.And(CALIBRATE.symbol > last.symbol, left.symbol <= 0)
    due = sp.Piecewise((ticks, begins), (left.symbol, True))
    on, ends = working.symbol > 0, CALIBRATED.symbol > 0
    totals = [
        s.replace(name=f"{s.name}_total", description=f"{s.description}, sum with this tick") for s in raw
    ]
    # At rest f_x = g sin theta, f_y = g sin phi cos theta, r = b_g, so the means give
    # theta = asin(f_x / g),  phi = asin(f_y / (g cos theta)).
    g = _GRAVITY.symbol
    means = [t.symbol / ticks for t in totals]
    pitch = sp.asin(sp.Max(-1, sp.Min(1, means[0] / g)))
    roll = sp.asin(sp.Max(-1, sp.Min(1, means[1] / (g * sp.cos(pitch)))))
    definitions: dict[str, sp.Expr] = {
        "ticks_due": due,
        working.name: sp.Piecewise((1, sp.Symbol("ticks_due", real=True) > 0), (0, True)),
        CALIBRATED.name: sp.Piecewise((1, sp.Eq(sp.Symbol("ticks_due", real=True), 1)), (0, True)),
    }
    for total, before, s in zip(totals, sums, raw, strict=True):
        begun = sp.Piecewise((0, begins), (before.symbol, True))
        definitions[total.name] = sp.Piecewise((begun + s.symbol, on), (0, True))
    for now, before, found in zip(stored, kept, (roll, pitch, means[2]), strict=True):
        definitions[now.name] = sp.Piecewise((found, ends), (before.symbol, True))
    phi, theta, rate = (s.symbol for s in stored)
    off = (g * sp.sin(theta), g * sp.sin(phi) * sp.cos(theta), rate)
    return Block(
        name,
        states=(last, left, *sums, *kept),
        inputs=(*raw, CALIBRATE),
        outputs=(*IMU, *stored, working, CALIBRATED),
        parameters=(_GRAVITY,),
        derivatives={
            last.name: CALIBRATE.symbol,
            left.name: sp.Max(sp.Symbol("ticks_due", real=True) - 1, 0),
            **{before.name: t.symbol for before, t in zip(sums, totals, strict=True)},
            **{before.name: now.symbol for before, now in zip(kept, stored, strict=True)},
        },
        output_expressions={s.name: r.symbol - o for s, r, o in zip(IMU, raw, off, strict=True)},
        definitions=definitions,
        definition_signals=(*stored, working, CALIBRATED),
        period=period,
    )


def restartable(block: Block, restart: Signal, kept: Mapping[str, sp.Expr] | None = None) -> Block:
    """Return a sampled Block that restarts from its start values at a tick where an input is positive.

    Parameters
    ----------
    block : Block
        Sampled.
    restart : Signal
        The input that triggers a restart.
    kept : mapping of str to sympy.Expr, optional
        Restart values of some states, as expressions in the states before the restart. The other states
        restart from their start values.

    Returns
    -------
    Block
        The Block with the additional input `restart`. Start values other than zero become parameters,
        ``first_<state>``.

    Raises
    ------
    InputError
        If the Block is not sampled, or has no such state (the nearest is named).

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> n = Signal("n", start=5.0)
    >>> counter = Block("counter", [n], [], [n], derivatives={"n": n.symbol + 1}, period=0.1)
    >>> run = Ticking(restartable(counter, CALIBRATED))
    >>> [run.tick(0.1 * k, {"calibrated": float(k == 2)})["n"] for k in range(4)]
    [5.0, 6.0, 5.0, 6.0]
    """
    if not block.period:
        raise InputError(f"restartable: block {block.name!r} is not sampled")
    begin = dict(kept or {})
    names = [s.name for s in block.states]
    for name in begin:
        check_known(name, names, f"restartable: block {block.name!r} has no state {name!r}")
    before = tuple(s.replace(name=_beside(s.name, "before")) for s in block.states)
    old = {s.symbol: b.symbol for s, b in zip(block.states, before, strict=True)}
    first = {s.name: s.replace(name=_beside(s.name, "first")) for s in block.states if s.start}
    begun = {}
    for s, b in zip(block.states, before, strict=True):
        start = first[s.name].symbol if s.name in first else sp.S.Zero
        again = begin.get(s.name, start).xreplace(old)
        begun[s.name] = sp.Piecewise((again, restart.symbol > 0), (b.symbol, True))
    return replace(
        block,
        states=before,
        inputs=(*block.inputs, restart),
        parameters=(*block.parameters, *(s for name, s in first.items() if name not in begin)),
        derivatives=Expressions((_beside(name, "before"), e) for name, e in block.derivatives.items()),
        definitions=Expressions({**begun, **block.definitions}),
        definition_signals=(*block.states, *block.definition_signals),
    )


def _beside(name: str, word: str) -> str:
    """Return a prefixed signal name in the same Block: ``part.x`` becomes ``part.word_x``."""
    block, dot, own = name.rpartition(".")
    return f"{block}{dot}{word}_{own}"
