"""``hovercontrol fleet``: the logs of many craft, and what differs between them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base import files
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder

EXAMPLE = "Example: hovercontrol fleet logs/ --by folder --model craft.toml --out out/fleet"


def fleet(
    logs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LOGS",
            help="Files, folders, patterns, or addresses that fsspec knows (s3://bucket/logs); formats as "
            "for identify.",
        ),
    ] = None,
    out: options.Out = None,
    model: Annotated[
        str | None,
        typer.Option("--model", help="Model file (TOML), or FILE.py:NAME of a Model, BlockModel or Block."),
    ] = None,
    vehicle: options.Vehicle = None,
    params: options.Params = None,
    by: Annotated[
        str,
        typer.Option(
            "--by",
            metavar="folder|COLUMN|REGEX",
            help="Where the name of a log's craft is: its folder, a column, or a regular expression "
            r"with a group that matches its address: 'boat(\d+)'; '([^/]+)[.]' takes each file as a craft.",
            autocompletion=names.of("folder"),
        ),
    ] = "folder",
    on: Annotated[
        str, typer.Option("--on", metavar="ADDRESS", help="Dask scheduler that runs it: tcp://host:8786")
    ] = "",
    workers: Annotated[
        int | None,
        typer.Option(
            help="Processes on this machine (default: one for each processor if Dask is installed, else 1).",
            min=1,
        ),
    ] = None,
    every: Annotated[
        bool,
        typer.Option(
            "--every",
            help="Diagnose every log and replay it through the monitor, too (default: diagnose the craft "
            "that need it).",
        ),
    ] = False,
    fixed: options.Fixed = "",
    columns: options.Columns = "",
    period: options.Period = None,
    bench: options.Bench = None,
    bench_fans: options.BenchFans = 2,
    only_while: options.OnlyWhile = "",
    settle: options.Settle = 1.0,
    frame: options.Frame = "",
    missing: options.Missing = "",
    trial: options.TrialColumn = "",
    json: options.Json = False,
) -> int:
    """Check and identify the logs of many craft; report which craft, days and equations differ.

    An effect that most logs of most craft show is added to the model; one that a single craft shows is
    reported for that craft. Coefficients are compared between craft and over time. The date of a log is
    taken from its name (2026-11-28), else from its clock.

    Writes report.html, fleet.parquet (a row for each log and coefficient; of a log that cannot be used, the
    reason), craft.parquet, fleet.json and the amended model. Each result is kept in OUT/done: the same
    command continues a stopped run, and computes only new logs.

    Exit status 1 if there is a finding, or a log cannot be used.
    """
    if on and workers is not None:
        raise InputError("fleet: --on and --workers exclude each other")
    if model and model.endswith(".fmu"):
        raise InputError(f"fleet: --model {model}: expected a model file or FILE.py:NAME, found an FMU")
    out = out or Path("out") / "fleet"
    check_folder(out)
    found_model = options.model_of("fleet", model, vehicle, params)
    read = options.reader(
        found_model,
        columns,
        period,
        bench,
        bench_fans,
        only_while,
        settle,
        frame,
        missing=missing,
        trial=trial,
    )
    from hovercontrol.identification.fleet import fleet as run

    files.kept[:] = [f"{out / 'done'}; the same command goes on from there"]
    with options.progress_bar("fleet", 1.0) as report:
        found = run(
            found_model,
            logs or [],
            by=by,
            read=read,
            fixed=options.listed(fixed, "--fixed") or [],
            workers=workers,
            on=on,
            every=every,
            out=out,
            progress=report,
        )
        written = found.save(out)
    used = len(found.results) - len(found.refused)
    spent = f"processor time {found.seconds:.0f} s, {found.seconds / max(used, 1):.2f} s a log"
    options.show(f"{found.text()}\n{spent}", written, out, found.to_json() if json else None)
    return 1 if found.negative else 0
