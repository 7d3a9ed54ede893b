"""Write FMUs of models/probe.c: the library compiled once, description and archive as a test wants."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

import control as ct
import fmpy
import numpy as np

SOURCE = Path(__file__).parent / "models" / "probe.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"

#: name: value reference, causality, FMI 2 type or None, FMI 3 type, start, further attributes
VARIABLES = {
    "u": (0, "input", "Real", "Float64", "0", 'unit="N"'),
    "mode": (1, "input", "Integer", "Int32", "0", ""),
    "on": (2, "input", "Boolean", "Boolean", "true", ""),
    "v": (3, "input", None, "Float64", "0 0 0", "3"),
    "byte": (6, "input", None, "UInt8", "0", ""),
    "gear": (7, "input", "Enumeration", "Enumeration", "1", 'declaredType="Gear"'),
    "x": (10, "output", "Real", "Float64", None, 'unit="m/s"'),
    "z": (11, "output", "Real", "Float64", None, 'declaredType="Speed"'),
    "steps": (12, "output", "Integer", "Int32", None, ""),
    "echo": (13, "output", "Integer", "Int32", None, ""),
    "off": (14, "output", "Boolean", "Boolean", None, ""),
    "w": (15, "output", None, "Float64", None, "3"),
    "single": (18, "output", None, "Float32", None, ""),
    "sum": (19, "output", "Integer", "Int32", None, ""),
    "k": (20, "parameter", "Real", "Float64", "2", 'unit="1/s"'),
    "gain": (21, "parameter", "Real", "Float64", "0.5", ""),
    "trouble": (22, "parameter", "Integer", "Int32", "0", ""),
    "at": (23, "parameter", "Real", "Float64", "0.3", 'unit="s"'),
    "x0": (24, "parameter", "Real", "Float64", "1", ""),
    "m": (25, "parameter", None, "Float64", "1 2 3 4", "2 2"),
    "stale": (29, "parameter", "Boolean", "Boolean", "false", ""),
    "strict": (30, "parameter", "Boolean", "Boolean", "false", ""),
    "follow": (31, "parameter", "Boolean", "Boolean", "false", ""),
}
TUNABLE = {"gain"}
DEPENDS = {"z": "u", "echo": "mode", "off": "on", "w": "v", "sum": "byte gear"}
TROUBLE = dict(
    error=1, discard=2, crash=3, hang=4, exit=5, fatal=6, end=7, early=8, print=9, not_ready=10, last=11
)  # as in probe.c
DEFAULT = ["u", "x", "z", "k", "gain", "trouble", "at", "x0", "stale", "strict", "follow"]


def compile_probe(compiler: tuple[str, ...], folder: Path, *flags: str) -> Path:
    """Return the probe's shared library; what it does not implement answers fmi2Error or fmi3Error."""
    text = SOURCE.read_text()
    declared = "".join((HEADERS / f"fmi{n}Functions.h").read_text() for n in (2, 3))
    names = re.findall(r"(fmi[23]\w+)TYPE\s+\1;", declared)
    made = [f"{a}{t}" for t in re.findall(r"^ACCESS2\((\w+)", text, re.M) for a in ("fmi2Get", "fmi2Set")]
    made += [f"{a}{t}" for t in re.findall(r"^ACCESS3\((\w+)", text, re.M) for a in ("fmi3Get", "fmi3Set")]
    missing = [name for name in names if f" {name}(" not in text and name not in made]
    stubs = [f"EXPORT int {name}(void);\nEXPORT int {name}(void) {{ return 3; }}" for name in missing]
    source = folder / f"probe{len(flags)}.c"
    source.write_text("\n".join([text, *stubs]) + "\n")
    library = folder / f"probe{len(flags)}{fmpy.sharedLibraryExtension}"
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-missing-field-initializers"]
    subprocess.run(
        [*compiler, *strict, "-O1", "-fPIC", "-shared", f"-I{HEADERS}", *flags, source, "-o", library, "-lm"],
        check=True,
    )
    return library


def description(
    fmi: int = 2,
    names: list[str] | None = None,
    preferred: float | None = 0.1,
    states: bool = True,
    once: bool = False,
    kind: str = "CoSimulation",
    rename: dict[str, str] | None = None,
    extra: str = "",
    attributes: str = "",
) -> str:
    """Return a modelDescription.xml; `names` are the variables it has."""
    names = DEFAULT if names is None else names
    shown = {name: (rename or {}).get(name, name) for name in names}
    rows, outputs = [], []
    for name in names:
        reference, causality, type2, type3, start, more = VARIABLES[name]
        kind_of = type2 if fmi == 2 else type3
        continuous = kind_of in ("Real", "Float64", "Float32") and causality != "parameter"
        variability = "continuous" if continuous else "discrete"
        if causality == "parameter":
            variability = "tunable" if name in TUNABLE else "fixed"
        dimensions = "".join(f'<Dimension start="{n}"/>' for n in more.split()) if more[:1].isdigit() else ""
        typed = "" if dimensions else more
        begin = f' start="{start}"' if start is not None else ""
        common = f'name="{shown[name]}" valueReference="{reference}" causality="{causality}"'
        common += f' variability="{variability}" description="the {name}"'
        if fmi == 2:
            rows.append(f"<ScalarVariable {common}><{kind_of} {typed}{begin}/></ScalarVariable>")
        else:
            rows.append(f"<{kind_of} {common} {typed}{begin}>{dimensions}</{kind_of}>")
        if causality == "output":
            inputs = [n for n in DEPENDS.get(name, "").split() if n in names]
            if fmi == 2:
                depends = " ".join(str(names.index(n) + 1) for n in inputs)
                outputs.append(f'<Unknown index="{names.index(name) + 1}" dependencies="{depends}"/>')
            else:
                depends = " ".join(str(VARIABLES[n][0]) for n in inputs)
                outputs.append(f'<Output valueReference="{reference}" dependencies="{depends}"/>')
    able = f'canGetAndSetFMU{"state" if fmi == 2 else "State"}="{str(states).lower()}"'
    able += f' canBeInstantiatedOnlyOncePerProcess="{str(once).lower()}" {attributes}'
    if fmi == 2:
        able += ' canHandleVariableCommunicationStepSize="true"' if kind == "CoSimulation" else ""
        head = 'fmiVersion="2.0" guid="{probe}"'
        initial = "<InitialUnknowns>" + "".join(outputs) + "</InitialUnknowns>" if outputs else ""
        structure = f"<Outputs>{''.join(outputs)}</Outputs>{initial}" if outputs else ""
        types = (
            '<SimpleType name="Speed"><Real unit="m/s"/></SimpleType><SimpleType name="Gear"><Enumeration>'
            '<Item name="low" value="1"/><Item name="high" value="2"/></Enumeration></SimpleType>'
        )
    else:
        head = 'fmiVersion="3.0" instantiationToken="{probe}"'
        rows.append('<Float64 name="time" valueReference="39" causality="independent"/>')
        initial = [row.replace("<Output", "<InitialUnknown") for row in outputs]
        structure = "".join(outputs + initial)
        types = (
            '<Float64Type name="Speed" unit="m/s"/><EnumerationType name="Gear">'
            '<Item name="low" value="1"/><Item name="high" value="2"/></EnumerationType>'
        )
    experiment = f'<DefaultExperiment stepSize="{preferred}"/>' if preferred else ""
    units = "".join(f'<Unit name="{unit}"/>' for unit in ("N", "m/s", "1/s", "s"))
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription {head} modelName="A probe">'
        f'<{kind} modelIdentifier="probe" {able}/><UnitDefinitions>{units}</UnitDefinitions>'
        f"<TypeDefinitions>{types}</TypeDefinitions>{experiment}"
        f"<ModelVariables>{''.join(rows)}{extra}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>\n"
    )


def binary(fmi: int) -> str:
    """Return the name of this platform's binary inside an FMU."""
    platform = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    return f"binaries/{platform}/probe{fmpy.sharedLibraryExtension}"


def write_fmu(path: Path, library: Path | bytes, fmi: int = 2, **described: object) -> Path:
    """Write an FMU; keywords as for :func:`description`."""
    data = library.read_bytes() if isinstance(library, Path) else library
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description(fmi, **described))
        archive.writestr(binary(fmi), data)
    return path


# --- what it computes ---

STEP = 0.1
T = np.arange(0, 2.05, STEP)
U = np.sin(3 * T) + 0.2
#: x' = -2 x + u, inputs held over a step; z = x + 0.5 u
EXACT = ct.c2d(ct.ss([[-2.0]], [[1.0]], [[1.0], [1.0]], [[0.0], [0.5]]), STEP)


def exact(U=U, x0=1.0):
    return ct.forced_response(EXACT, np.arange(len(U)) * STEP, U, x0).outputs


def controller(name="controller", dt=STEP):
    """Return a PI controller, u = 3 e + w, w += 0.4 e."""
    return ct.nlsys(
        lambda t, x, u, params: x + 0.4 * (u[0] - u[1]),
        lambda t, x, u, params: x + params["controller.gain"] * (u[0] - u[1]),
        inputs=["r", "x"],
        outputs=["u"],
        states=1,
        dt=dt,
        name=name,
        params={"controller.gain": 3.0},
    )
