"""``hovercontrol diagnose``: find what a model lacks."""

from __future__ import annotations

import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder
from hovercontrol.base.folders import write_folder

EXAMPLE = "Example: hovercontrol diagnose a.csv b.csv --holdout c.csv --model craft.toml --out out/diagnose"


def diagnose(
    logs: options.Logs = None,
    out: options.Out = None,
    model: options.ModelFile = None,
    vehicle: options.Vehicle = None,
    params: options.Params = None,
    fit: options.Fit = "",
    laws_in: options.LawsIn = "",
    holdout: options.Holdout = None,
    effects: Annotated[
        str,
        typer.Option(
            help="Candidate effects, separated by commas (default: all).", autocompletion=names.effects
        ),
    ] = "",
    fixed: options.Fixed = "",
    max_effects: Annotated[
        int, typer.Option(help="Largest number of effects to add to the model.", min=1)
    ] = 3,
    seed: Annotated[
        int,
        typer.Option(help="Seed of the random manoeuvres for the next experiment.", min=0),
    ] = 0,
    columns: options.Columns = "",
    period: options.Period = None,
    bench: options.Bench = None,
    bench_fans: options.BenchFans = 2,
    only_while: options.OnlyWhile = "",
    settle: options.Settle = 1.0,
    frame: options.Frame = "",
    missing: options.Missing = "",
    trial: options.TrialColumn = "",
    allow_gaps: options.AllowGaps = False,
    json: options.Json = False,
) -> int:
    """Find which effects a model lacks, how much error each explains, and what remains.

    An effect is named if it raises the likelihood enough and no held-out log is predicted worse. If something
    else remains, its coefficient must also agree between segments of the logs.

    Verdicts: none (nothing is missing beyond noise), effect (named, nothing
    remains), partial (named, and something remains), ambiguous (one of
    several effects), unexplained (none can be named; the nearest are listed).

    Writes report.html (for any browser), result.json and the amended model:
    model.toml of a craft, parameters.toml of a Block of your own (for
    --params). Where another log would show more, next_experiment.csv holds
    the commands to apply.

    Exit status 0 for none and effect; 1 for partial, ambiguous, unexplained.
    """
    from hovercontrol.craft.models.parameters import FITTED
    from hovercontrol.identification.diagnose import diagnose as find
    from hovercontrol.identification.diagnose.report import write_report

    if not logs:
        raise InputError("diagnose: expected one or more logs")
    out = out or Path("out") / "diagnose"
    check_folder(out)
    held = holdout or []
    options.refuse_twice("diagnose", logs, held)
    plant = options.fmu_of("diagnose", model, fit, params, laws_in)
    kept = options.listed(fixed, "--fixed") or []
    if plant is not None:
        plant = replace(plant, fit=tuple(name for name in plant.fit if name not in kept))
        from hovercontrol.identification.diagnose.fmu import diagnose_fmu

        read = options.reader(
            plant, columns, period, bench, bench_fans, only_while, settle, missing=missing, trial=trial
        )
        with options.progress_bar("diagnose", 1.0) as report:
            logs_, held_ = ([read(name) for name in group] for group in (logs, held))
            wanted = options.listed(effects, "--effects")
            lacking = diagnose_fmu(plant, logs_, held_, wanted, max_effects, report)
            files = lacking.save(out)
        options.show("\n".join(lacking.sentences()), files, out, lacking.result() if json else None)
        return 0 if lacking.verdict in ("none", "effect") else 1
    lacks = options.model_of("diagnose", model, vehicle, params)
    names = options.listed(effects, "--effects")
    for name in names or []:
        lacks.effect_class(name)
        if names and names.count(name) > 1:
            raise InputError(f"diagnose: --effects: {name!r} is given twice")
    read = options.reader(
        lacks, columns, period, bench, bench_fans, only_while, settle, frame, missing=missing, trial=trial
    )
    with options.progress_bar("diagnose", 1.0) as report:
        report(0.0, "reading logs")
        found = find(
            lacks,
            [read(name) for name in logs],
            [read(name) for name in held],
            fixed=kept,
            names=names,
            max_effects=max_effects,
            seed=seed,
            progress=lambda part, what: report(0.02 + 0.95 * part, what),
        )
        report(0.97, "writing the report")

        def write(folder: Path) -> None:
            found.save(folder)
            write_report(found, folder / "report.html", command=_command())

        files = write_folder(out, write, stale=(*FITTED, "next_experiment.csv"))
    for warning in found.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    options.show("\n".join(found.sentences()), files, out, found.result() if json else None)
    return 0 if found.verdict in ("none", "effect") else 1


def _command() -> str:
    """Return the command line with file names only: the page does not reveal paths of the machine."""
    words = [word.partition("=") for word in sys.argv[1:]]
    bare = [f"{_name(a)}{sign}{_name(b)}" for a, sign, b in words]
    return shlex.join(["hovercontrol", *bare])


def _name(text: str) -> str:
    return "+".join(Path(part).name if Path(part).is_absolute() else part for part in text.split("+"))
