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
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import control
import numpy as np

import hovercontrol as hc
from benchmarks.coupled import coupled
from benchmarks.monitor import NOISE, motion, watch
from hovercontrol.app.commands.exportable import choose
from hovercontrol.blocks.block import Block
from hovercontrol.fmi import corrected_fmu, export_ssp, load
from tests.fmi.adversary import sled

HOME = Path(os.environ.get("HOVERCONTROL_INTEROP", Path.home() / ".cache" / "hovercontrol-interop"))
PAGE = Path(__file__).parent.parent / "docs" / "concepts" / "interop.md"
#: The stop lies between two ticks of the sampled Blocks; a state is saved at MIDDLE, between two jumps.
STEP, MIDDLE, STOP = 0.01, 0.5, 2.99
#: Largest deviation from our own run, relative to 1 or to the value: a tool's solver has its own tolerance.
CLOSE = 1e-3


@dataclass(frozen=True)
class Tool:
    """Its packages, the kinds of FMU that it takes, and whether it can restart them and save their states."""

    packages: tuple[str, ...]
    kinds: tuple[str, ...] = ("CoSimulation",)
    again: tuple[str, ...] = ()


BOTH, TWICE = ("ModelExchange", "CoSimulation"), ("restart", "saved state")
TOOLS: dict[str, Tool] = {
    "fmpy": Tool(("fmpy",), BOTH, TWICE),
    "pathsim-fmi": Tool(("pathsim-fmi",), BOTH, TWICE[:1]),
    "casadi": Tool(("casadi", "fmpy"), BOTH[:1]),
    "libcosimpy": Tool(("libcosimpy",)),
    "ecospy": Tool(("ecospy", "tbb"), again=TWICE[:1]),
    "fmuloader": Tool(("fmuloader",), again=TWICE),
    "cofmupy": Tool(("cofmupy",)),
    "fmu-manipulation-toolbox": Tool(("fmu-manipulation-toolbox", "fmpy"), again=TWICE[:1]),
    "gemseo-fmu": Tool(("gemseo-fmu",), BOTH, TWICE[:1]),
    "fmugym": Tool(("fmugym",), again=TWICE[:1]),
    "pyssp-standard": Tool(("pyssp-standard",), ()),
    "pythonfmu": Tool(("pythonfmu", "numpy"), ()),
    "pythonfmu3": Tool(("pythonfmu3", "numpy"), ()),
    "mosaik-fmi": Tool(("mosaik-fmi",), ()),
    "PyFMI": Tool(("PyFMI",), ()),
    "OMSimulator": Tool(("omsimulator",), ()),
    "modelica": Tool(("modelica",), ()),
}
ONE_AHEAD = "at time t it gives the outputs at t + step: it steps from t before it records them"
STATELESS = "in Model Exchange it takes no FMU without continuous states"
NO_EVENTS = "it passes no events: modes of friction stay as they were, sampled laws do not tick"
#: Why a cell is as it is, where the cause lies in the tool: by column of a kind, column, version or kind.
CAUSES: dict[tuple[str, str], str] = {
    ("casadi", "plant, events"): NO_EVENTS,
    ("casadi", "hybrid"): NO_EVENTS,
    ("casadi", "sampled"): NO_EVENTS,
    ("casadi", "monitor"): NO_EVENTS,
    ("cofmupy", "*"): ONE_AHEAD,
    ("pathsim-fmi", "CoSimulation"): ONE_AHEAD,
    ("pathsim-fmi", "ModelExchange: restart"): "its reset loses time events of the second run",
    ("pathsim-fmi", "ModelExchange: sampled"): STATELESS,
    ("pathsim-fmi", "ModelExchange: monitor"): STATELESS,
    ("casadi", "corrected"): "it needs dependencies in FMI 3, which a corrected FMU leaves to their default",
    ("libcosimpy", "FMI 3"): "it reads FMI 1 and 2",
    ("libcosimpy", "SSP 2.0"): "it reads FMI 1 and 2",
    ("ecospy", "SSP 2.0"): "it reads SSP 1.0",
    ("gemseo-fmu", "ModelExchange"): "it gives FMPy initialize=False, which FMPy refuses for Model Exchange",
    ("mosaik-fmi", "install"): "its fmipp is built from source and needs SWIG",
    ("PyFMI", "install"): "the package of 2018 is built from source and needs the FMI Library",
    (
        "OMSimulator",
        "install",
    ): "the package downloads its program from its own server, which was not reached",
    ("modelica", "install"): "version 0.0.2 is empty: its modules for FMI 3.0 and SSP 2.0 are announced",
}


@dataclass(frozen=True)
class Export:
    """An FMU or a system of ours, and where its outputs must be at the stop."""

    name: str
    version: str
    path: Path
    steps: list[tuple[float, dict[str, float]]]
    want: dict[str, float]
    again: str = ""
    stop: float = STOP
    step: float = STEP


def reference(
    block: Block, steps: list[Any], outputs: list[str], friction: str, stop: float = STOP
) -> dict[str, float]:
    """Return outputs at the stop of our own run, inputs held between their jumps."""
    run = block.compile(friction=friction).start(inputs=steps[0][1] or None, rtol=1e-10, atol=1e-12)  # type: ignore[arg-type]
    for k, (at, values) in enumerate(steps):
        until = steps[k + 1][0] if k + 1 < len(steps) else stop
        y = run.step(values or None, until - at)
    names = [s.name for s in block.outputs]
    return {name: float(y[names.index(name)]) for name in outputs}


def exports(folder: Path) -> Iterator[Export]:
    """Write each export."""
    thrust = [(0.0, {"thrust": 0.0, "rudder": 0.3}), (0.5, {"thrust": 2.5, "rudder": 0.3})]
    force = [(0.0, {"F": 0.5}), (0.25, {"F": 2.5}), (0.8, {"F": -1.0})]
    blocks: list[tuple[str, Block, str, list[Any], list[str]]] = [
        ("plant, smooth", choose("table1:plant").block, "smooth", thrust, ["x", "psi"]),
        ("plant, events", choose("table1:plant").block, "events", thrust, ["x", "psi"]),
        ("loop", choose("table1").block, "smooth", [(0.0, {})], ["x", "y"]),
        ("hybrid", sled(), "events", force, ["x", "v"]),
        ("sampled", *_sampled()),
        ("monitor", *_monitor()),
    ]
    for name, block, friction, steps, outputs in blocks:
        want = reference(block, steps, outputs, friction)
        for version in (2, 3):
            path = folder / f"{name.replace(', ', '_')}{version}.fmu"
            made = block.to_fmu(path, version=version, friction=friction)  # type: ignore[arg-type]
            plain = Export(name, f"FMI {version}", made, steps, want)
            yield plain
            if name == "hybrid":
                yield from (replace(plain, name=again, again=again) for again in TWICE)
    yield from _corrected(folder, blocks[0][1], thrust)


def _sampled() -> tuple[Block, str, list[Any], list[str]]:
    """Return a PI law with a tick of 20 ms, and its run."""
    e, i, u = hc.Signal("e", "m"), hc.Signal("i", "m*s"), hc.Signal("u", "m/s^2")
    kp, ki, h = (
        hc.Signal("kp", "1/s^2", start=2.0),
        hc.Signal("ki", "1/s^3", start=3.0),
        hc.Signal("h", "s", start=0.02),
    )
    law = Block(
        "law", [i], [e], [u], [kp, ki, h], {"i": i.symbol + h.symbol * e.symbol},
        {"u": kp.symbol * e.symbol + ki.symbol * i.symbol}, period=0.02,
    )  # fmt: skip
    return law, "smooth", [(0.0, {"e": 1.0}), (0.31, {"e": -0.4}), (1.7, {"e": 0.7})], ["u"]


def _monitor() -> tuple[Block, str, list[Any], list[str]]:
    """Return the monitor of a craft, and a log with an offset of the rudder whose rows lie between ticks."""
    log = motion()
    block = watch(log, ["thrust", "rudder_offset"], 1.0, gusts=False)
    rows = np.flatnonzero(log.time < STOP)
    noise = np.random.default_rng(5).normal(size=(len(NOISE), log.time.size))
    values = {k: log[k] + size * noise[n] for n, (k, size) in enumerate(NOISE.items())}
    values |= {"thrust": log["thrust"], "rudder": log["rudder"] + 0.05, "reset": np.zeros(log.time.size)}
    names = [s.name for s in block.inputs]
    times = [max(0.0, round(0.02 * n - STEP, 2)) for n in rows]
    steps = [(t, {k: float(values[k][n]) for k in names}) for t, n in zip(times, rows, strict=True)]
    return block, "smooth", steps, ["evidence_thrust", "evidence_rudder_offset", "unknown_r"]


def _corrected(folder: Path, plant: Block, steps: list[Any]) -> Iterator[Export]:
    """Write the plant's FMUs with a lag before the thrust."""
    slow = hc.Signal("thrust"), hc.Signal("lagged"), hc.Signal("thrust_given"), hc.Signal("T", "s", start=0.2)
    lag = {"lagged": (slow[0].symbol - slow[1].symbol) / slow[3].symbol}
    before = Block(
        "before", [slow[1]], [slow[0]], [slow[2]], [slow[3]], lag, {"thrust_given": slow[1].symbol}
    )
    joined = hc.interconnect([before, hc.rename(plant, {"thrust": "thrust_given"})], "joined")
    want = reference(joined, steps, ["x", "psi"], "smooth")
    for version in (2, 3):
        given = folder / f"plant_smooth{version}.fmu"
        path = corrected_fmu(given, folder / f"corrected{version}.fmu", before=before, kind="ModelExchange")
        yield Export("corrected", f"FMI {version}", path, steps, want)


def environment(tool: str) -> Path | str:
    """Return the Python of a tool's environment, or why there is none."""
    place, packages = HOME / tool, TOOLS[tool].packages
    python, failed = place / "bin" / "python", place / "failed.txt"
    if failed.exists():
        return failed.read_text().strip()
    if not (place / "ready").exists():
        subprocess.run([sys.executable, "-m", "venv", str(place)], check=True)
        pip = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", *packages]
        done = subprocess.run(pip, capture_output=True, text=True, check=False)
        if done.returncode:
            errors = [" ".join(line.split()) for line in done.stderr.splitlines() if "rror: " in line]
            own = [line for line in errors if not any(w in line for w in ("subprocess", "wheel", "note:"))]
            failed.write_text(f"pip: {own[0].split('(')[0][:80] if own else 'failed'}\n")
            return failed.read_text().strip()
        (place / "ready").touch()
    return python


def version_of(tool: str, python: Path) -> str:
    """Return the installed version of a tool."""
    code = f"import importlib.metadata as m; print(m.version({TOOLS[tool].packages[0]!r}))"
    return subprocess.run(
        [str(python), "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()


def called(tool: str, python: Path, task: dict[str, Any], cwd: Path | None = None) -> dict[str, Any] | str:
    """Return the answer of a tool's function of interop_importers.py, or the line in which it failed."""
    script = Path(__file__).with_name("interop_importers.py").absolute()
    libraries = {"LD_LIBRARY_PATH": str(python.parent.parent / "lib")}
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | libraries
    try:
        done = subprocess.run(
            [str(python), str(script), tool], input=json.dumps(task), capture_output=True, text=True,
            timeout=300, env=clean, check=False, cwd=cwd,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "no answer in 300 s"
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        errors = done.stderr.strip().splitlines()
        return errors[-1][:160] if errors else f"status {done.returncode}"
    answer: dict[str, Any] = json.loads(lines[-1])
    return answer


def run(tool: str, python: Path, export: Export, kind: str) -> float | str:
    """Return a tool's deviation from our own run, or the line in which it failed."""
    task = {
        "fmu": str(export.path), "kind": kind, "steps": export.steps, "outputs": list(export.want),
        "stop": export.stop, "step": export.step, "middle": MIDDLE, "again": export.again,
        "component": "plant",
    }  # fmt: skip
    found = called(tool, python, task)
    if isinstance(found, str):
        return found
    return max(abs(found[k] - v) / max(1.0, abs(v)) for k, v in export.want.items())


def cause(tool: str, *keys: str) -> str:
    """Return the known cause of a deviation."""
    return next((CAUSES[tool, key] for key in (*keys, "*") if (tool, key) in CAUSES), NO_CAUSE)


NO_CAUSE = "no cause named"


@dataclass
class Notes:
    """Footnotes, numbered."""

    texts: list[str]

    def mark(self, text: str) -> str:
        if text not in self.texts:
            self.texts.append(text)
        return f"({self.texts.index(text) + 1})"


def matrix(pythons: dict[str, Path], folder: Path, notes: Notes) -> Iterator[list[str]]:
    """Yield the rows of the table of FMUs, first its head."""
    listed = list(exports(folder))
    columns = list(dict.fromkeys(e.name for e in listed))
    yield ["tool", "kind", *columns]
    for tool, python in pythons.items():
        for kind in TOOLS[tool].kinds:
            for version in ("FMI 2", "FMI 3"):
                cells = []
                for export in (
                    e for name in columns for e in listed if (e.name, e.version) == (name, version)
                ):
                    asked = not export.again or export.again in TOOLS[tool].again
                    if not asked or (export.again == "saved state" and kind == "ModelExchange"):
                        cells.append("-")
                        continue
                    found = run(tool, python, export, kind)
                    if isinstance(found, float) and found <= CLOSE:
                        cells.append(f"{found:.0e}")
                        continue
                    why = cause(tool, f"{kind}: {export.name}", export.name, export.version, kind)
                    why += f": `{found}`" if isinstance(found, str) else ""
                    cells.append(f"**{found:.0e}** " if isinstance(found, float) else "**no** ")
                    cells[-1] += notes.mark(why)
                short = {"ModelExchange": "ME", "CoSimulation": "CS"}[kind]
                yield [f"{tool} {version_of(tool, python)}", f"{version}, {short}", *cells]


#: Masters of the four parts of Table I's loop as FMUs: outputs are held over a step.
MASTERS = ("libcosimpy", "ecospy", "cofmupy")
SYSTEM_STEPS, SYSTEM_STOP = (0.01, 0.005, 0.001), 3.0
#: Over these steps a hold's error falls nearly in proportion, with derivatives of the outputs by more.
PROPORTION, SQUARE = (8.0, 12.0), 100.0


def systems(pythons: dict[str, Path], folder: Path, notes: Notes) -> Iterator[list[str]]:
    """Yield the rows of the table of masters: distance of the craft from the whole loop's [mm]."""
    yield ["master", "system", *(f"step {1000 * h:g} ms" for h in SYSTEM_STEPS)]
    table1 = choose("table1")
    want = reference(table1.block, [(0.0, {})], ["x", "y"], "smooth", SYSTEM_STOP)
    for version, label in ((2, "SSP 1.0"), (3, "SSP 2.0")):
        made = [
            export_ssp(
                table1.parts,
                folder / f"loop{version}{len(outputs)}.ssp",
                version=version,  # type: ignore[arg-type]
                step=STEP,
                outputs=outputs,
            )
            for outputs in ((), ("x", "y"))
        ]
        if "pyssp-standard" in pythons:
            name = f"pyssp-standard {version_of('pyssp-standard', pythons['pyssp-standard'])}"
            found = [called("pyssp-standard", pythons["pyssp-standard"], {"fmu": str(path)}) for path in made]
            wrong = [answer for answer in found if isinstance(answer, str)]
            cell = f"**no** {notes.mark(f'{NO_CAUSE}: {wrong[0]}')}" if wrong else "its schemas accept it"
            yield [name, label, cell, "", ""]
        for tool in (t for t in MASTERS if t in pythons):
            export = Export("system", label, made[0], [(0.0, {})], want, stop=SYSTEM_STOP)
            cells = [run(tool, pythons[tool], replace(export, step=h), "ssp") for h in SYSTEM_STEPS]
            yield [f"{tool} {version_of(tool, pythons[tool])}", label, *_held(tool, label, cells, notes)]
        own = []
        for h in SYSTEM_STEPS:
            t = np.arange(round(SYSTEM_STOP / h) + 1) * h
            y = control.input_output_response(load(made[1], step=h), t).outputs[:, -1]
            own.append(float(np.abs(y - np.array(list(want.values()))).max()))
        yield ["hovercontrol's `load`", label, *_held("hovercontrol", label, own, notes)]
    off = []
    for n, h in enumerate(SYSTEM_STEPS):
        (parts := folder / f"parts{n}").mkdir()
        x, y = coupled(parts, True, step=h, end=SYSTEM_STOP)
        off.append(max(abs(x - want["x"]), abs(y - want["y"])))
    mark = "" if off[0] / off[-1] > SQUARE else f" {notes.mark(NO_CAUSE)}"
    yield ["FMPy's calls, derivatives of outputs", "FMI 2", *(f"{1000 * d:.2g}{mark}" for d in off)]


def _held(tool: str, label: str, cells: list[Any], notes: Notes) -> list[str]:
    if any(isinstance(cell, str) for cell in cells):
        return [f"**no** {notes.mark(f'{cause(tool, label)}: `{cell}`')}" for cell in cells]
    proportional = PROPORTION[0] < cells[0] / cells[-1] < PROPORTION[1]
    mark = "" if proportional else f" {notes.mark(cause(tool, label))}"
    return [f"{1000 * cell:.2g}{mark}" for cell in cells]


def main() -> int:
    """Print the tables, write the page; 1 if a cell has no named cause."""
    from benchmarks.interop_theirs import theirs  # it takes this module's environments

    notes, pythons, skipped = Notes([]), {}, [["tool", "why"]]
    for tool in TOOLS:
        python = environment(tool)
        if isinstance(python, Path):
            pythons[tool] = python
        if isinstance(python, str) or ("install" in (k for t, k in CAUSES if t == tool)):
            why = cause(tool, "install")
            skipped.append([tool, why if isinstance(python, Path) else f"{why}: `{python}`"])
    tables = []
    with tempfile.TemporaryDirectory() as name:
        for rows in (
            matrix(pythons, Path(name), notes),
            systems(pythons, Path(name), notes),
            theirs(pythons, Path(name), notes),
        ):
            tables.append([])
            for row in rows:
                print(" | ".join(row), flush=True)
                tables[-1].append(row)
    tables.append(skipped)
    PAGE.write_text(page(tables, notes), encoding="utf-8")
    return int(any(NO_CAUSE in text for text in [*notes.texts, *(why for _, why in skipped)]))


HEADS = (
    """# Other importers

`make interop` writes this page: each number is a run. It is the largest deviation from our own run at 2.99 s,
relative to the value or to 1; inputs jump on the way. A bold number is above 1e-3; the notes say why. ME is
Model Exchange, CS Co-Simulation. A restart is a reset after a whole run; a saved state is restored after a
run to the end, both with the hybrid model. `-`: the tool has no such call. What our FMUs do at events is
[another page](fmu_events.md).
""",
    """
## Four FMUs of a loop

The loop of Table I in its parts (plant, reference, controller, estimator): distance from the whole loop after
3 s [mm]. Masters hold the outputs of a part over a step: the error is proportional to the step. A master that
passes derivatives of the outputs (`benchmarks/coupled.py`) has an error that falls with the square of the
step or faster. libcosim and Ecos refuse connectors of the system itself (`outputs=` of `export_ssp`), so that
their file has none. cofmupy gives the outputs of the next step.
""",
    """
## Other tools' FMUs here

`load` is compared with a closed form or with FMPy. The logs of `identify` and `diagnose` have
k = 1.4 and a bias of 0.2 of the sensor.
""",
    """
## Not run

""",
)


def page(tables: list[list[list[str]]], notes: Notes) -> str:
    """Return the page of the documentation."""
    text = ""
    for head, rows in zip(HEADS, tables, strict=True):
        lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
        text += f"{head}\n" if not head.endswith("\n\n") else head
        text += "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)
        if rows is tables[2]:
            text += "\n## Notes\n\n" + "".join(f"{k + 1}. {note}\n" for k, note in enumerate(notes.texts))
    return text


if __name__ == "__main__":
    sys.exit(main())
