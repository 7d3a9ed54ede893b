"""One FMU in one importer: run in that importer's own environment, which has no hovercontrol.

``python interop_importers.py TOOL < task``: a task is JSON with ``fmu``, ``kind`` (ModelExchange,
CoSimulation or ssp), ``steps`` (times and inputs that jump there), ``outputs``, ``stop`` and ``step``. The
last line of the answer is JSON: the outputs at the stop.
"""

from __future__ import annotations

import json
import sys
import tempfile
import zipfile
from typing import Any

Task = dict[str, Any]


def fmpy(task: Task) -> dict[str, float]:
    import numpy as np
    from fmpy import simulate_fmu

    rows = []
    for t, values in task["steps"]:  # a jump is two rows at one time
        rows += [(t, *rows[-1][1:])] if rows else []
        rows.append((t, *values.values()))
    rows.append((task["stop"], *rows[-1][1:]))
    names = ["time", *task["steps"][0][1]]
    table = np.array(rows, dtype=[(name, float) for name in names]) if len(names) > 1 else None
    run = simulate_fmu(
        task["fmu"],
        fmi_type=task["kind"],
        input=table,
        stop_time=task["stop"],
        output_interval=task["step"],
        output=task["outputs"],
        relative_tolerance=1e-8,
    )
    return {name: float(run[name][-1]) for name in task["outputs"]}


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
    Simulation([block, scope, *sources], wires, dt=task["step"], log=False, Solver=RKDP54).run(task["stop"])
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
        fmu.setup_experiment(start_time=0.0)
        fmu.enter_initialization_mode()
        put, get = fmu.set_real, fmu.get_real
    else:
        from fmuloader.fmi3 import Fmi3Slave

        fmu = Fmi3Slave(task["fmu"], model_identifier=identifier)
        fmu.instantiate_co_simulation("it", instantiation_token=root.get("instantiationToken"))
        fmu.enter_initialization_mode(start_time=0.0)
        put, get = fmu.set_float64, fmu.get_float64
    fmu.exit_initialization_mode()
    for k in range(round(task["stop"] / task["step"])):
        t = k * task["step"]
        values = [v for at, v in task["steps"] if at <= t + 1e-12][-1]
        if values:
            put([places[name] for name in values], list(values.values()))
        fmu.do_step(t, task["step"])
    return dict(zip(task["outputs"], map(float, get([places[n] for n in task["outputs"]])), strict=True))


def cofmupy(task: Task) -> dict[str, float]:
    from cofmupy.coordinator import Coordinator

    jumps = {name: [(at, values[name]) for at, values in task["steps"]] for name in task["steps"][0][1]}
    connections = [
        {
            "source": {
                "type": "literal",
                "values": {str(at): value for at, value in rows},
                "interpolation": "previous",
            },
            "target": {"id": "it", "variable": name},
        }
        for name, rows in jumps.items()
    ]
    run = Coordinator()
    config = {"fmus": [{"id": "it", "path": task["fmu"], "initialization": {}}], "connections": connections}
    run.start(config)
    run.run_simulation(task["step"], task["stop"])
    found = run.get_results()
    return {name: float(found["it", name][-1]) for name in task["outputs"]}


def container(task: Task) -> dict[str, float]:
    """Make one FMU of the FMU, and run that in FMPy."""
    from pathlib import Path

    from fmu_manipulation_toolbox.container import FMUContainer

    source = Path(task["fmu"])
    whole = FMUContainer("whole", source.parent)
    whole.get_fmu(source.name)
    whole.add_implicit_rule(auto_input=True, auto_output=True)
    made = source.parent / f"container-{source.name}"
    whole.make_fmu(made, step_size=task["step"])
    return fmpy({**task, "fmu": str(made)})


def pyssp(task: Task) -> dict[str, float]:
    """Check a system's files by the standard's schemas."""
    from pyssp_standard.ssp import SSP

    with SSP(task["fmu"], mode="r") as ssp, ssp.system_structure as structure:
        structure.__check_compliance__()
        return {"components": float(len(structure.system.elements))}


TOOLS = {
    "fmpy": fmpy,
    "pathsim-fmi": pathsim,
    "casadi": casadi,
    "libcosimpy": libcosimpy,
    "ecospy": ecospy,
    "fmuloader": fmuloader,
    "cofmupy": cofmupy,
    "fmu-manipulation-toolbox": container,
    "pyssp-standard": pyssp,
}

if __name__ == "__main__":
    print("\n" + json.dumps(TOOLS[sys.argv[1]](json.load(sys.stdin))))
