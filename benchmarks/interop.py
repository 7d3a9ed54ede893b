"""Our FMUs in other importers, other tools' FMUs here: ``make interop`` prints a table and writes a page.

Each tool has an environment of its own, kept in a folder outside the repository (HOVERCONTROL_INTEROP,
default ~/.cache/hovercontrol-interop). A tool that cannot be installed is skipped, with the reason.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import control
import numpy as np

import hovercontrol as hc
from hovercontrol.app.commands.exportable import choose
from hovercontrol.blocks.block import Block
from hovercontrol.fmi import corrected_fmu, export_ssp, load
from tests.fmi.adversary import sled
from tests.fmi.test_python_fmus import SOURCES

HOME = Path(os.environ.get("HOVERCONTROL_INTEROP", Path.home() / ".cache" / "hovercontrol-interop"))
PAGE = Path(__file__).parent.parent / "docs" / "concepts" / "interop.md"
STEP, STOP = 0.01, 3.0
#: Largest deviation from our own run, relative to 1 or to the value: a tool's solver has its own tolerance.
CLOSE, NEAR = 1e-3, 2e-2
#: Packages of each tool, and what it is given: Model Exchange, Co-Simulation, a system.
TOOLS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "fmpy": (("fmpy",), ("ModelExchange", "CoSimulation")),
    "pathsim-fmi": (("pathsim-fmi",), ("ModelExchange", "CoSimulation")),
    "casadi": (("casadi",), ("ModelExchange",)),
    "libcosimpy": (("libcosimpy",), ("CoSimulation", "ssp")),
    "ecospy": (("ecospy", "tbb"), ("CoSimulation", "ssp")),
    "fmuloader": (("fmuloader",), ("CoSimulation",)),
    "cofmupy": (("cofmupy",), ("CoSimulation",)),
    "fmu-manipulation-toolbox": (("fmu-manipulation-toolbox", "fmpy"), ("CoSimulation",)),
    "pyssp-standard": (("pyssp-standard",), ("ssp",)),
    "pythonfmu": (("pythonfmu", "numpy"), ()),
    "pythonfmu3": (("pythonfmu3", "numpy"), ()),
    "mosaik-fmi": (("mosaik-fmi",), ()),
    "PyFMI": (("PyFMI",), ()),
    "OMSimulator": (("omsimulator",), ()),
}
ONE_AHEAD = "at time t it gives the outputs at t + step: it steps from t before it records them"
#: Why a cell is as it is, where the cause lies in the tool or in its interface.
CAUSES: dict[tuple[str, str], str] = {
    ("casadi", "plant, events"): "it passes no events: the modes of friction stay as they were at the start",
    ("casadi", "hybrid"): "it passes no events: the sampled law does not tick",
    ("cofmupy", "*"): ONE_AHEAD,
    ("pathsim-fmi", "CoSimulation"): ONE_AHEAD,
    (
        "casadi",
        "corrected",
    ): "it needs dependencies in FMI 3, which a corrected FMU leaves to their default",
    ("libcosimpy", "FMI 3"): "it reads FMI 1 and 2",
    ("libcosimpy", "SSP 2.0"): "it reads FMI 1 and 2",
    ("ecospy", "SSP 2.0"): "it reads SSP 1.0",
}


@dataclass(frozen=True)
class Export:
    """An FMU or a system of ours, and where its outputs must be at the stop."""

    name: str
    version: str
    path: Path
    steps: list[tuple[float, dict[str, float]]]
    want: dict[str, float]
    kinds: tuple[str, ...] = ("ModelExchange", "CoSimulation")


def reference(block: Block, steps: list[Any], outputs: list[str], friction: str) -> dict[str, float]:
    """Return outputs at the stop of our own run, inputs held between their jumps."""
    run = block.compile(friction=friction).start(inputs=steps[0][1] or None, rtol=1e-10, atol=1e-12)  # type: ignore[arg-type]
    for k, (at, values) in enumerate(steps):
        until = steps[k + 1][0] if k + 1 < len(steps) else STOP
        y = run.step(values or None, until - at)
    names = [s.name for s in block.outputs]
    return {name: float(y[names.index(name)]) for name in outputs}


def exports(folder: Path) -> Iterator[Export]:
    """Write each export."""
    thrust = [(0.0, {"thrust": 0.0, "rudder": 0.3}), (0.5, {"thrust": 2.5, "rudder": 0.3})]
    force = [(0.0, {"F": 0.5}), (0.25, {"F": 2.5}), (0.8, {"F": -1.0})]
    table1 = choose("table1")
    blocks: list[tuple[str, Block, str, list[Any], list[str]]] = [
        ("plant, smooth", choose("table1:plant").block, "smooth", thrust, ["x", "psi"]),
        ("plant, events", choose("table1:plant").block, "events", thrust, ["x", "psi"]),
        ("loop", table1.block, "smooth", [(0.0, {})], ["x", "y"]),
        ("hybrid", sled(), "events", force, ["x", "v"]),
    ]
    for name, block, friction, steps, outputs in blocks:
        want = reference(block, steps, outputs, friction)
        for version in (2, 3):
            path = folder / f"{name.replace(', ', '_')}{version}.fmu"
            made = block.to_fmu(path, version=version, friction=friction)  # type: ignore[arg-type]
            yield Export(name, f"FMI {version}", made, steps, want)
    slow = hc.Signal("thrust"), hc.Signal("lagged"), hc.Signal("thrust_given"), hc.Signal("T", "s", start=0.2)
    lag = {"lagged": (slow[0].symbol - slow[1].symbol) / slow[3].symbol}
    before = Block(
        "before", [slow[1]], [slow[0]], [slow[2]], [slow[3]], lag, {"thrust_given": slow[1].symbol}
    )
    plant = blocks[0][1]
    joined = hc.interconnect([before, hc.rename(plant, {"thrust": "thrust_given"})], "joined")
    want = reference(joined, thrust, ["x", "psi"], "smooth")
    for version in (2, 3):
        given = folder / f"plant_smooth{version}.fmu"
        path = corrected_fmu(given, folder / f"corrected{version}.fmu", before=before, kind="ModelExchange")
        yield Export("corrected", f"FMI {version}", path, thrust, want)
    loop = reference(table1.block, [(0.0, {})], ["x", "y"], "smooth")
    for version, label in ((2, "SSP 1.0"), (3, "SSP 2.0")):
        path = export_ssp(table1.parts, folder / f"loop{version}.ssp", version=version, step=STEP)  # type: ignore[arg-type]
        yield Export("loop in parts", label, path, [(0.0, {})], loop, ("ssp",))


def environment(tool: str) -> Path | str:
    """Return the Python of a tool's environment, or why there is none."""
    place, packages = HOME / tool, TOOLS[tool][0]
    python, failed = place / "bin" / "python", place / "failed.txt"
    if failed.exists():
        return failed.read_text().strip()
    if not (place / "ready").exists():
        subprocess.run([sys.executable, "-m", "venv", str(place)], check=True)
        pip = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", *packages]
        done = subprocess.run(pip, capture_output=True, text=True, check=False)
        if done.returncode:
            lines = [" ".join(line.split()) for line in done.stderr.splitlines() if "rror: " in line]
            own = [
                line for line in lines if not any(word in line for word in ("subprocess", "wheel", "note:"))
            ]
            failed.write_text(f"pip: {own[0][:200] if own else 'failed'}\n")
            return failed.read_text().strip()
        (place / "ready").touch()
    return python


def version_of(tool: str, python: Path) -> str:
    """Return the installed version of a tool."""
    code = f"import importlib.metadata as m; print(m.version({TOOLS[tool][0][0]!r}))"
    return subprocess.run(
        [str(python), "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()


def run(tool: str, python: Path, export: Export, kind: str) -> float | str:
    """Return a tool's deviation from our own run, or the line in which it failed."""
    task = {
        "fmu": str(export.path), "kind": kind, "steps": export.steps, "outputs": list(export.want),
        "stop": STOP, "step": STEP, "component": "plant",
    }  # fmt: skip
    script = Path(__file__).with_name("interop_importers.py")
    libraries = {"LD_LIBRARY_PATH": str(python.parent.parent / "lib")}
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | libraries
    try:
        done = subprocess.run(
            [str(python), str(script), tool],
            input=json.dumps(task), capture_output=True, text=True, timeout=300, env=clean, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "no answer in 300 s"
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        errors = done.stderr.strip().splitlines()
        return errors[-1][:160] if errors else f"status {done.returncode}"
    found = json.loads(lines[-1])
    if tool == "pyssp-standard":
        return 0.0
    return max(abs(found[k] - v) / max(1.0, abs(v)) for k, v in export.want.items())


def cause(tool: str, export: Export, kind: str) -> str:
    """Return the known cause of a deviation."""
    for key in (export.name, export.version, kind, "*"):
        if (tool, key) in CAUSES:
            return CAUSES[tool, key]
    return "no cause named"


def row(tool: str, export: Export, kind: str, result: float | str) -> tuple[str, ...]:
    """Return a line of the table."""
    words = {"ModelExchange": "Model Exchange", "CoSimulation": "Co-Simulation", "ssp": "system"}[kind]
    head = (tool, export.name, export.version, words)
    if isinstance(result, str):
        return (*head, "does not", f"{cause(tool, export, kind)}: `{result}`")
    # Values between parts are exchanged at steps of 10 ms: that error is the master's.
    bound = NEAR if kind == "ssp" else CLOSE
    if result <= bound:
        return (*head, "works", f"{result:.1e}")
    return (*head, "does not", f"{result:.1e}; {cause(tool, export, kind)}")


def theirs(folder: Path) -> Iterator[tuple[str, ...]]:
    """Yield lines on FMUs of other tools in load and identify: x(n + 1) = x + h (u - k x), k = 1.4."""
    rng, t = np.random.default_rng(7), 0.02 * np.arange(600)
    u, x = np.repeat(rng.uniform(-1.0, 1.0, 20), 30), [1.0]
    for now in u[:-1]:
        y = x[-1]
        for _ in range(2):
            y += 0.01 * (now - 1.4 * y)
        x.append(y)
    seen = np.array(x) + 0.01 * rng.normal(size=t.size)
    logs = [hc.Log("a", t[:300], {"u": u[:300], "x": seen[:300]})]
    logs += [hc.Log("b", t[300:] - t[300], {"u": u[300:], "x": seen[300:]})]
    for package, source in SOURCES.items():
        python = environment(package)
        if isinstance(python, str):
            yield package, "", "", "", "skipped", python
            continue
        place = folder / package
        place.mkdir()
        module = f"decay_{package}.py"  # two FMUs in one process share Python's modules
        (place / module).write_text(source)
        build = [str(python), "-m", package, "build", "-f", module, "-d", "."]
        subprocess.run(build, cwd=place, check=True, capture_output=True)
        head = f"{package} {version_of(package, python)}", "its FMU here", "", "Co-Simulation"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            system = load(place / "Decay.fmu", step=0.01, strict=False)
            y = control.input_output_response(system, 0.01 * np.arange(101), np.ones(101)).outputs
            yield (*head, "works", f"`load`: {abs(float(y[-1]) - 1.0):.1e}")
            plant = hc.fmu_plant(place / "Decay.fmu", ["k"], strict=False)
            k = hc.identify(plant, logs[:1])["k"]
            yield (*head, "works", f"`identify`: k = {k.value:.3f} +- {k.std:.3f} for 1.4")
            plant.close()


def main() -> int:
    """Print the table, write the page; 1 if a cell has no named cause."""
    with tempfile.TemporaryDirectory() as name:
        folder, rows = Path(name), []
        listed = list(exports(folder))
        for tool, (_, kinds) in list(TOOLS.items()):
            python = environment(tool)
            if isinstance(python, str):
                rows.append((tool, "", "", "", "skipped", python))
                print(rows[-1], flush=True)
                continue
            label = f"{tool} {version_of(tool, python)}"
            for export in listed:
                for kind in (k for k in kinds if k in export.kinds):
                    rows.append((label, *row(tool, export, kind, run(tool, python, export, kind))[1:]))
                    print(rows[-1], flush=True)
        for line in theirs(folder):
            rows.append(line)
            print(line, flush=True)
    PAGE.write_text(page(rows), encoding="utf-8")
    return int(any("no cause named" in line[-1] for line in rows))


def page(rows: list[tuple[str, ...]]) -> str:
    """Return the page of the documentation."""
    head = """# Other importers

`make interop` writes this page: each row is a run. The number is the largest deviation at 3 s from our own
run, relative to the value or to 1; an input jumps on the way. Systems exchange values every 10 ms, which is
their error. What our FMUs do at events is [another page](fmu_events.md).

| tool | export | version | kind | | deviation, or why |
|---|---|---|---|---|---|
"""
    return head + "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in rows)


if __name__ == "__main__":
    sys.exit(main())
