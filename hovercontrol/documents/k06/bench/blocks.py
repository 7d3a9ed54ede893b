"""K06's rotating bench with sensors, navigation and instruments as one hybrid Block (section 6.2.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.autopilot.turntable import ARM, bench_command, turntable
from hovercontrol.control.observers.ins import IMU_PERIOD, aided_ins
from hovercontrol.craft.hardware.sensors import (
    arrivals,
    gyro_compensation,
    gyro_dynamics,
    k06_cricket,
    k06_imu,
    k06_magnetometer,
    two_unit_heading,
)
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.documents.k06.bench.instruments import CENTRE, encoder, sample_delay, tachometer

#: The first Cricket unit beside the IMU, the second 8 in nearer to the spin axis [m].
UNITS = ((0.0, 0.0), (0.0, 8 * 0.0254))
#: Largest age of a Cricket unit's place when its fix arrives [ticks].
OLDEST = 13

_HATS = ("psi_hat", "r_hat", "x_hat", "y_hat", "v_x_hat", "v_y_hat")
_SHOWN = (
    "r", "psi", "x", "y", "yaw_rate_used", "psi_hat", "r_hat", "heading_fix", "heading_assisted",
    "heading_fix_arrived", "heading_error", "rate_error", "velocity_error", "position_error", "raw_error",
    "assisted_error",
)  # fmt: skip


def bench() -> Block:
    """Return the whole bench; its parameters select the test.

    Returns
    -------
    Block
        Hybrid, without inputs. Parameters of note: ``command.motion, command.rate`` [rad/s],
        ``turntable.arm``, which ``encoder.arm`` and ``errors.arm`` must follow [m], ``turntable.tilt`` [rad],
        ``gyro_delay.samples``, ``gyro_compensation.dynamics`` (0: off), ``tachometer.noise`` [rad/s],
        ``aiding.cricket`` and ``aiding.assisted`` (0 or 1), ``cricket_ranges.latency`` (1: a slot of 100 ms)
        or instead of it ``ranged.aged`` (1: by ``cricket_age.samples``), and the filters'
        ``heading.Q1[0,0]`` and so on. Outputs: the truth ``r, psi, x, y``, the navigation's ``psi_hat,
        r_hat`` and its errors against the instruments, ``heading_error`` [rad], ``rate_error`` [rad/s],
        ``velocity_error`` [m/s] and ``position_error`` [m] (lengths of vectors), and of the two units'
        heading at its arrival ``raw_error`` and ``assisted_error`` [rad].

    Examples
    --------
    >>> [s.name for s in bench().outputs][:4]
    ['r', 'psi', 'x', 'y']
    """
    ports = {"yaw_rate": "yaw_rate_used", "fix_x": "aid_x", "fix_y": "aid_y", "fix_valid": "aid_valid"}
    navigation = interconnect([aided_ins(name="filters")], "ins", outputs=_HATS)
    assisted = two_unit_heading(UNITS, assisted=True, latency=True, name="assisted_heading")
    there = MOTION[:3]
    cricket = rename(k06_cricket(units=UNITS), {s.name: f"{s.name}_ranged" for s in there})
    parts = [
        *gyro_chain(),
        k06_magnetometer(),
        encoder(),
        tachometer(),
        sample_delay(there, "aged", most=OLDEST, samples=OLDEST, name="cricket_age"),
        _ranged(),
        cricket,
        rename(assisted, {f"heading_fix{end}": f"heading_assisted{end}" for end in ("", "_valid")}),
        arrivals(),
        _aiding(),
        rename(navigation, ports),
        _errors(),
    ]
    return interconnect(parts, "bench", outputs=_SHOWN)


def gyro_chain() -> list[Block]:
    """Return the platform, the IMU with the gyro's lag (6.2) and delay, and the compensation."""
    return [
        bench_command(),
        turntable(centre=CENTRE),
        gyro_dynamics(),
        k06_imu(rate="gyro_rate"),
        sample_delay([Signal("yaw_rate", "rad/s")], "late", name="gyro_delay"),
        gyro_compensation(reading="yaw_rate_late", output="yaw_rate_used"),
    ]


def _ranged() -> Block:
    """Return the Block that gives Cricket the present place to range, or a past one."""
    there, aged = MOTION[:3], Signal("aged", "1", "Cricket ranges a place as it was", modes=("off", "on"))
    past, told = ([s.replace(name=f"{s.name}_{end}") for s in there] for end in ("aged", "ranged"))
    return Block(
        "ranged",
        inputs=(*there, *past),
        outputs=tuple(told),
        parameters=(aged,),
        output_expressions={
            t.name: sp.Piecewise((old.symbol, aged.symbol > 0), (now.symbol, True))
            for t, old, now in zip(told, past, there, strict=True)
        },
    )


def _aiding() -> Block:
    """Return the Block that selects the aids: magnetometer and encoder, or Cricket, raw or assisted."""
    on, assisted = (
        Signal(name, "1", text, start=start, modes=("off", "on"))
        for name, text, start in (("cricket", "Cricket is the aid", 0.0), ("assisted", "its heading is", 1.0))
    )
    magnetic, raw, helped = (
        Signal(name, "rad") for name in ("heading_magnetic", "heading_fix", "heading_assisted")
    )
    fresh, fix = (Signal(name) for name in ("heading_fix_arrived", "fix_arrived"))
    pairs = {
        "aid_x": (Signal("encoder_x", "m"), Signal("fix_x", "m")),
        "aid_y": (Signal("encoder_y", "m"), Signal("fix_y", "m")),
        "aid_valid": (Signal("encoder_valid"), fix),
    }
    cricket, help_ = on.symbol > 0, assisted.symbol > 0
    two = sp.Piecewise((helped.symbol, help_), (raw.symbol, True))
    return Block(
        "aiding",
        inputs=(magnetic, raw, helped, fresh, *(s for pair in pairs.values() for s in pair)),
        outputs=(
            Signal("heading_aid", "rad"),
            Signal("heading_aid_valid"),
            *(a.replace(name=name) for name, (a, _) in pairs.items()),
        ),
        parameters=(on, assisted),
        output_expressions={
            "heading_aid": sp.Piecewise((two, cricket), (magnetic.symbol, True)),
            "heading_aid_valid": sp.Piecewise((fresh.symbol, cricket), (1, True)),
            **{n: sp.Piecewise((b.symbol, cricket), (a.symbol, True)) for n, (a, b) in pairs.items()},
        },
        period=IMU_PERIOD,
    )


def _errors() -> Block:
    """Return the Block that compares the navigation with encoder and tachometer at the IMU's ticks."""
    units = {"psi": "rad", "r": "rad/s", "x": "m", "y": "m", "v_x": "m/s", "v_y": "m/s"}
    hats = {n: Signal(f"{n}_hat", unit) for n, unit in units.items()}
    x, y, psi = (s.replace(start=0.0) for s in MOTION[:3])
    read, rate = Signal("encoder_psi", "rad"), Signal("tachometer_rate", "rad/s")
    fresh = Signal("heading_fix_arrived")
    arm = Signal("arm", "m", "from the spin axis to the sensors", start=ARM, lower=0.0)
    at = {n: s.symbol for n, s in hats.items()}
    speed = arm.symbol * rate.symbol
    off = {
        "velocity": (
            at["v_x"] - speed * sp.cos(read.symbol),
            at["v_y"] - speed * sp.sin(read.symbol),
        ),
        "position": (at["x"] - x.symbol, at["y"] - y.symbol),
    }
    told: dict[str, tuple[str, sp.Expr]] = {
        "heading_error": ("rad", _wrapped(at["psi"] - read.symbol)),
        "rate_error": ("rad/s", at["r"] - rate.symbol),
        "velocity_error": ("m/s", _length(off["velocity"])),
        "position_error": ("m", _length(off["position"])),
    }
    fixes: Mapping[str, Signal] = {
        "raw_error": Signal("heading_fix", "rad"),
        "assisted_error": Signal("heading_assisted", "rad"),
    }
    held = {n: Signal(f"last_{n}", "rad") for n in fixes}
    for n, fix in fixes.items():
        now = _wrapped(fix.symbol - psi.symbol)
        told[n] = ("rad", sp.Piecewise((now, fresh.symbol > 0), (held[n].symbol, True)))
    return Block(
        "errors",
        states=tuple(held.values()),
        inputs=(x, y, psi, *hats.values(), read, rate, fresh, *fixes.values()),
        outputs=tuple(Signal(n, unit) for n, (unit, _) in told.items()),
        parameters=(arm,),
        derivatives={held[n].name: told[n][1] for n in fixes},
        output_expressions={n: e for n, (_, e) in told.items()},
        period=IMU_PERIOD,
    )


def _wrapped(angle: sp.Expr) -> sp.Expr:
    return sp.atan2(sp.sin(angle), sp.cos(angle))


def _length(vector: Sequence[sp.Expr]) -> sp.Expr:
    return sp.sqrt(vector[0] ** 2 + vector[1] ** 2)
