"""FMUs: against to_control() in FMPy, time to export, size, and the same plant as a PythonFMU."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import control
import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts
from hovercontrol.fmi.exporter.binaries import this_platform

STEP = 0.05
KINDS = [(version, kind) for version in (2, 3) for kind in ("ModelExchange", "CoSimulation")]

#: The plant in Python by the equations that all backends share; ADVANCE takes x to the end of the step.
PYTHON_FMU = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
from scipy.integrate import solve_ivp
from hovercontrol import vehicle
from hovercontrol.blocks.simulation.runge_kutta import rk4

class Plant(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        block = vehicle("c17_simulation").plant()
        self.pair = block.to_numpy().scalar_pair("derivatives")
        self.p = block.parameter_values()
        for s in block.inputs:
            setattr(self, s.name, 0.0)
            self.register_variable(Real(s.name, causality=Fmi2Causality.input))
        for s in block.states:
            setattr(self, s.name, s.start)
            self.register_variable(Real(s.name, causality=Fmi2Causality.output))

    def do_step(self, t, h):
        x = [self.x, self.y, self.psi, self.u, self.v, self.r]
        u = [self.thrust, self.rudder]
        ADVANCE
        self.x, self.y, self.psi, self.u, self.v, self.r = x
        return True
"""
ADVANCE = {
    "one Runge-Kutta step": "x = rk4(self.pair, t, x, u, self.p, t + h, 1)",
    "SciPy's RK45, rtol 1e-6 as ours": (
        "x = solve_ivp(lambda t, x: self.pair[0](t, x, u, self.p), (t, t + h), x, rtol=1e-6, atol=1e-9)"
        ".y[:, -1].tolist()"
    ),
}


def blocks() -> dict[str, Block]:
    parts = loop_parts(load_scenario("table1"))
    return {
        **parts,
        "loop of 83 states": interconnect(list(parts.values()), "loop"),
        "four-fan craft": vehicle("four_fan").plant(),
    }


def errors(folder: Path, seed: int) -> dict[tuple[int, str], float]:
    """Return the largest relative error by kind, for random inputs that hold and random parameters."""
    block = vehicle("c17_simulation").plant()
    rng, n = np.random.default_rng(seed), 80
    grid = np.arange(n + 1) * STEP
    params = {key: value * rng.uniform(0.7, 1.4) for key, value in block.default_parameters.items()}
    params |= {key: 0.05 for key in params if key.endswith("_width")}
    inputs, x = rng.uniform(-1, 1, (2, n)) * [[1.0], [0.5]], rng.normal(0, 0.7, 6)
    start = params | dict(zip((s.name for s in block.states), x, strict=True))
    system, rows = block.to_control(), [x]
    solver = {"solve_ivp_method": "DOP853", "solve_ivp_kwargs": {"rtol": 1e-12, "atol": 1e-13}}
    for k in range(n):
        u = np.repeat(inputs[:, k : k + 1], 2, axis=1)
        x = control.input_output_response(system, grid[k : k + 2], u, x, params=params, **solver).states[
            :, -1
        ]
        rows.append(x)
    expected, found = np.array(rows), {}
    for version, kind in KINDS:
        path = block.to_fmu(folder / "smooth.fmu", version=version, friction="smooth")
        steps = kind == "ModelExchange"  # two points at a step; Co-Simulation holds what it is given
        times = np.repeat(grid, 2)[1:-1] if steps else grid
        table = np.zeros(len(times), dtype=[(name, float) for name in ("time", "thrust", "rudder")])
        table["time"] = times
        for name, row in zip(("thrust", "rudder"), inputs, strict=True):
            table[name] = np.repeat(row, 2) if steps else np.append(row, row[-1])
        more = {"stop_time": grid[-1], "output_interval": STEP, "relative_tolerance": 1e-12}
        result = fmpy.simulate_fmu(
            str(path), fmi_type=kind, start_values=start, input=table, record_events=False, **more
        )
        got = np.column_stack([result[s.name] for s in block.states])
        gap = np.abs(got - expected).max(axis=0) / np.abs(expected).max(axis=0)
        found[version, kind] = float(gap.max())
    return found


def per_step(path: Path, n: int = 500, batches: int = 12) -> tuple[float, float]:
    """Return seconds for doStep of 1 ms alone, and with two inputs set and six outputs read, through FMPy."""
    description = fmpy.read_model_description(path)
    references = {v.name: v.valueReference for v in description.modelVariables}
    inputs = [references[name] for name in ("thrust", "rudder")]
    outputs = [references[name] for name in ("x", "y", "psi", "u", "v", "r")]
    alone, whole, k = [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(path), unzipdir=folder)
        identifier = description.coSimulation.modelIdentifier
        fmu = FMU2Slave(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName="plant"
        )
        fmu.instantiate()
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.setReal(inputs, [1.0, 0.1])
        for _ in range(batches):
            begin = time.perf_counter()
            for k in range(k, k + n):  # noqa: B020  (time goes on from batch to batch)
                fmu.doStep(k * 1e-3, 1e-3)
            alone.append(time.perf_counter() - begin)
            k += 1
            begin = time.perf_counter()
            for k in range(k, k + n):  # noqa: B020
                fmu.setReal(inputs, [1.0 + 1e-6 * k, 0.1])
                fmu.doStep(k * 1e-3, 1e-3)
                fmu.getReal(outputs)
            whole.append(time.perf_counter() - begin)
            k += 1
        fmu.terminate()
        fmu.freeInstance()
    return min(alone) / n, min(whole) / n


def python_fmu(folder: Path, advance: str) -> Path:
    from pythonfmu.builder import FmuBuilder

    script = folder / f"plant_{len(list(folder.glob('plant_*.py')))}.py"  # Python keeps a module by its name
    script.write_text(PYTHON_FMU.replace("ADVANCE", advance))
    with contextlib.redirect_stdout(io.StringIO()):
        return Path(FmuBuilder.build_FMU(script, dest=folder / "python.fmu"))


def binary_sizes(path: Path) -> dict[str, int]:
    with zipfile.ZipFile(path) as archive:
        return {
            i.filename.split("/")[1]: i.file_size for i in archive.infolist() if "binaries/" in i.filename
        }


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    with tempfile.TemporaryDirectory() as name:
        yield from _rows(Path(name))


def _rows(folder: Path) -> Iterator[tuple[str, str, str, bool | None]]:
    worst: dict[tuple[int, str], float] = {}
    for seed in range(5):
        for kind, gap in errors(folder, seed).items():
            worst[kind] = max(gap, worst.get(kind, 0.0))
    for (version, kind), gap in worst.items():
        text = f"plant against to_control(), FMI {version} {kind}, worst of 5"
        yield text, f"{gap:.1e} relative", "<= 1e-8", gap <= 1e-8

    findings, n = 0, 0
    for block in blocks().values():
        for version in (2, 3):
            findings += len(validate_fmu(str(block.to_fmu(folder / "x.fmu", version=version))))
            n += 1
    yield f"findings of fmpy validate on {n} FMUs", str(findings), "0", findings == 0

    for text, block in (("plant", blocks()["plant"]), ("loop of 83 states", blocks()["loop of 83 states"])):
        zig = importlib.util.find_spec("ziglang")
        path = block.to_fmu(folder / "x.fmu", platforms="all" if zig else this_platform())
        for platform, size in binary_sizes(path).items():
            ok = size <= 150_000 if text == "plant" else None
            yield f"{text}, binary for {platform}", f"{size / 1000:.0f} kB", "<= 150 kB" if ok else "", ok
        spent = []
        for _ in range(5):
            begin = time.perf_counter()
            block.to_fmu(folder / "x.fmu")
            spent.append(time.perf_counter() - begin)
        seconds = statistics.median(spent)
        yield f"{text}, to_fmu() with a warm cache", f"{seconds:.2f} s", "< 3 s", seconds < 3
    call = [sys.executable, "-m", "hovercontrol.app.cli", "export", "table1", "-o", str(folder / "x.fmu")]
    subprocess.run(call, check=True, capture_output=True)
    begin = time.perf_counter()
    subprocess.run(call, check=True, capture_output=True)
    seconds = time.perf_counter() - begin
    yield (
        "hovercontrol export table1 with a warm cache, Python's start too",
        f"{seconds:.1f} s",
        "< 3 s",
        seconds < 3,
    )

    ours = per_step(blocks()["plant"].to_fmu(folder / "ours.fmu", version=2))
    yield "1 ms through FMPy: doStep / set, doStep and get", _both(ours), "", None
    if importlib.util.find_spec("pythonfmu") is None:
        yield "the same as a PythonFMU", "skipped: pip install pythonfmu", ">= 10 times", None
        return
    for text, advance in ADVANCE.items():
        theirs = per_step(python_fmu(folder, advance))
        yield f"the same as a PythonFMU, {text}", _both(theirs), "", None
        ratios = [b / a for a, b in zip(ours, theirs, strict=True)]
        reached = ratios[0] >= 10
        yield "ratio", f"{ratios[0]:.1f} / {ratios[1]:.1f} times", ">= 10 times", reached


def _both(seconds: tuple[float, float]) -> str:
    return f"{1e6 * seconds[0]:.1f} / {1e6 * seconds[1]:.1f} us"
