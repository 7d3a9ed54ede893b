"""An FMU with Blocks around it, written as an FMU."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.files import check_folder, write_atomically
from hovercontrol.blocks.block import Block
from hovercontrol.fmi.corrected.description import description
from hovercontrol.fmi.corrected.inner_fmu import InnerFmu
from hovercontrol.fmi.corrected.joined import Joined, joined
from hovercontrol.fmi.corrected.sources import block_sources, table_source, token_of
from hovercontrol.fmi.exporter.binaries import Platform, build_binary, chosen_platforms, folder_of
from hovercontrol.fmi.exporter.package import packed
from hovercontrol.fmi.importer.interface import Kind


@checked
def corrected_fmu(
    given: str | Path,
    out: str | Path,
    *,
    before: Block | None = None,
    after: Block | None = None,
    added: Mapping[str, Block] | None = None,
    kind: Kind | None = None,
    start: Mapping[str, float] | None = None,
    platforms: str | Iterable[str] | None = None,
) -> Path:
    """Write an FMU that has another FMU inside and Blocks around it; it runs without Python.

    With v the inputs as they are given, x the states of the given FMU and y its outputs::

        u = before(v),    x' = f(x, u) + added(x, u),    y_measured = after(y)

    The FMU has the same version of FMI and all variables of the given one, which are passed through, and the
    parameters of the Blocks. Around Model Exchange it has both interfaces, and its Co-Simulation integrates
    both together. Around Co-Simulation it has that interface alone: the given FMU takes its own steps, and
    gets its inputs at the beginning of each and holds them.

    Parameters
    ----------
    given : path
        An FMU of FMI 2.0 or 3.0 with a library for each of `platforms`. It is copied into the new FMU's
        resources.
    out : path
        File name with the suffix ``.fmu``.
    before : Block, optional
        Inputs named like inputs of the FMU, outputs ``NAME_given``: the input NAME as the FMU gets it. Inputs
        may act late, see :class:`hovercontrol.Block`.
    after : Block, optional
        Inputs named like variables of the FMU, outputs ``NAME_measured``: the output NAME as it is measured.
    added : mapping of str to Block, optional
        By the name of a derivative or of its state: a Block with one output, added to the derivative. Its
        inputs are named like variables of the FMU. Model Exchange only.
    kind : {"ModelExchange", "CoSimulation"}, optional
        The interface of the given FMU that is used; default: Model Exchange if it has that. Where the steps
        of its Co-Simulation matter, such as those of a fixed-step solver to which its parameters were
        fitted, "CoSimulation".
    start : mapping of str to float, optional
        New start values, by the names of the FMU's real variables or of the Blocks' parameters.
    platforms : str or iterable of str, optional
        Names as for :func:`~hovercontrol.fmi.export_fmu`; default: this machine's. ``"all"``: those of the
        given FMU.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If a signal is no variable of the FMU, the FMU has no library for a platform, or there is no compiler.

    Notes
    -----
    The corrected FMU gives directional and adjoint derivatives if the given one has Model Exchange and gives
    them, the Blocks read only its inputs, parameters, states, derivatives and outputs, and they do not depend
    on time itself. It gives no derivatives of outputs. Its states can be saved where the given FMU's can.

    Source: FMI 2.0.4 and FMI 3.0.2 (fmi-standard.org).

    Examples
    --------
    A plant whose position sensor is off by 5 cm:

    >>> import tempfile, zipfile
    >>> import hovercontrol as hc
    >>> x, offset = hc.Signal("x", "m"), hc.Signal("x_bias", "m", start=0.05)
    >>> seen = hc.Signal("x_measured", "m")
    >>> sensor = hc.Block("after", inputs=[x], outputs=[seen], parameters=[offset],
    ...                   output_expressions={"x_measured": x.symbol + offset.symbol})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     plant = hc.vehicle("c17_simulation").plant().to_fmu(Path(folder) / "plant.fmu")
    ...     file = corrected_fmu(plant, Path(folder) / "corrected.fmu", after=sensor)
    ...     "resources/inner/modelDescription.xml" in zipfile.ZipFile(file).namelist()
    True
    """
    target = Path(out)
    if target.suffix != ".fmu":
        raise InputError(f"{out}: expected a file name that ends in .fmu")
    if target.is_dir():
        raise InputError(f"{out}: expected a file to write, found a folder")
    check_folder(target.parent)
    inner = InnerFmu(Path(given), kind)
    around = joined(inner, before, after, added or {})
    around, own = _started(inner, around, start or {})
    wanted = _platforms(inner, platforms)
    identifier = f"{inner.identifier}_corrected"[:60]
    sources = block_sources(inner, around, identifier)
    token = token_of(inner, around, own, sources)
    described = description(inner, around, token, own)
    sources["around.c"] = table_source(inner, around, described, token, own)
    files = {"modelDescription.xml": described.xml, **_copied(inner, wanted)}
    for p in wanted:
        binary = build_binary(identifier, sources, p, ("-ldl",))
        files[f"binaries/{folder_of(p, inner.version)}/{identifier}{p.suffix}"] = binary
    content = packed(files)
    return write_atomically(target, lambda temporary: temporary.write_bytes(content))


def _started(inner: InnerFmu, around: Joined, start: Mapping[str, float]) -> tuple[Joined, dict[str, float]]:
    """Return what stands around with new values, and the new start values of the FMU's own variables."""
    keys = {
        around.block.parameter_key(p.name).removeprefix("around."): p.name for p in around.block.parameters
    }
    ours = {keys[n]: float(v) for n, v in start.items() if n in keys}
    own = {n: float(v) for n, v in start.items() if n not in keys}
    for name in own:
        if name not in inner.by_name:
            known = [*keys, *inner.by_name]
            raise InputError(f"start: {inner.path} has no variable {name!r}{did_you_mean(name, known)}")
    inner.starts(own, "start")
    block = around.block.with_values(ours) if ours else around.block
    return Joined(block, around.driven, around.sources, around.n_early, around.measured, around.added), own


def _platforms(inner: InnerFmu, platforms: str | Iterable[str] | None) -> tuple[Platform, ...]:
    has = inner.platforms()
    wanted = chosen_platforms(platforms)
    if platforms == "all":
        wanted = tuple(p for p in wanted if p.name in has)
    for p in wanted:
        if p.name not in has:
            known = f"those it has: {', '.join(has)}" if has else "it has no binary that is known"
            raise InputError(f"{inner.path} has no library for the platform {p.name}; {known}")
    if not wanted:
        raise InputError(f"{inner.path} has no library for a known platform")
    return wanted


def _copied(inner: InnerFmu, wanted: tuple[Platform, ...]) -> dict[str, bytes]:
    """Return the given FMU's files as they lie in the corrected one."""
    files = {"resources/inner/modelDescription.xml": inner.description}
    for p in wanted:
        files |= {f"resources/inner/{n}": data for n, data in inner.binaries(p).items()}
    for name, data in inner.files.items():
        if name.startswith("resources/"):
            files[f"resources/inner/{name}"] = data
        elif name.startswith(("documentation/", "terminalsAndIcons/")) or "/" not in name:
            files[name] = data
    return files
