"""One FMU in one importer: run in that importer's own environment, which has no hovercontrol.

``python interop_importers.py TOOL < task``: a task is JSON with ``fmu``, ``kind`` (ModelExchange,
CoSimulation or ssp), ``steps`` (times and inputs that jump there), ``outputs``, ``stop``, ``step`` and
``again``: "restart" runs, resets and runs again; "saved state" saves the state at ``middle``, runs to the
stop, goes back and runs there again. The last line of the answer is JSON: the outputs at the stop.
``python interop_importers.py make-TOOL < task`` writes an FMU of that tool, ``made``.
"""

from __future__ import annotations

import json
import sys
import tempfile
import zipfile
from collections.abc import Callable
from typing import Any

Task = dict[str, Any]


def fmpy(task: Task) -> dict[str, float]:
    import numpy as np
    from fmpy import extract, read_model_description, simulate_fmu
    from fmpy.simulation import instantiate_fmu

    rows = []
    for t, values in task["steps"]:  # a jump is two rows at one time
        rows += [(t, *rows[-1][1:])] if rows else []
        rows.append((t, *values.values()))
    rows.append((task["stop"], *rows[-1][1:]))
    names = ["time", *task["steps"][0][1]]
    table = np.array(rows, dtype=[(name, float) for name in names]) if len(names) > 1 else None
    folder, described = extract(task["fmu"]), read_model_description(task["fmu"])
    fmu = instantiate_fmu(folder, described, task["kind"])

    def run(stop: float, **more: Any) -> Any:
        return simulate_fmu(
            folder, model_description=described, fmu_instance=fmu, fmi_type=task["kind"], input=table,
            stop_time=stop, output_interval=task["step"], output=task["outputs"], relative_tolerance=1e-8,
            terminate=False, set_stop_time=False, **more,
        )  # fmt: skip

    if task["again"] == "restart":
        run(task["stop"])
        fmu.reset()
    if task["again"] == "saved state":
        run(task["middle"])
        state = fmu.getFMUState()
        for _ in range(2):
            found = run(task["stop"], start_time=task["middle"], fmu_state=state)
    else:
        found = run(task["stop"])
    return {name: float(found[name][-1]) for name in task["outputs"]}


def gemseo(task: Task) -> dict[str, float]:
    from gemseo_fmu.disciplines.fmu_discipline import FMUDiscipline
    from gemseo_fmu.utils.time_series import TimeSeries

    times, names = [t for t, _ in task["steps"]], list(task["steps"][0][1])
    discipline = FMUDiscipline(
        task["fmu"], names, task["outputs"], initial_time=0.0, final_time=task["stop"],
        time_step=task["step"], use_co_simulation=task["kind"] == "CoSimulation",
    )  # fmt: skip
    # half a step of tolerance: its times are sums of steps
    series = {
        k: TimeSeries(times, [v[k] for _, v in task["steps"]], tolerance=task["step"] / 2) for k in names
    }
    for _ in range(2 if task["again"] else 1):
        found = discipline.execute(series)
    return {name: float(found[name][-1]) for name in task["outputs"]}


def fmugym(task: Task) -> dict[str, float]:
    import numpy as np
    from fmugym import FMUGym, FMUGymConfig, VarSpace

    class Environment(FMUGym):  # what its users define
        def _noisy_init(self) -> dict[int, float]:
            return {}

        def compute_reward(self, *_: Any) -> float:
            return 0.0

    spaces = VarSpace("inputs"), VarSpace("outputs")
    for space, names in zip(spaces, (task["steps"][0][1], task["outputs"]), strict=True):
        for name in names:
            space.add_var_box(name, -1e3, 1e3)
    config = FMUGymConfig(
        task["fmu"], stop_time=task["stop"] + 1.0, sim_step_size=task["step"], action_step_size=task["step"],
        inputs=spaces[0], outputs=spaces[1], random_vars=VarSpace("random"),
    )  # fmt: skip
    environment = Environment(config)
    for _ in range(2 if task["again"] else 1):
        environment.reset()
        for k in range(round(task["stop"] / task["step"])):
            values = [v for at, v in task["steps"] if at <= k * task["step"] + 1e-12][-1]
            action = np.array([values[name] for name in environment.input_dict])
            seen = environment.step(action)[0]
    return dict(zip(environment.output_dict, map(float, seen), strict=True))


def pathsim(task: Task) -> dict[str, float]:
    from pathsim import Connection, Simulation
    from pathsim.blocks import Scope, Source
    from pathsim.solvers import RKDP54
    from pathsim_fmi import CoSimulationFMU, ModelExchangeFMU

    block = (
        ModelExchangeFMU(task["fmu"])
        if task["kind"] == "ModelExchange"
        else CoSimulationFMU(task["fmu"], dt=task["step"])
    )
    steps, names = task["steps"], list(task["steps"][0][1])

    def of(name: str) -> Any:
        return lambda t: [values[name] for at, values in steps if at <= t + 1e-12][-1]

    sources = [Source(of(name)) for name in names]
    scope = Scope()
    wires = [Connection(source, block[k]) for k, source in enumerate(sources)]
    md = block.fmu_wrapper.model_description
    outputs = [v.name for v in md.modelVariables if v.causality == "output"]
    wires += [Connection(block[outputs.index(name)], scope[k]) for k, name in enumerate(task["outputs"])]
    run = Simulation([block, scope, *sources], wires, dt=task["step"], log=False, Solver=RKDP54)
    run.run(task["stop"])
    if task["again"]:
        run.run(task["stop"], reset=True)
    return dict(zip(task["outputs"], map(float, scope.read()[1][:, -1]), strict=True))


def casadi(task: Task) -> dict[str, float]:
    import casadi as ca
    import numpy as np

    dae = ca.DaeBuilder("m", task["fmu"])
    f = dae.create("f", ["t", "x", "u"], ["ode", "y"])  # without t the equations stay at the start time
    x, u = np.array(dae.start(dae.x()), dtype=float), list(dae.u())
    h = task["step"] / 10  # an explicit method: the estimator of Table I is stiff
    n = round(task["stop"] / h)
    for k in range(n):  # RK4
        values = [v for at, v in task["steps"] if at <= k * h + 1e-12][-1]
        w = ca.DM([values[name] for name in u]) if u else ca.DM.zeros(0, 1)
        rate = lambda t, z, w=w: np.array(f(t, z, w)[0]).ravel()  # noqa: E731
        a = rate(k * h, x)
        b = rate((k + 0.5) * h, x + h / 2 * a)
        c = rate((k + 0.5) * h, x + h / 2 * b)
        d = rate((k + 1) * h, x + h * c)
        x = x + h / 6 * (a + 2 * b + 2 * c + d)
    y = np.array(f(n * h, x, w)[1]).ravel()
    return {name: float(y[list(dae.y()).index(name)]) for name in task["outputs"]}


def libcosimpy(task: Task) -> dict[str, float]:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    ns = int(task["step"] * 1e9)
    observer = CosimObserver.create_last_value()
    if task["kind"] == "ssp":
        folder = tempfile.mkdtemp()
        zipfile.ZipFile(task["fmu"]).extractall(folder)
        run = CosimExecution.from_ssp_file(ssp_path=folder, step_size=ns)
        index = run.slave_index_from_instance_name(task["component"])
    else:
        run = CosimExecution.from_step_size(ns)
        index = run.add_local_slave(CosimLocalSlave(task["fmu"], "it"))
    run.add_observer(observer)
    override = CosimManipulator.create_override()
    run.add_manipulator(override)
    places = {v.name.decode(): v.reference for v in run.slave_variables(index)}
    for at, values in task["steps"]:
        if at > 0:
            run.simulate_until(target_time=int(at * 1e9))
        if values:
            override.slave_real_values(index, [places[name] for name in values], list(values.values()))
    run.simulate_until(target_time=int(task["stop"] * 1e9))
    found = observer.last_real_values(
        slave_index=index, variable_references=[places[name] for name in task["outputs"]]
    )
    return dict(zip(task["outputs"], map(float, found), strict=True))


def ecospy(task: Task) -> dict[str, float]:
    import ecospy as ecos

    if task["kind"] == "ssp":
        run, at = ecos.EcosSimulation(step_size=task["step"], ssp_path=task["fmu"]), task["component"]
    else:
        structure, at = ecos.EcosSimulationStructure(), "it"
        structure.add_model(at, task["fmu"])
        run = ecos.EcosSimulation(step_size=task["step"], structure=structure)
    for name, value in task["steps"][0][1].items():
        run.set_real(f"{at}::{name}", value)
    for turn in range(2 if task["again"] else 1):
        if turn:
            run.reset()
        run.init()
        for k, (_, values) in enumerate(task["steps"]):
            for name, value in values.items():
                run.set_real(f"{at}::{name}", value)
            until = task["steps"][k + 1][0] if k + 1 < len(task["steps"]) else task["stop"]
            while run.get_time() < until - 1e-9:
                run.step()
    found = {name: float(run.get_real(f"{at}::{name}")) for name in task["outputs"]}
    run.terminate()
    return found


def fmuloader(task: Task) -> dict[str, float]:
    from xml.etree import ElementTree

    root = ElementTree.fromstring(zipfile.ZipFile(task["fmu"]).read("modelDescription.xml"))
    two = root.get("fmiVersion") == "2.0"
    places = {v.get("name"): int(v.get("valueReference", 0)) for v in root.find("ModelVariables") or ()}
    identifier = root.find("CoSimulation").get("modelIdentifier")
    if two:
        from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

        fmu = Fmi2Slave(task["fmu"], model_identifier=identifier)
        fmu.instantiate("it", Fmi2Type.CO_SIMULATION, guid=root.get("guid"))
        put, get = fmu.set_real, fmu.get_real
    else:
        from fmuloader.fmi3 import Fmi3Slave

        fmu = Fmi3Slave(task["fmu"], model_identifier=identifier)
        fmu.instantiate_co_simulation("it", instantiation_token=root.get("instantiationToken"))
        put, get = fmu.set_float64, fmu.get_float64

    def begin() -> None:
        if two:
            fmu.setup_experiment(start_time=0.0)
            fmu.enter_initialization_mode()
        else:
            fmu.enter_initialization_mode(start_time=0.0)
        fmu.exit_initialization_mode()

    def run(start: float, stop: float) -> None:
        for k in range(round(start / task["step"]), round(stop / task["step"])):
            t = k * task["step"]
            values = [v for at, v in task["steps"] if at <= t + 1e-12][-1]
            if values:
                put([places[name] for name in values], list(values.values()))
            fmu.do_step(t, task["step"])

    begin()
    if task["again"] == "restart":
        run(0.0, task["stop"])
        fmu.reset()
        begin()
    if task["again"] == "saved state":
        run(0.0, task["middle"])
        state = fmu.get_fmu_state()
        run(task["middle"], task["stop"])
        fmu.set_fmu_state(state)
    run(task["middle"] if task["again"] == "saved state" else 0.0, task["stop"])
    return dict(zip(task["outputs"], map(float, get([places[n] for n in task["outputs"]])), strict=True))


def cofmupy(task: Task) -> dict[str, float]:
    from cofmupy.coordinator import Coordinator

    if task["kind"] == "ssp":
        at, (fmus, connections) = task["component"], parts_of(task["fmu"])
    else:
        at, fmus = "it", {"it": task["fmu"]}
        connections = [
            {
                "source": {
                    "type": "literal",
                    "values": {str(t): values[name] for t, values in task["steps"]},
                    "interpolation": "previous",
                },
                "target": {"id": "it", "variable": name},
            }
            for name in task["steps"][0][1]
        ]
    run = Coordinator()
    listed = [{"id": name, "path": path, "initialization": {}} for name, path in fmus.items()]
    run.start({"fmus": listed, "connections": connections})
    run.run_simulation(task["step"], task["stop"])
    found = run.get_results()
    return {name: float(found[at, name][-1]) for name in task["outputs"]}


def parts_of(ssp: str) -> tuple[dict[str, str], list[Any]]:
    """Return the FMUs of a flat system and its connections, as cofmupy writes them."""
    from xml.etree import ElementTree

    folder = tempfile.mkdtemp()
    zipfile.ZipFile(ssp).extractall(folder)
    root = ElementTree.parse(f"{folder}/SystemStructure.ssd").getroot()
    fmus = {e.get("name"): f"{folder}/{e.get('source')}" for e in root.iter() if e.tag.endswith("}Component")}
    ends = [e.attrib for e in root.iter() if e.tag.endswith("}Connection")]
    return fmus, [
        {
            "source": {"id": e["startElement"], "variable": e["startConnector"]},
            "target": {"id": e["endElement"], "variable": e["endConnector"]},
        }
        for e in ends
        if "startElement" in e and "endElement" in e
    ]


def contained(task: Task) -> str:
    """Write an FMU around an FMU, with its inputs, outputs and parameters."""
    from pathlib import Path

    from fmu_manipulation_toolbox.container import FMUContainer

    source = Path(task["fmu"])
    whole = FMUContainer("whole", source.parent)
    whole.get_fmu(source.name)
    whole.add_implicit_rule(auto_input=True, auto_output=True, auto_parameter=True)
    made = source.parent / f"container-{source.name}"
    whole.make_fmu(made, step_size=task["step"])
    return str(made)


def container(task: Task) -> dict[str, float]:
    return fmpy({**task, "fmu": contained(task)})


def exported_by_casadi(task: Task) -> str:
    """Write x' = u - k x, y = x in the present folder; the standard's headers are FMPy's."""
    from pathlib import Path

    import casadi as ca
    import fmpy

    dae = ca.DaeBuilder("decay")
    dae.add("t", "independent")
    x, u = dae.add("x"), dae.add("u", "input")
    k, y = dae.add("k", "parameter", "tunable", {"start": 1.0}), dae.add("y", "output")
    dae.eq(dae.der(x), u - k * x)
    dae.eq(y, x)
    headers = str(Path(fmpy.__file__).parent / "c-code")
    files = dae.compile_fmu(dae.export_fmu({"no_warning": True}), {"include_dirs": [headers]})
    return str(Path(dae.pack_fmu(files, {"path": "decay.fmu"})).absolute())


def pyssp(task: Task) -> dict[str, float]:
    """Check a system's files by the standard's schemas."""
    from pyssp_standard.ssp import SSP

    with SSP(task["fmu"], mode="r") as ssp, ssp.system_structure as structure:
        structure.__check_compliance__()
        return {"components": float(len(structure.system.elements))}


TOOLS: dict[str, Callable[[Task], dict[str, Any]]] = {
    "fmpy": fmpy,
    "pathsim-fmi": pathsim,
    "casadi": casadi,
    "libcosimpy": libcosimpy,
    "ecospy": ecospy,
    "fmuloader": fmuloader,
    "cofmupy": cofmupy,
    "fmu-manipulation-toolbox": container,
    "pyssp-standard": pyssp,
    "gemseo-fmu": gemseo,
    "fmugym": fmugym,
    "make-casadi": lambda task: {"made": exported_by_casadi(task)},
    "make-fmu-manipulation-toolbox": lambda task: {"made": contained(task)},
}

if __name__ == "__main__":
    print("\n" + json.dumps(TOOLS[sys.argv[1]](json.load(sys.stdin))))
