"""``hovercontrol identify``: estimate a model's coefficients from logs."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hovercontrol.app.commands import options
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder

if TYPE_CHECKING:
    from hovercontrol.fmi.replay.plant import FmuPlant
    from hovercontrol.identification.identify.study import Study
    from hovercontrol.logs import Log

EXAMPLE = "Example: hovercontrol identify a.csv b.csv --holdout c.csv --model craft.toml --out out/identify"


def identify(
    logs: options.Logs = None,
    out: options.Out = None,
    model: options.ModelFile = None,
    vehicle: options.Vehicle = None,
    params: options.Params = None,
    fit: options.Fit = "",
    holdout: options.Holdout = None,
    coefficients: Annotated[
        str,
        typer.Option(
            help="Coefficients to fit, separated by commas; the others keep their values (default: all)."
        ),
    ] = "",
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
    allow_gaps: options.AllowGaps = False,
    sample: Annotated[bool, typer.Option("--sample", help="Use the sample log of c17_experiment.")] = False,
    json: options.Json = False,
) -> int:
    """Estimate a model's coefficients from logs, with standard errors; list those not excited by the logs.

    Writes model.toml (of a Block of your own parameters.toml, for --params), coefficients.csv,
    prediction.csv and rejected.csv, and for each log a figure of the free-running simulation with the
    measurement.

    Exit status 1 if a coefficient is not excited by the logs or not to be trusted (with a missing effect
    or over longer times its estimate differs by more than its error), the model does not explain the logs,
    or a body velocity of a held-out log (any channel of a Block of your own) is predicted worse 1 s ahead
    than by assuming that it stays constant.
    """
    from hovercontrol.documents.samples import sample_path
    from hovercontrol.identification.identify.study import Study

    names = [*(logs or []), *([str(sample_path())] if sample else [])]
    held = holdout or []
    if not names:
        raise InputError("identify: expected one or more logs (or --sample)")
    out = out or Path("out") / "identify"
    check_folder(out)
    options.refuse_twice("identify", names, held)
    sought = options.listed(coefficients, "--coefficients")
    kept = options.listed(fixed, "--fixed") or []
    plant = options.fmu_of("identify", model, fit, params)
    if plant is not None:
        read = options.reader(
            plant, columns, period, bench, bench_fans, only_while, settle, missing=missing, trial=trial
        )
        return _identify_fmu(plant, read, names, held, sought, kept, out, json)
    if sample and not (logs or held or model or vehicle):
        vehicle = "c17_experiment"
    found = options.model_of("identify", model, vehicle, params)
    read = options.reader(
        found, columns, period, bench, bench_fans, only_while, settle, frame, missing=missing, trial=trial
    )
    with options.progress_bar("identify", 1.0) as report:
        every = []
        for k, name in enumerate([*names, *held]):
            every.append(read(name))
            report(0.1 * (k + 1) / (len(names) + len(held)))
        study = Study.make(
            found,
            every[: len(names)],
            every[len(names) :],
            coefficients=sought,
            fixed=kept,
            progress=lambda part, what: report(0.1 + 0.9 * part, what),
        )
        files = study.save(out)
    text = study.text()
    if study.found.bent:
        flags = {
            "--model": model, "--vehicle": vehicle, "--params": params, "--columns": columns,
            "--period": period, "--bench": bench, "--while": only_while, "--frame": frame,
            "--missing": missing, "--trial": trial, "--fixed": fixed,
        }  # fmt: skip
        text += f"\nto find out what is missing: hovercontrol diagnose {_words(names, held, flags)}"
    options.show(text, files, out, _as_json(study) if json else None)
    return 1 if study.negative else 0


def _words(names: list[str], held: list[str], flags: Mapping[str, object]) -> str:
    """Return arguments and options as a shell takes them."""
    words = [*names, *(word for log in held for word in ("--holdout", log))]
    words += [word for flag, value in flags.items() if value for word in (flag, str(value))]
    return shlex.join(words)


def _identify_fmu(
    plant: FmuPlant,
    read: Callable[[str], Log],
    names: list[str],
    held: list[str],
    sought: list[str] | None,
    kept: list[str],
    out: Path,
    json: bool,
) -> int:
    from hovercontrol.identification.identify.fmu import identify_fmu

    with options.progress_bar("identify", 1.0) as report:
        logs, held_logs = ([read(name) for name in group] for group in (names, held))
        result = identify_fmu(plant, logs, sought, held_logs, report, fixed=kept)
        files = result.save(out)
    values = [vars(c) | {"excited": c.excited} for c in result.coefficients]
    content = {"coefficients": values, "residual": result.residual, "converged": result.converged}
    options.show(result.table(), files, out, content if json else None)
    return 1 if result.negative else 0


def _as_json(study: Study) -> dict[str, Any]:
    from hovercontrol.identification.identify.result import groups_for_json

    found = study.found
    return {
        "coefficients": [
            {
                **vars(c), "reason": c.reason or None, "bound": c.bound or None, "excited": c.excited,
                "trusted": c.trusted, "readings": [vars(r) for r in c.readings],
            }
            for c in found.coefficients
        ],
        **groups_for_json(found.groups, found.kept),
        "forces": [{k: getattr(f, k) for k in ("name", "value", "std", "unit")} for f in found.forces()],
        "remaining": [{**vars(r), "share": r.share} for r in found.remaining],
        "noise": found.residual,
        "units": found.units,
        "rows": found.rows,
        "outliers": found.outliers,
        "rejected": found.rejected,
        "chi2_per_dof": found.chi2_per_dof,
        "misfit": found.misfit or None,
        "converged": found.converged,
        "prediction": [
            {
                "log": j.label, "held_out": j.holdout, "horizon": j.prediction.horizon,
                "rms": j.prediction.rms, "trivial": j.prediction.trivial, "worse": j.worse,
            }
            for j in study.judged
        ],
    }  # fmt: skip
