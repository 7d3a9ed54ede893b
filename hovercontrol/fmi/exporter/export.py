"""Export of a Block as an FMU: one file with Model Exchange and Co-Simulation for several platforms."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from collections.abc import Callable, Iterable, Mapping
from importlib import resources
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder, write_atomically
from hovercontrol.blocks.backends.compiler import cached_text
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.friction import Friction
from hovercontrol.fmi.exporter.binaries import build_binary, chosen_platforms, folder_of
from hovercontrol.fmi.exporter.description import Experiment, model_description, xml_bytes
from hovercontrol.fmi.exporter.documentation import documentation
from hovercontrol.fmi.exporter.package import packed
from hovercontrol.fmi.exporter.sources import Version, fmu_sources, token_of
from hovercontrol.fmi.exporter.terminals import terminals
from hovercontrol.fmi.exporter.variables import Interface

#: Rows of the reference trajectory at most.
_ROWS = 500


@checked
def export_fmu(
    block: Block,
    path: str | Path,
    *,
    version: Version = 3,
    platforms: str | Iterable[str] | None = None,
    friction: Friction = "smooth",
    step: float | None = None,
    stop: float | None = None,
    rtol: float = 1e-6,
    atol: float = 1e-9,
    description: str = "",
    model_name: str = "",
    arrays: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write a Block as an FMU; ``block.to_fmu(path)`` does the same.

    Equal Blocks and arguments give byte-identical files, in any folder and process, with the same compilers.

    Parameters
    ----------
    block : Block
    path : path
        File name with the suffix ``.fmu``.
    version : {2, 3}, optional
        FMI 2.0 or 3.0.
    platforms : str or iterable of str, optional
        Names or ``"all"``, see :data:`hovercontrol.fmi.exporter.binaries.PLATFORMS`; default: this machine's.
    friction : {"smooth", "events"}, optional
        ``"smooth"``: dry friction is smoothed over its width, as in :func:`hovercontrol.simulate` and
        ``block.compile()``. ``"events"``: Coulomb's law, with sticking at exactly zero velocity and events
        for importers; see :data:`hovercontrol.blocks.friction.Friction`.
    step, stop : float, optional
        Communication step and end of the default experiment [s]; default 0.01 and 10.
    rtol, atol : float, optional
        Tolerances of the solver in Co-Simulation; an importer may set another. `atol` is relative to each
        state's nominal size. The default experiment of a Block with ticks has the tolerance `rtol` times
        :data:`FINER`.
    description : str, optional
        What the model is, in a sentence.
    model_name : str, optional
        What tools show as the model's name (default: the Block's name). Files keep the Block's name.
    arrays : bool, optional
        Whether FMI 3 lists vectors and matrices (``P[0,0]``, ``P[0,1]``, ...) as array variables. False:
        every element is a variable, as in FMI 2. CasADi and Ecos take no arrays; FMPy's table of inputs
        takes none beside scalars.
    progress : callable, optional
        Called with the completed fraction, 0 to 1.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If an argument is wrong, the folder cannot be written, or there is no compiler for a platform.

    Examples
    --------
    >>> import tempfile, zipfile
    >>> import hovercontrol as hc
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = export_fmu(hc.circle(1.0), Path(folder) / "circle.fmu")
    ...     "modelDescription.xml" in zipfile.ZipFile(file).namelist()
    True
    """
    target = Path(path)
    if target.suffix != ".fmu":
        raise InputError(f"{path}: expected a file name that ends in .fmu")
    if target.is_dir():
        raise InputError(f"{path}: expected a file to write, found a folder")
    if version not in (2, 3):
        raise InputError(f"FMI version must be 2 or 3, found {version!r}")
    wanted = chosen_platforms(platforms)
    interface = Interface(block, friction, arrays=arrays)
    experiment = _experiment(step, stop, rtol, atol, ticks=bool(interface.block.ticks))
    check_folder(target.parent)
    report = progress or (lambda done: None)
    sources = fmu_sources(interface, version, rtol, atol)
    report(0.1)
    files = {}
    for k, p in enumerate(wanted, 1):
        binary = build_binary(interface.identifier, sources, p)
        files[f"binaries/{folder_of(p, version)}/{interface.identifier}{p.suffix}"] = binary
        report(0.1 + 0.8 * k / len(wanted))
    content = packed(files | _content(interface, version, sources, experiment, atol, description, model_name))
    return write_atomically(target, lambda temporary: temporary.write_bytes(content))


#: Most communication steps of a default experiment.
MOST_STEPS = 1e9


#: By what the tolerance of a Block that ticks is finer for importers: in Model Exchange their solver begins
#: afresh at every tick and errs by its tolerance each time (k06-real-turn, 22 s of ticks of 1 ms: at 1e-6 its
#: place is 3 cm off, at 1e-10 less than 0.1 mm).
FINER = 1e-4


def _experiment(step: float | None, stop: float | None, rtol: float, atol: float, ticks: bool) -> Experiment:
    step, stop = 0.01 if step is None else step, 10.0 if stop is None else stop
    for name, value in (("step", step), ("stop", stop), ("rtol", rtol), ("atol", atol)):
        if not 0 < value < math.inf:
            raise InputError(f"{name} must be positive, found {value!r}")
    if step > stop:
        raise InputError(f"step = {step:g} s is longer than the experiment, {stop:g} s")
    if not stop / step <= MOST_STEPS:
        raise InputError(f"expected {MOST_STEPS:g} steps at most, found step = {step:g} s in {stop:g} s")
    return Experiment(float(stop), float(step), float(rtol) * (FINER if ticks else 1.0))


def _content(
    interface: Interface,
    version: Version,
    sources: dict[str, str],
    experiment: Experiment,
    atol: float,
    text: str,
    model_name: str,
) -> dict[str, bytes]:
    """Return all files of an FMU by path, without its binaries."""
    name, token = interface.identifier, token_of(interface, sources)
    text = text or f"The block {interface.block.name}."
    compiled = [file for file in sources if file.endswith(".c")]
    assets = resources.files("hovercontrol.fmi.exporter") / "assets"
    icon = (assets / "icon.svg").read_text(encoding="utf-8")
    files = {f"sources/{file}": content.encode() for file, content in sources.items()}
    files["modelDescription.xml"] = model_description(
        interface, version, token, experiment, text, compiled, model_name
    )
    trajectory = _reference(interface, token, experiment, atol)
    files |= {f"documentation/{file}": content for file, content in trajectory.items()}
    page = documentation(interface, version, token, experiment, text, icon, trajectory)
    files["documentation/index.html"] = page.encode()
    files["documentation/licenses/license.txt"] = (assets / "license.txt").read_bytes()
    picture = (assets / "icon.png").read_bytes()
    if version == 2:
        return files | {"model.png": picture}
    files["sources/buildDescription.xml"] = _build_description(name, compiled)
    files["terminalsAndIcons/terminalsAndIcons.xml"] = terminals(interface)
    return files | {"terminalsAndIcons/icon.png": picture, "terminalsAndIcons/icon.svg": icon.encode()}


def _build_description(name: str, compiled: Iterable[str]) -> bytes:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=name)
    group = SubElement(configuration, "SourceFileSet", language="C99")
    for file in compiled:
        SubElement(group, "SourceFile", name=file)
    prefix = {"optional": "true", "value": "", "description": "prefix of every FMI function"}
    definition = SubElement(group, "PreprocessorDefinition", {"name": "FMI3_FUNCTION_PREFIX"} | prefix)
    SubElement(definition, "Option", value="", description="in a shared library")
    SubElement(definition, "Option", value=f"{name}_", description="in a static library")
    SubElement(configuration, "Library", name="m", external="true", description="C's mathematics (POSIX)")
    return xml_bytes(root)


def _reference(interface: Interface, token: str, experiment: Experiment, atol: float) -> dict[str, bytes]:
    """Return the reference trajectory and its constant inputs as CSV files."""
    held = {v.name: _typical(v.start or 0.0, v.nominal, v.lower, v.upper) for v in interface.of("input")}
    name = interface.identifier
    key = hashlib.sha256(f"{token} {experiment} {atol} {held}".encode()).hexdigest()[:24]
    made = cached_text(f"{name}-ref-{key}", ".csv", lambda: _simulated(interface, experiment, atol, held))
    files = {f"{name}_ref.csv": made.encode()}
    if held:
        ends = [0.0, experiment.stop]
        files[f"{name}_in.csv"] = _csv({"time": ends} | {k: [u, u] for k, u in held.items()}).encode()
    return files


def _simulated(interface: Interface, experiment: Experiment, atol: float, held: Mapping[str, float]) -> str:
    block = interface.block
    stride = max(1, math.ceil(experiment.stop / experiment.step / _ROWS))
    rows = round(experiment.stop / experiment.step) // stride
    grid = np.arange(rows + 1) * (stride * experiment.step)
    simulate = block.compile(friction=interface.friction).simulate
    inputs = {s.name: np.full(len(grid), u) for s, u in zip(block.inputs, held.values(), strict=True)}
    response = simulate(grid, inputs or None, rtol=experiment.rtol, atol=atol)
    outputs = np.reshape(response.outputs, (len(block.outputs), -1))
    return _csv({"time": grid} | dict(zip((v.name for v in interface.outputs), outputs, strict=True)))


def _typical(start: float, nominal: float, lower: float, upper: float) -> float:
    """Return a value with an effect on the outputs: the start value, else half the nominal size."""
    return min(max(start or 0.5 * nominal, lower), upper)


def _csv(columns: Mapping[str, Iterable[float]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow(f"{value:.9g}" for value in row)  # the last digits differ between processors
    return text.getvalue()
