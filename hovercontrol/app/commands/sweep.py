"""``hovercontrol sweep``: run a scenario over a range of its parameters."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.app.commands.options import Out
from hovercontrol.base import file_list, files
from hovercontrol.base.errors import InputError, shown
from hovercontrol.base.files import check_folder, make_folder
from hovercontrol.base.folders import own_folder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hovercontrol.documents.scenarios.grid import GridResult
    from hovercontrol.logs import Log

#: Files of a checkpoint, of :mod:`hovercontrol.blocks.backends.checkpoint`.
RUNS = "runs-*.parquet"

EXAMPLE = "Example: hovercontrol sweep k06-turn --vary controller.k2=0.5:6:200 --of r --figure final"


def sweep(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A scenario's name or file; a model file; FILE.py:NAME of a Model, BlockModel or Block; "
            "an FMU, FILE.fmu.",
            autocompletion=names.scenarios,
        ),
    ] = "",
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=FROM:TO:POINTS",
            help="Parameter or start value to vary; give it twice for a map.",
        ),
    ] = None,
    of: Annotated[
        str,
        typer.Option("--of", help="Signal to evaluate (default: error_x, u, or a Block's first output)."),
    ] = "",
    figure: Annotated[
        str,
        typer.Option(
            "--figure",
            help="Figure of the signal in the last phase: final, maximum, minimum, rms or settling.",
            autocompletion=names.of("final", "maximum", "minimum", "rms", "settling"),
        ),
    ] = "rms",
    model: options.Runs = None,
    commands: options.Commands = "",
    columns: options.Columns = "",
    period: options.Period = None,
    params: options.Params = None,
    out: Out = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted sweep from OUT.partial.")
    ] = False,
    json: options.Json = False,
) -> int:
    """Run a scenario at every point of a range or a grid; write a table and a picture.

    A model file or a model of your own starts from rest, an FMU (--model plant.fmu) from its start values.
    Steps of the commands drive it, or the commands of a log. --vary takes parameters of an FMU and, for
    Model Exchange, its initial states.

    Results are kept in OUT.partial as they are computed: --resume continues a stopped sweep.

    Exit status 1 if some runs fail; the others are written.
    """
    import numpy as np

    ranges: dict[str, NDArray[np.float64]] = {}
    for text in vary or []:
        key, values = _range(text)
        if key in ranges:
            raise InputError(f"sweep: --vary {key} is given twice")
        ranges[key] = values
    if not ranges:
        raise InputError("sweep: expected one or two --vary KEY=FROM:TO:POINTS")
    name, run = _scenario_or_machine(
        options.run_of("sweep", scenario, model),
        options.commands_of("sweep", commands, columns, period),
        params,
    )
    out = out or Path("out") / f"{name}-sweep"
    partial = _partial_folder(out)
    if file_list.refuse_others(partial) and not resume:
        file_list.remove_own(partial, RUNS)
    with _kept(partial), options.progress_bar(f"sweep {name}", 1.0) as report:
        found = run(ranges, of, figure, progress=lambda done: report(done), checkpoint=partial)
        saved = found.save(out)
    values = found.values.ravel()
    if json:
        axes = [{"key": a.name, "unit": a.unit, "values": a.values} for a in found.axes]
        failed = [str(f) for f in found.result.failures]
        content = {"of": found.of, "figure": figure, "unit": found.unit, "axes": axes, "values": found.values}
        options.show("", saved, out, {"scenario": name, **content, "failures": failed})
        return 1 if failed else 0
    if np.isfinite(values).any():
        for word, k in (("smallest", np.nanargmin(values)), ("largest", np.nanargmax(values))):
            at = np.unravel_index(k, found.values.shape)
            where = ", ".join(
                f"{axis.name} = {axis.values[i]:.4g} {axis.unit}"
                for axis, i in zip(found.axes, at, strict=True)
            )
            print(f"{word} {figure} of {found.of}: {values[k]:.4g} {found.unit} at {where}")
    failures = found.result.failures
    if failures:
        print(f"{len(failures)} of {len(values)} runs fail; the first: {failures[0]}")
    print(f"wrote {', '.join(f.name for f in saved)} to {out}")
    return 1 if failures else 0


def _scenario_or_machine(
    scenario: str, log: Log | None, params: Path | None
) -> tuple[str, Callable[..., GridResult]]:
    """Return the name of what is run, and a function that runs it over ranges."""
    from hovercontrol.blocks.block import Block
    from hovercontrol.craft.models.model import Model
    from hovercontrol.documents.scenarios import load_scenario
    from hovercontrol.documents.scenarios.drive import driven
    from hovercontrol.documents.scenarios.grid import vary, vary_machine

    if not scenario:
        raise InputError(
            "sweep: expected a scenario's name (hovercontrol simulate --list shows them) or file"
        )
    plant = options.fmu_of("sweep", scenario, "", params)
    if plant is not None:
        from hovercontrol.documents.scenarios.fmu_sweep import vary_fmu

        return plant.name, functools.partial(vary_fmu, plant, commands=log)
    own = options.from_users_file(scenario, params)
    if own is None and params:
        raise InputError(f"sweep: --params belongs to a model FILE.py:NAME, found {scenario}")
    if own is None:
        loaded = load_scenario(scenario, commands=log)
        return loaded.name, functools.partial(vary, loaded)
    if isinstance(own, Model):
        loaded = replace(driven(own, own.name, log=log), file=scenario)
        return loaded.name, functools.partial(vary, loaded)
    block = own if isinstance(own, Block) else own.plant()
    return block.name, functools.partial(vary_machine, block, commands=log)


def _partial_folder(out: Path) -> Path:
    """Return the folder for results until the sweep ends, next to the folder of the results."""
    check_folder(out)
    whole = out.resolve()
    if not whole.name:
        raise InputError(f"--out: expected a folder with a name, found {whole}")
    return whole.with_name(f"{whole.name}.partial")


@contextmanager
def _kept(partial: Path) -> Iterator[None]:
    """Keep the partial results of a sweep only while it can be resumed."""
    with make_folder(partial.parent):
        own_folder(partial)
        try:
            yield
        except (InputError, KeyboardInterrupt) as error:
            if not any(partial.glob(f"*/{RUNS}")):
                file_list.remove_own(partial, RUNS)
            elif isinstance(error, KeyboardInterrupt):
                files.kept[:] = [f"{partial.name}; continue with --resume"]
            raise
        file_list.remove_own(partial, RUNS)


def _range(text: str) -> tuple[str, NDArray[np.float64]]:
    key, equals, rest = text.partition("=")
    parts = rest.split(":")
    try:
        low, high, points = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        low = high = math.nan
        points = 0
    if not (key and equals and len(parts) == 3 and points):
        raise InputError(f"--vary: expected KEY=FROM:TO:POINTS, found {shown(text)}")
    from hovercontrol.control.analysis.regions import axis
    from hovercontrol.documents.scenarios.grid import MAX_RUNS

    if points > MAX_RUNS:
        raise InputError(f"--vary {key}: expected {MAX_RUNS} points at most, found {points:.4g}")
    return key, axis(f"--vary {key}", "", (low, high), points).values
