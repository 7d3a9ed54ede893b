"""``hovercontrol check``: faults of logs, and the coefficients that they excite, before a fit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.base.files import check_folder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hovercontrol.craft.models.blockmodel import BlockModel
    from hovercontrol.craft.models.model import Model
    from hovercontrol.fmi.replay.plant import FmuPlant
    from hovercontrol.logs import Log

#: Stamps that a clock moved by so much [s] still belong to a log.
EDGE = 0.05

EXAMPLE = "Example: hovercontrol check a.csv b.csv --model craft.toml --out out/check"


def check(
    logs: options.Logs = None,
    out: options.Out = None,
    model: options.ModelFile = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            help="A built-in craft instead of --model; without either, no trial fit is made.",
            autocompletion=names.vehicles,
        ),
    ] = None,
    params: options.Params = None,
    fit: options.Fit = "",
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
    """Check logs before a fit: timing, noise, outliers, units, excitation.

    Reports for each log its rate, gaps, jitter and clock; for each column range, noise, resolution and
    outliers; with a model also whether units, signs and clocks agree with it and which
    coefficients a fit could estimate. Of an FMU (--model plant.fmu) these are the parameters
    that --fit names, or all that are real numbers. Writes check.txt, check.json, check.png and check.svg.

    Exit status 1 if a log cannot be used as it is, or a coefficient cannot be estimated.
    """
    from hovercontrol.identification.check import check as find

    if not logs:
        raise InputError("check: expected one or more logs")
    out = out or Path("out") / "check"
    check_folder(out)
    options.refuse_twice("check", logs)
    if params and not (model or vehicle):
        raise InputError("check: --params belongs to a model; expected --model or --vehicle as well")
    plant = options.fmu_of("check", model, fit, params)
    known = options.model_of("check", model, vehicle, params) if (model or vehicle) and not plant else None
    subject = plant or known
    if not columns and (topics := topics_of(logs, subject, model, vehicle)):
        print(topics)
        return 1
    read = options.reader(
        subject, columns, period, bench, bench_fans, only_while, settle, frame, missing=missing, trial=trial
    )
    with options.progress_bar("check", 1.0) as report:
        report(0.0, "reading logs")
        every, unread = _read(logs, read)
        found = find(
            subject,
            list(every.values()),
            fixed=options.listed(fixed, "--fixed") or [],
            files=[stamps(name, log, columns, period) for name, log in every.items()],
            unread=unread,
            progress=lambda part, what: report(0.05 + 0.9 * part, what),
        )
        report(0.95, "drawing")
        files = found.save(out)
    options.show(found.text(), files, out, found.to_json() if json else None)
    return 1 if found.negative else 0


def _read(names: list[str], read: Callable[[str], Log]) -> tuple[dict[str, Log], list[str]]:
    """Return the logs by name, and what is wrong with those that cannot be read: it was asked for."""
    from hovercontrol.logs.gather import split_files

    found, unread = {}, []
    wrong: ArgumentError | None = None
    for name in names:
        try:
            found[name] = read(name)
        except InputError as error:
            if not all(path.is_file() for path in split_files(name)):
                raise
            unread.append(str(error))
            wrong = error if isinstance(error, ArgumentError) else wrong
    if wrong and not found:  # an option that fits none of the logs is at fault, not they
        raise wrong
    return found, unread


def topics_of(
    logs: list[str], known: Model | BlockModel | FmuPlant | None, model: str | None, vehicle: str | None
) -> str:
    """Return the topics of files that hold several, and proposals of ``--columns``; empty for others."""
    from hovercontrol.logs.gather import split_files
    from hovercontrol.logs.overview import overview
    from hovercontrol.logs.required_columns import RequiredColumns

    wanted = RequiredColumns.of(options.readable_model(known), motion=known is None)
    of_model = f" --model {model}" if model else f" --vehicle {vehicle}" if vehicle else ""
    paths = dict.fromkeys(path for name in logs for path in split_files(name))
    return "\n".join(text for path in paths if path.exists() and (text := overview(path, wanted, of_model)))


def stamps(files: str, log: Log, columns: str, period: float | None = None) -> dict[str, NDArray[np.float64]]:
    """Return the time stamps of a log's files [s] as in the file, within the time of the log."""
    from hovercontrol.logs.gather import columns_by_file, split_files
    from hovercontrol.logs.join import measured_rows
    from hovercontrol.logs.read import read_log

    paths = split_files(files)
    if len(paths) == 1:  # its rows are those of the log, less those of commands of another topic
        return {} if log.trials else {paths[0].name: log.time[measured_rows(log)]}
    found = {}
    for path, own in zip(paths, columns_by_file(paths, options.pairs(columns)), strict=True):
        time = read_log(path, own, usecols=[], period=period).on_clock_of(log).time
        found[path.name] = time[(time >= log.time[0] - EDGE) & (time <= log.time[-1] + EDGE)]
    return {name: time for name, time in found.items() if time.size}
