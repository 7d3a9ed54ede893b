"""Every part of the autopilot is an FMU of its own that does what the Block does."""

import math
from copy import copy

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from hovercontrol.app.commands.exportable_parts import PARTS
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.fmi.exporter.description import Experiment, model_description
from hovercontrol.fmi.exporter.variables import Interface

#: Built and run; of the others the description is validated.
RUN = (
    "imu",
    "gyro",
    "aided_ins",
    "thrust_lookup",
    "rudder_servo",
    "speed_controller",
    "two_unit_heading",
    "link_linksys_22.0_uplink",
    "range_filter",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", PARTS)
def test_every_part_has_a_valid_description_finite_outputs_and_says_what_it_is(name, tmp_path):
    part = PARTS[name]
    assert 10 < len(part.says) < 200 and "`" not in part.says
    block = part.block(name)
    assert block.name.replace("_", ".") == name.replace("_", ".")
    whole = block.in_continuous_time
    starts = ([s.start for s in group] for group in (whole.states, whole.inputs))
    assert np.isfinite(whole.to_numpy().outputs(0.0, *starts)).all()
    exported = Interface(whole)
    described = model_description(exported, 3, "token", Experiment(1.0, 0.01, 1e-6), part.says, [])
    path = tmp_path / "modelDescription.xml"
    path.write_bytes(described)
    found = read_model_description(str(path), validate=True, validate_variable_names=True)
    elements = {"input": 0, "output": 0}  # those of arrays
    for v in found.modelVariables:
        if v.causality in elements:
            elements[v.causality] += math.prod(int(d.start) for d in v.dimensions)
    assert elements == {"input": len(block.inputs), "output": len(block.outputs)}
    only_ticks = block.period > 0.0  # then it has no derivatives to tell
    assert found.coSimulation.providesAdjointDerivatives is not only_ticks


@pytest.mark.slow("range_filter", "aided_ins", "gyro", "heading", "link", "thrust_lookup")
@pytest.mark.parametrize("name", RUN)
def test_a_part_as_fmu_is_the_block(name, tmp_path):
    part = PARTS[name].block(name)
    # elements of arrays by their names: FMPy takes and gives scalars
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
