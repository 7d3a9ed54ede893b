"""The amended model gives one set of figures on the held-out log: report, FMU, python-control."""

import control
import fmpy
import numpy as np
import pytest

from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.blocks.delays import arrivals, undelayed
from hovercontrol.craft.models.modelfile import load_model
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.evidence.traces import runs_of, simulated_traces

from .generator import NOISE, Conditions, make

try:
    find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)

TIGHT = {"rtol": 1e-10, "atol": 1e-12}
DT = 0.02


@pytest.fixture(scope="module", params=[(21, "thrust_lag", "slope"), (13, "input_delay")], ids=lambda p: p[1])
def diagnosed(request):
    seed, *names = request.param
    case = make(seed, names, Conditions(duration=12.0, logs=1, dt=DT))
    return case, diagnose(case.model, case.logs, case.holdout, names=[*names, "thrust_deadzone"])


@pytest.fixture(scope="module")
def amended(diagnosed, tmp_path_factory):
    """The plant of the model file that the diagnosis saves, and its FMU."""
    folder = tmp_path_factory.mktemp("amended")
    diagnosed[1].save(folder)
    block = load_model(folder / "model.toml").plant()
    return block, block.to_fmu(folder / "amended.fmu", friction="smooth", step=DT)


@pytest.fixture(scope="module")
def windows(diagnosed, amended):
    """First row, row behind the last and initial state of the runs of a second that figures are made of."""
    case, found = diagnosed
    fit = found.held_after
    rows = fit.problem.rows
    starts = {}
    for row, block in runs_of(fit.problem, 0, 1.0):
        at = rows.at[row, block]
        starts[int(at[0])] = int(at[-1]) + 1, fit.path[row[0], block[0]].copy()
    block, log = amended[0], case.holdout
    whole = block.compile(friction="smooth").simulate(log.time, commands(block, log), **TIGHT)
    for lag in [k for k, s in enumerate(block.states) if s.name == "thrust_lagged"]:
        for a, (_, x0) in starts.items():  # the search has it in the middle of steps
            x0[lag] = whole.states[lag, a]
    return [(a, b, x0) for a, (b, x0) in sorted(starts.items())]


def commands(block, log):
    return log.stack(*(s.name for s in block.inputs)).T


def by_machine_code(block, fmu, time, inputs, x0):
    return block.compile(friction="smooth").simulate(time, inputs, x0, **TIGHT).outputs


def by_python_control(block, fmu, time, inputs, x0):
    """Inputs that hold, as they arrive: one call for each interval, for python-control interpolates."""
    time, inputs, given = arrivals(block, time, inputs, block.parameter_values())
    system, x, rows = undelayed(block).to_control(), x0, []
    for k in range(len(time) - 1):
        run = control.input_output_response(
            system,
            time[k : k + 2],
            np.repeat(inputs[:, k : k + 1], 2, axis=1),
            x,
            solve_ivp_method="DOP853",
            solve_ivp_kwargs=TIGHT,
        )
        x = run.states[:, -1]
        rows += [run.outputs[:, -1]] if k else run.outputs.T.tolist()
    return np.transpose(rows)[:, given]


def by_fmpy(block, fmu, time, inputs, x0):
    names = [s.name for s in block.inputs]
    table = np.array(
        list(zip(time, *inputs, strict=True)), dtype=[("time", float), *((name, float) for name in names)]
    )
    result = fmpy.simulate_fmu(
        str(fmu),
        fmi_type="CoSimulation",
        start_values=dict(zip((s.name for s in block.states), x0, strict=True)),
        input=table,
        stop_time=time[-1],
        output_interval=DT,
        relative_tolerance=TIGHT["rtol"],
    )
    np.testing.assert_allclose(result["time"], time, atol=1e-9)
    return np.array([result[s.name] for s in block.outputs])


def errors(block, run, log, a, b):
    names = [s.name for s in block.outputs]
    return run[[names.index(c) for c in NOISE]] - log.stack(*NOISE).T[:, a:b]


def root_mean_square(found):
    return np.sqrt(np.mean(np.concatenate(found, axis=1) ** 2, axis=1))


def figures(backend, amended, log, windows):
    """Errors of runs that start where told and follow the commands from there on alone."""
    block, fmu = amended
    inputs = commands(block, log)
    runs = ((backend(block, fmu, DT * np.arange(b - a), inputs[:, a:b], x0), a, b) for a, b, x0 in windows)
    return root_mean_square([errors(block, run, log, a, b) for run, a, b in runs])


def figures_in_the_log(block, log, windows):
    """The same where commands that were sent before a window arrive in it."""
    late = arrivals(block, log.time, commands(block, log), block.parameter_values())
    compiled, found = undelayed(block).compile(friction="smooth"), []
    for a, b, x0 in windows:
        part = slice(late.given[a], late.given[b - 1] + 1)
        run = compiled.simulate(late.times[part], late.inputs[:, part], x0, **TIGHT)
        found.append(errors(block, run.outputs[:, late.given[a:b] - late.given[a]], log, a, b))
    return root_mean_square(found)


@pytest.mark.slow
def test_the_saved_model_has_the_effects_that_were_named(diagnosed, amended):
    case, found = diagnosed
    assert {e.effect for e in found.effects} == set(case.names)
    block = amended[0]
    if "thrust_lag" in case.names:
        assert "thrust_lagged" in [s.name for s in block.states]
    else:
        assert list(block.delays) == ["thrust", "rudder"]
        assert block.delays["thrust"].name == "plant.input_delay_seconds"


@pytest.mark.slow("thrust_lag")
def test_the_simulations_of_the_report_are_those_of_the_saved_model(diagnosed, amended, windows):
    case, found = diagnosed
    measured = figures_in_the_log(amended[0], case.holdout, windows)
    (trace,) = simulated_traces(found.held_after, 1.0)
    told = trace.rms()
    # The search takes means of commands over its sub-steps: finer ones bring 1e-2 of a late command to 1e-4.
    tolerance = 2e-2 if amended[0].delays else 1e-3
    np.testing.assert_allclose(measured, [told[c] for c in NOISE], rtol=tolerance)
    np.testing.assert_allclose(measured, list(NOISE.values()), rtol=0.15)


@pytest.mark.slow("thrust_lag")
@pytest.mark.parametrize("backend", [by_fmpy, by_python_control])
def test_every_backend_gives_the_same_figures(backend, diagnosed, amended, windows):
    log = diagnosed[0].holdout
    for spans in (windows[:5], [(0, len(log), windows[0][2])]):
        expected = figures(by_machine_code, amended, log, spans)
        np.testing.assert_allclose(figures(backend, amended, log, spans), expected, rtol=1e-6)
