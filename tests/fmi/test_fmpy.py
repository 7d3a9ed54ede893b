"""Exported FMUs, run by FMPy, compute what the Block's other backends compute."""

from pathlib import Path

import control
import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave

from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.fmi.exporter.variables import Interface

from .blocks import BLOCKS, exported

try:
    find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)

KINDS = ("ModelExchange", "CoSimulation")
H, N = 0.05, 80
GRID = np.arange(N + 1) * H
#: FMPy hands it to CVode and to the FMU's solver; CVode's errors are some 100 times larger.
TOLERANCE = 1e-12


def random_run(block, seed):
    """Return parameters, start and one input value for each interval, all random."""
    rng = np.random.default_rng(seed)
    params = {key: value * rng.uniform(0.7, 1.4) for key, value in block.default_parameters.items()}
    params |= {key: 0.05 for key in params if key.endswith("_width")}
    start = rng.normal(0, 0.7, len(block.states))
    lower = np.array([max(s.lower, -s.nominal) for s in block.inputs])
    size = np.array([s.nominal for s in block.inputs])
    return params, start, lower[:, None] + size[:, None] * rng.uniform(0, 2.0, (len(block.inputs), N))


def by_python_control(block, params, x, inputs):
    """Inputs that hold: one call for each interval, for python-control interpolates between samples."""
    system, rows = block.to_control(), [x]
    solver = {"solve_ivp_method": "DOP853", "solve_ivp_kwargs": {"rtol": 1e-12, "atol": 1e-13}}
    for k in range(N):
        u = np.repeat(inputs[:, k : k + 1], 2, axis=1)
        x = control.input_output_response(system, GRID[k : k + 2], u, x, params=params, **solver).states[
            :, -1
        ]
        rows.append(x)
    return np.array(rows)


def signals(block, inputs, kind):
    """Return FMPy's signals: samples that Co-Simulation holds over a step, or steps as pairs of points."""
    held = np.column_stack([inputs, inputs[:, -1:]])
    time, values = GRID, held
    if kind == "ModelExchange":
        time, values = np.repeat(GRID, 2)[1:-1], np.repeat(inputs, 2, axis=1)
    table = np.zeros(len(time), dtype=[("time", float), *((s.name, float) for s in block.inputs)])
    table["time"] = time
    for s, row in zip(block.inputs, values, strict=True):
        table[s.name] = row
    return table


def by_fmpy(path, block, kind, params, start, inputs):
    result = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        start_values=params | dict(zip((s.name for s in block.states), start, strict=True)),
        input=signals(block, inputs, kind),
        stop_time=GRID[-1],
        output_interval=H,
        relative_tolerance=TOLERANCE,
        record_events=False,
    )
    np.testing.assert_allclose(result["time"], GRID, atol=1e-12)
    return np.column_stack([result[s.name] for s in block.outputs])


def error(found, expected):
    """Largest error, relative to the largest value of each signal."""
    return (np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)).max()


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", ["plant", "four_fan"])
def test_plant_is_to_control_on_random_inputs_and_parameters(name, seed):
    block = BLOCKS[name]
    params, start, inputs = random_run(block, seed)
    expected = by_python_control(block, params, start, inputs)
    for version in (2, 3):
        path = exported(name, version, "smooth")
        for kind in KINDS:
            assert error(by_fmpy(path, block, kind, params, start, inputs), expected) <= 1e-8


@pytest.mark.parametrize("seed", [1, 2])
def test_exact_friction_is_that_of_the_compiled_block(seed):
    block = BLOCKS["plant"]
    params, start, inputs = random_run(block, seed)
    inputs[:, 40:] = 0.0  # coast until everything sticks
    response = block.compile(friction="events").simulate(
        GRID, np.column_stack([inputs, inputs[:, -1:]]), start, params, rtol=1e-11, atol=1e-13
    )
    expected = response.outputs.T
    for version in (2, 3):
        path = exported("plant", version)
        for kind in KINDS:
            found = by_fmpy(path, block, kind, params, start, inputs)
            assert error(found, expected) <= 1e-8
            assert (expected == 0.0).sum() > 50
            np.testing.assert_array_equal(found == 0.0, expected == 0.0)  # it sticks at exactly zero


@pytest.mark.slow("ModelExchange", "CoSimulation-2")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_the_whole_loop_is_the_compiled_loop(version, kind):
    block = BLOCKS["loop"]
    path = exported("loop", version, "smooth")
    grid = np.arange(0, 2.01, 0.1)
    expected = block.compile(friction="smooth").simulate(grid, rtol=1e-10, atol=1e-13)
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=2.0,
        output_interval=0.1,
        relative_tolerance=1e-10,
        record_events=False,
    )
    for name, row in zip(expected.output_labels, expected.outputs, strict=True):
        np.testing.assert_allclose(found[name], row, rtol=1e-6, atol=1e-8)


def instance(name, friction="events"):
    path = exported(name, 3, friction)
    description = fmpy.read_model_description(path)
    folder = fmpy.extract(str(path), unzipdir=str(Path(path).parent / f"unzipped-{friction}"))
    fmu = FMU3Slave(
        guid=description.guid or description.instantiationToken,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="test",
    )
    fmu.instantiate()
    fmu.enterInitializationMode()
    return fmu, description


@pytest.mark.slow("estimator")
@pytest.mark.parametrize("name", BLOCKS)
def test_every_listed_variable_reads_as_the_block_computes_it(name):
    """Value references of the description are those of the binary."""
    block, interface = BLOCKS[name], Interface(BLOCKS[name], "smooth")
    fmu, _ = instance(name, "smooth")
    rng = np.random.default_rng(4)
    given = interface.of("state", "input", "parameter")
    values = {v.reference: v.start if v.kind == "parameter" else rng.uniform(0.0, 1.0) for v in given}
    element_of = {v.reference: a.reference for a in interface.arrays for v in a.elements}

    def listed(references):
        return list(dict.fromkeys(element_of.get(r, r) for r in references))

    fmu.setFloat64(listed(values), list(values.values()))
    x, u = ([values[v.reference] for v in interface.of(kind)] for kind in ("state", "input"))
    numpy = block.to_numpy()
    derivatives = [v.reference for v in interface.of("derivative")]
    if derivatives:
        expected = numpy.derivatives(0.0, x, u)
        found = fmu.getFloat64(listed(derivatives), len(derivatives))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    outputs = [v.reference for v in interface.outputs]
    np.testing.assert_allclose(fmu.getFloat64(outputs), numpy.outputs(0.0, x, u), rtol=1e-9, atol=1e-9)
    fmu.freeInstance()


@pytest.mark.parametrize("name", ["plant", "controller", "odd"])
def test_dependencies_are_those_of_the_binary(name):
    """A known that is not among an unknown's dependencies does not change its value."""
    fmu, description = instance(name)
    rng = np.random.default_rng(5)
    knowns = [v for v in description.modelVariables if v.initial == "exact" or v.causality == "input"]
    low = {v.valueReference: float(v.min or -2.0) for v in knowns}
    high = {v.valueReference: float(v.max or 2.0) for v in knowns}
    for _ in range(20):
        point = {r: rng.uniform(max(low[r], -2.0), min(high[r], 2.0)) for r in low}
        fmu.setFloat64(list(point), list(point.values()))
        unknowns = {u.variable.valueReference: u for u in description.initialUnknowns}
        before = dict(zip(unknowns, fmu.getFloat64(list(unknowns)), strict=True))
        for v in knowns:
            r = v.valueReference
            fmu.setFloat64([r], [rng.uniform(max(low[r], -2.0), min(high[r], 2.0))])
            after = dict(zip(unknowns, fmu.getFloat64(list(unknowns)), strict=True))
            fmu.setFloat64([r], [point[r]])
            for u, unknown in unknowns.items():
                if v not in unknown.dependencies:
                    assert after[u] == before[u], (unknown.variable.name, v.name)
    fmu.freeInstance()
