"""FMUs of plants with limits: the importer of the package and FMPy give the numbers of Python."""

from dataclasses import replace

import control as ct
import fmpy
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.models.actuated import actuated
from hovercontrol.craft.models.vehicles import c17_experiment, four_fan
from hovercontrol.fmi import load

TIMES = np.linspace(0.0, 2.0, 41)


def rudder_craft():
    return actuated(c17_experiment(), lag={"thrust": 0.1}, rate={"rudder": 2.0})


def fan_craft():
    fans = tuple(replace(f, upper=0.3) for f in four_fan().fans)
    return replace(four_fan(), fans=fans, limited=True).plant()


def cart():
    v, m = hc.Signal("v", "m/s"), hc.Signal("m", "kg", start=2.0)
    F = hc.Signal("F", "N", lower=-1.0, upper=4.0)
    return actuated(hc.Block("cart", [v], [F], [v], [m], {"v": F.symbol / m.symbol}), deadzone=0.2)


def commands(block, rng):
    """Return commands far outside the bounds, each held for 0.4 s, and some a hair outside."""
    size = np.array([[s.upper if np.isfinite(s.upper) else 1.0] for s in block.inputs])
    held = rng.uniform(-4.0, 4.0, (len(block.inputs), 6)) * size
    held[:, 3] = size[:, 0] * (1 + 1e-9)
    return np.repeat(held, 8, axis=1)[:, : TIMES.size]


@pytest.mark.parametrize(("make", "version"), [(rudder_craft, 3), (fan_craft, 2), (cart, 3)])
def test_an_fmu_with_limits_gives_the_numbers_of_python(make, version, tmp_path, rng):
    block = make()
    path = block.to_fmu(tmp_path / "limited.fmu", version=version)
    u = commands(block, rng)
    wanted = np.atleast_2d(hc.simulate(block, TIMES, u, rtol=1e-8, atol=1e-10).outputs)
    names = [s.name for s in block.outputs]
    system = load(path, step=0.05)
    found = np.atleast_2d(ct.input_output_response(system, TIMES, u).outputs)
    shown = [system.output_labels.index(name) for name in names]
    np.testing.assert_allclose(found[shown, 1:-1], wanted[:, 1:-1], atol=1e-4)
    inputs = [s.name for s in block.inputs]
    rows = np.array(list(zip(TIMES, *u, strict=True)), dtype=[(n, float) for n in ("time", *inputs)])
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type="CoSimulation",
        stop_time=2.0,
        step_size=0.05,
        output_interval=0.05,
        input=rows,
        output=names,
    )
    by_fmpy = np.array([result[name] for name in names])
    between = np.arange(TIMES.size) % 8 != 0  # at a jump FMPy tells what was before it
    np.testing.assert_allclose(by_fmpy[:, between], wanted[:, between], atol=1e-4)
