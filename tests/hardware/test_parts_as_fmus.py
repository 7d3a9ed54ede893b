"""Every part of the autopilot is an FMU of its own that does what the Block does."""

from copy import copy

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from hovercontrol.estimators.ins import aided_ins
from hovercontrol.hardware.actuators import speed_controller, thrust_lookup
from hovercontrol.hardware.links import bluetooth_delays, empirical_delay
from hovercontrol.hardware.sensors import k06_imu
from hovercontrol.hybrid import Ticking
from hovercontrol.signals import Signal

PARTS = (
    k06_imu(),
    aided_ins(),
    thrust_lookup(),
    speed_controller(),
    empirical_delay([Signal("thrust", "N")], bluetooth_delays("linksys_22.0_uplink"), 0.02),
)


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_a_part_as_fmu_is_the_block(part, tmp_path):
    path = part.to_fmu(tmp_path / "part.fmu", step=part.period, stop=1.0)
    assert validate_fmu(str(path)) == []
    rng = np.random.default_rng(5)
    ticks = 60
    rows = {s.name: np.clip(rng.normal(size=ticks).cumsum(), s.lower, s.upper) for s in part.inputs}
    fields = [("time", float), *((name, float) for name in rows)]
    times = part.period * np.arange(ticks)
    table = np.array(list(zip(times, *rows.values(), strict=True)), dtype=fields)
    names = [s.name for s in part.outputs]
    run = simulate_fmu(
        str(path), stop_time=times[-1], step_size=part.period, output_interval=part.period,
        input=table, output=names,
    )  # fmt: skip
    # FMPy reads outputs before it sets the inputs of that time: a tick there has seen those before it, and is
    # taken again with the new ones when the step from there begins.
    block = Ticking(part)
    wanted = [copy(block).tick(0.0, {k: v[0] for k, v in rows.items()})]
    for begin, end, row in zip(times, times[1:], zip(*rows.values(), strict=True), strict=False):
        seen = dict(zip(rows, row, strict=True))
        block.tick(begin, seen)
        wanted.append(copy(block).tick(end, seen))
    for name in names:
        assert run[name] == pytest.approx([told[name] for told in wanted], rel=1e-9, abs=1e-12), name
