"""``hovercontrol monitor``: what has changed in a craft, along a log or while it grows."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder

if TYPE_CHECKING:
    from hovercontrol.identification.monitor.build import Built

EXAMPLE = "Example: hovercontrol monitor today.csv --reference good.csv --model craft.toml --out out/monitor"


def monitor(
    log: Annotated[
        str | None,
        typer.Argument(
            metavar="LOG",
            help=f"{options.FORMATS} With --follow a growing CSV file, or - for standard input.",
        ),
    ] = None,
    out: options.Out = None,
    model: options.ModelFile = None,
    vehicle: options.Vehicle = None,
    params: options.Params = None,
    sound: Annotated[
        str | None,
        typer.Option(
            "--reference",
            help="Reference log without faults, for coefficients and noise (default: the model as it is, "
            "and the noise of the first part of LOG).",
        ),
    ] = None,
    candidates: Annotated[
        str,
        typer.Option(
            help="Changes to look for, separated by commas: effects, coefficients of the model, NAME_bias of "
            "a measured channel (default: a Block's parameters or a craft's linear coefficients, biases).",
            autocompletion=names.effects,
        ),
    ] = "",
    measured: Annotated[
        str,
        typer.Option(
            help="Measured channels, separated by commas (default: the pose of a craft, else all in the log)."
        ),
    ] = "",
    false_alarms_per_hour: Annotated[
        float, typer.Option("--false-alarms-per-hour", help="Wanted rate of false alarms.")
    ] = 0.1,
    hold: Annotated[
        float | None,
        typer.Option(
            help="Seconds after an alarm in which evidence is collected (default: 5; for a machine that is "
            "not a craft 50 to 1000 periods)."
        ),
    ] = None,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow",
            help="Read LOG line by line while it grows; each alarm and each fault of the rows is one JSON "
            "line ('hovercontrol schema monitor_event'). Needs --reference. Ends with standard input, or by "
            "Ctrl-C.",
        ),
    ] = False,
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
    """Detect what changes in a craft along a log: name, size, onset and alternatives.

    A Kalman filter runs along the log, and its innovations are tested for each candidate. The threshold
    follows from the rate of false alarms. Lost samples raise no alarm; a dead sensor is reported.

    With --out it writes result.json, timeline.csv, timeline.png and timeline.svg.

    Exit status 0 if nothing changed, 1 after an alarm.
    """
    if log is None:
        raise InputError("monitor: expected a log, or - with --follow for standard input")
    if out is not None:
        check_folder(out)
    _check_follow(log, sound, follow, any((out, json, frame, bench, only_while, trial, period)))
    if hold is not None and not hold > 0.0:
        raise InputError(f"monitor: --hold: expected a positive time in seconds, found {hold:g}")
    if not false_alarms_per_hour > 0.0:
        raise InputError(
            f"monitor: --false-alarms-per-hour: expected a positive number, found {false_alarms_per_hour:g}"
        )
    wanted, channels = options.listed(candidates, "--candidates"), options.listed(measured, "--measured")
    craft = options.model_of("monitor", model, vehicle, params)
    read = options.reader(
        craft, columns, period, bench, bench_fans, only_while, settle, frame, missing=missing, trial=trial
    )
    if follow and log != "-" and not Path(log).is_file():
        raise InputError(f"monitor: {log}: no such file")
    options.refuse_twice("monitor", [name for name in (log, sound) if name not in (None, "-")])

    from hovercontrol.identification.monitor.build import build
    from hovercontrol.identification.monitor.replay import replay

    with options.progress_bar("monitor", 1.0) as report:
        report(0.0, "reading logs")
        train = read(sound) if sound else None
        run = train if follow and train is not None else read(log)
        built = build(
            craft,
            run,
            train=train,
            candidates=wanted,
            measured=channels,
            false_alarms_per_hour=false_alarms_per_hour,
            progress=lambda part, what: report(0.05 + 0.65 * part, what),
        )
        if not follow:
            found = replay(
                built.block,
                run,
                hold=hold,
                notes=built.notes,
                progress=lambda part, what: report(0.7 + 0.25 * part, what),
            )
            files = found.save(out) if out is not None else []
    if follow:
        return _follow(built, log, columns, hold, options.numbers(missing, "--missing"))
    if files or json:
        options.show(found.text(), files, out or Path(), found.to_json() if json else None)
    else:
        print(found.text())
    return 1 if found.alarms else 0


def _check_follow(log: str, sound: str | None, follow: bool, others: bool) -> None:
    """Raise if --follow lacks an option, or is given beside one that it does not have."""
    if not follow and log == "-":
        raise InputError("monitor: - is standard input: add --follow")
    if follow and others:
        raise InputError(
            "monitor: --follow prints JSON lines: no --out, --json, --frame, --bench, --while, --trial or "
            "--period"
        )
    if follow and sound is None:
        raise InputError(
            "monitor: --follow needs --reference LOG, a log without faults, for noise and period"
        )


def _follow(built: Built, log: str, columns: str, hold: float | None, missing: list[float]) -> int:
    """Print the events of a growing table; return 1 after an alarm."""
    from hovercontrol.identification.monitor.follow import follow, json_line
    from hovercontrol.identification.monitor.lines import growing_lines, lines_of

    for note in built.notes:
        print(note, file=sys.stderr)
    lines = lines_of(sys.stdin) if log == "-" else growing_lines(Path(log))
    source = "standard input" if log == "-" else log
    alarms = 0
    for event in follow(
        built.block,
        lines,
        options.pairs(columns),
        source,
        hold,
        missing=missing,
        sizes=built.sizes,
        step=built.step,
    ):
        print(json_line(event), flush=True)
        alarms = event.get("alarms", alarms)
    return 1 if alarms else 0
