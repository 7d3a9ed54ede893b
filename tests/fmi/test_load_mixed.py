"""A sampled FMU beside a continuous craft: the craft sampled with the FMU's step, in one interconnect."""

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.fmi import load

STEP = 0.1
CRAFT = hc.vehicle("c17_simulation").plant()
R = hc.Signal("r", "rad/s")
GAIN = hc.Signal("gain", "s", start=0.4)


def damper():
    """A sampled law with memory: rudder(k + 1) = 0.5 rudder(k) + gain r(k)."""
    rudder = hc.Signal("rudder", "rad")
    return hc.Block("damper", [rudder], [R], [rudder], [GAIN], period=STEP,
                    derivatives={"rudder": 0.5 * rudder.symbol + GAIN.symbol * R.symbol})  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 3])
def test_a_sampled_fmu_and_a_craft_move_as_the_loop_of_blocks(tmp_path, version):
    law = load(damper().to_fmu(tmp_path / "damper.fmu", version=version), step=STEP)
    craft = CRAFT.to_control(name="craft").sample(STEP, name="craft")
    loop = ct.interconnect([craft, law], inputs=["thrust"], outputs=["u", "r"])
    t, x0 = STEP * np.arange(60), [0, 0, 0, 0.5, 0.0, 1.0, 0]
    found = ct.input_output_response(loop, t, np.ones(60), x0)
    blocks = hc.interconnect([CRAFT, damper()], "loop")
    start = dict(zip((s.name for s in CRAFT.states), x0, strict=False))
    same = hc.simulate(
        blocks, t, {"thrust": np.ones(60)}, [start.get(s.name.split(".")[-1], 0.0) for s in blocks.states]
    )
    for name in ("u", "r"):
        row = np.asarray(same.outputs)[[s.name for s in blocks.outputs].index(name)]
        assert np.abs(found.outputs[["u", "r"].index(name)] - row).max() < 1e-6
    law.close()


def test_an_fmu_with_a_fixed_step_beside_a_linear_system(written):
    """x(n + 1) = x + 0.1 (u - x); the loop with u = -2 x by hand."""
    with load(written("dahlquist"), kind="CoSimulation") as fmu:
        gain = ct.ss([], [], [], [[-2.0]], inputs="x", outputs="u", name="gain", dt=fmu.dt)
        loop = ct.interconnect([fmu, gain], inputs=None, outputs=["x"])
        run = ct.input_output_response(loop, fmu.dt * np.arange(20))
    assert np.ravel(run.outputs) == pytest.approx(0.7 ** np.arange(20), abs=1e-12)
