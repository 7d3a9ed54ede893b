"""``hovercontrol experiment``: the experiment that settles a diagnosis."""

from __future__ import annotations

import json as json_
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder
from hovercontrol.base.folders import write_folder

EXAMPLE = (
    "Example: hovercontrol experiment a.csv --model craft.toml --within x=-2:2,u=0:1.5 --out out/campaign"
)

#: Logs of earlier calls, and what they gave.
MEMORY = "experiment.json"


def experiment(
    logs: options.Logs = None,
    out: options.Out = None,
    model: options.ModelFile = None,
    vehicle: options.Vehicle = None,
    params: options.Params = None,
    holdout: options.Holdout = None,
    effects: Annotated[
        str,
        typer.Option(
            help="Candidate effects, separated by commas (default: all).", autocompletion=names.effects
        ),
    ] = "",
    fixed: options.Fixed = "",
    within: Annotated[
        str,
        typer.Option(help="Ranges that channels must not leave: NAME=LOW:HIGH, separated by commas."),
    ] = "",
    seed: Annotated[int, typer.Option(help="Seed of the random manoeuvres.", min=0)] = 0,
    columns: options.Columns = "",
    period: options.Period = None,
    only_while: options.OnlyWhile = "",
    settle: options.Settle = 1.0,
    frame: options.Frame = "",
    missing: options.Missing = "",
    trial: options.TrialColumn = "",
    json: options.Json = False,
) -> int:
    """Propose the experiment that settles a diagnosis, with the probability that it does.

    Diagnoses the logs as diagnose does. Where they do not tell effects apart, or forms of an unknown
    function, next_experiment.csv holds the commands of the shortest manoeuvre in which these differ enough.
    Where something without a name remains, it holds those of the manoeuvre that shows most of it.

    Run the experiment and give its log to the same command with the same --out; earlier logs are used too.
    Repeat until no further experiment is proposed.

    Writes result.json, the amended model and experiment.json, the memory of the logs.

    Exit status 0 if no further experiment is proposed; 1 if one is.
    """
    from hovercontrol.craft.models.parameters import FITTED
    from hovercontrol.identification.diagnose.experiment.campaign import experiment as find

    out = out or Path("out") / "experiment"
    check_folder(out)
    every, held = [*_remembered(out), *(logs or [])], holdout or []
    if not every:
        raise InputError("experiment: expected one or more logs")
    options.refuse_twice("experiment", every, held)
    lacks = options.model_of("experiment", model, vehicle, params)
    read = options.reader(
        lacks, columns, period, None, 2, only_while, settle, frame, missing=missing, trial=trial
    )
    with options.progress_bar("experiment", 1.0) as report:
        report(0.0, "reading logs")
        found = find(
            lacks,
            [read(name) for name in every],
            [read(name) for name in held],
            within=_ranges(within),
            fixed=options.listed(fixed, "--fixed") or [],
            names=options.listed(effects, "--effects"),
            seed=seed + len(every),
            progress=lambda part, what: report(0.02 + 0.95 * part, what),
        )
        d = found.diagnosis
        memory = {
            "logs": [_absolute(name) for name in every],
            "verdict": d.verdict,
            "next": d.advice,
            "sure": found.next.sure if found.next else None,
        }

        def write(folder: Path) -> None:
            d.save(folder)
            (folder / MEMORY).write_text(json_.dumps(memory, indent=2) + "\n", encoding="utf-8")

        files = write_folder(out, write, stale=(*FITTED, "next_experiment.csv"))
    for warning in d.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    said = d.advice or "No further experiment is needed."
    options.show("\n".join([*d.sentences(), said]), files, out, d.result() if json else None)
    return 1 if found.next else 0


def _remembered(out: Path) -> list[str]:
    """Return the logs of earlier calls with the same folder."""
    path = out / MEMORY
    if not path.is_file():
        return []
    try:
        content: Any = json_.loads(path.read_text(encoding="utf-8"))
        found = [str(name) for name in content["logs"]]
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{path}: expected the logs of earlier calls; remove it to begin anew") from None
    from hovercontrol.logs.gather import split_files

    for name in (part for one in found for part in split_files(one)):
        if not Path(name).exists():
            raise InputError(
                f"{path}: the log {name} of an earlier call is gone; remove {path} to begin anew"
            )
    return found


def _absolute(name: str) -> str:
    """Return a log's name with absolute paths, of all files of which it consists."""
    from hovercontrol.logs.gather import split_files

    return "+".join(str(Path(part).resolve()) for part in split_files(name))


def _ranges(text: str) -> dict[str, tuple[float, float]]:
    found = {}
    for part in options.listed(text, "--within") or []:
        name, _, limits = part.partition("=")
        low, _, high = limits.partition(":")
        try:
            found[name.strip()] = float(low), float(high)
        except ValueError:
            raise InputError(f"--within: expected NAME=LOW:HIGH, found {part!r}") from None
    return found
