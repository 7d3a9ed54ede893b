"""A check of logs against a model: errors, warnings, and the coefficients that a fit could estimate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias
from warnings import catch_warnings

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.folders import write_folder
from hovercontrol.base.percent import percent
from hovercontrol.base.plain_json import json_text, plain
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import cut
from hovercontrol.base.text_table import aligned
from hovercontrol.blocks.block import Block
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.identification.check.facts import Column, LogFacts, Timing, facts
from hovercontrol.identification.diagnose.checks import check_fitted, check_logs, slow_rows
from hovercontrol.identification.diagnose.unknown.tables import with_constants
from hovercontrol.identification.engine.measure import angles
from hovercontrol.identification.engine.subject import Subject, structure, with_known_period
from hovercontrol.identification.identify import identify
from hovercontrol.identification.identify.fmu import trial_fit
from hovercontrol.identification.identify.result import Fitted, groups_for_json
from hovercontrol.logs import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Coefficients that a trial fit estimates, groups, and coefficients that it keeps.
Trial: TypeAlias = tuple[tuple[Fitted, ...], tuple[Fitted, ...], tuple[Fitted, ...]]

#: Maximum number of rows in the trial fit, which does not need high accuracy.
MOST_ROWS = 12_000

#: Maximum number of other columns that are listed.
LISTED = 8

#: Maximum number of outliers and rejected spans of a column that are listed as text.
SHOWN = 5


@checked
@dataclass(frozen=True, eq=False)
class Checked:
    """Result of a check of logs.

    Attributes
    ----------
    logs : tuple of LogFacts
        Timing and columns of each log.
    errors, warnings : tuple of str
        One line each: faults that must be corrected before a fit, and points that should be reviewed.
    model : str
        Name of the model; empty without a model.
    coefficients : tuple of Fitted
        Results of a trial fit; empty without a model, or if an error prevents the fit.
    groups : tuple of Fitted
        Products and sums of coefficients that a fit could estimate, though no member alone.
    kept : tuple of Fitted
        Coefficients that the fit did not estimate.

    Examples
    --------
    >>> import numpy as np
    >>> t = 0.02 * np.arange(200)
    >>> found = check(None, [Log("a.csv", t, {"x": np.sin(t), "y": 0.3 * t, "psi": 0 * t})])
    >>> found.errors, len(found.logs)
    ((), 1)
    """

    logs: tuple[LogFacts, ...]
    errors: tuple[str, ...]
    warnings: tuple[str, ...]
    model: str
    coefficients: tuple[Fitted, ...]
    groups: tuple[Fitted, ...] = ()
    kept: tuple[Fitted, ...] = ()

    def __repr__(self) -> str:
        counts = f"{len(self.logs)} logs, {len(self.errors)} errors, {len(self.warnings)} warnings"
        said = [f"  {cut(line)}" for line in (*self.errors, *self.warnings)]
        return "\n".join([f"Checked: {counts}; print(checked.text()) for all", *said])

    @property
    def negative(self) -> bool:
        """Whether there is an error, or a coefficient that cannot be estimated or trusted."""
        return bool(self.errors) or not all(c.excited and c.trusted for c in self.coefficients)

    def text(self) -> str:
        """Return the results as plain text."""
        lines: list[str] = []
        for f in self.logs:
            timing = [line for t in f.timing for line in _timing_text(t, len(f.timing) > 1)]
            lines += [f.log.name, *(f"  {line}" for line in (*timing, *_column_table(f))), ""]
        for heading, said in (("must be corrected", self.errors), ("look at", self.warnings)):
            if said:
                lines += [f"{heading}:", *(f"  {line}" for line in said), ""]
        if self.coefficients:
            lines += [
                f"coefficients that a fit of {self.model} could estimate:",
                *_coefficient_table(self),
            ]
        elif self.model and not self.errors:
            lines += [f"{self.model} has no coefficient to fit"]
        if not (self.errors or self.warnings):
            lines += ["", "no error found in the logs"]
        return "\n".join(lines).strip("\n").replace("\n\n\n", "\n\n")

    def to_json(self) -> dict[str, Any]:
        """Return the results as numbers, texts and lists for JSON; infinite values and NaN become None."""
        found: dict[str, Any] = plain(
            {
                "model": self.model or None,
                "errors": list(self.errors),
                "warnings": list(self.warnings),
                "logs": [
                    {
                        "name": f.log.name,
                        "timing": [vars(t) for t in f.timing],
                        "columns": [vars(c) for c in f.columns],
                        "rejected": [vars(s) for s in f.rejected],
                    }
                    for f in self.logs
                ],
                "coefficients": [
                    {
                        "name": c.name, "value": c.value, "std": c.std, "unit": c.unit, "start": c.start,
                        "shown": c.excited, "reason": c.reason or None,
                        "trusted": c.trusted, "readings": [vars(r) for r in c.readings],
                    }
                    for c in self.coefficients
                ],
                **groups_for_json(self.groups, self.kept),
            }
        )  # fmt: skip
        return found

    def plot(self) -> Figure:
        """Return a figure: every log's columns over time, its gaps and outliers, and the coefficients."""
        from hovercontrol.identification.check.display import draw

        return open_in_pyplot(draw(self))

    def _repr_html_(self) -> str:
        from hovercontrol.identification.check.display import checked_html

        return checked_html(self)

    def save(self, folder: str | Path) -> list[Path]:
        """Write check.txt, check.json and, if logs could be read, check.png and check.svg.

        Parameters
        ----------
        folder : path
            Created if it does not exist.
        """
        from hovercontrol.identification.check.display import draw

        def write(temporary: Path) -> None:
            (temporary / "check.txt").write_text(self.text() + "\n", encoding="utf-8")
            (temporary / "check.json").write_text(json_text(self.to_json()), encoding="utf-8")
            if self.logs:
                figure = draw(self)
                for suffix in ("png", "svg"):
                    figure.savefig(temporary / f"check.{suffix}", dpi=110)

        return write_folder(folder, write)


@checked
def check(
    model: AnyModel | FmuPlant | None,
    logs: Sequence[Log],
    *,
    fixed: Sequence[str] = (),
    files: Sequence[Mapping[str, Array]] | None = None,
    unread: Sequence[str] = (),
    progress: Callable[[float, str], None] | None = None,
) -> Checked:
    """Check logs before a fit.

    Parameters
    ----------
    model : Model, BlockModel, Block, FmuPlant or None
        Model of the logged system; with None only checks that need no model are made. Of an FMU the
        parameters of its ``fit`` are tried, without one all that are real numbers.
    logs : sequence of Log
    fixed : sequence of str, optional
        Parameters of the model that keep their values
        (:func:`~hovercontrol.identification.identify.fit.identify`).
    files : sequence of mapping of str to ndarray, shape (n,), optional
        For each log the stamps [s] of the files it was joined from, by their names.
    unread : sequence of str, optional
        Why further logs could not be read, one line each; these lines are added to the errors.
    progress : callable, optional
        Called with the finished fraction (0 to 1) and a text on the current step.

    Returns
    -------
    Checked
        Faults of a log are listed there; they do not raise an exception.

    Raises
    ------
    InputError
        If there is no log.

    Examples
    --------
    >>> import numpy as np
    >>> t = 0.02 * np.arange(200)
    >>> found = check(None, [Log("a.csv", t, {"x": 1e3 * np.sin(t), "y": 300 * t, "psi": 0 * t})])
    >>> print(found.warnings[0].partition("? ")[0])
    a.csv: the position moves at 1.02e+03 m/s: is it in millimetres or centimetres
    """
    if not logs and not unread:
        raise InputError("check: expected one or more logs")
    report = progress or (lambda part, what: None)
    fmu = model if isinstance(model, FmuPlant) else None
    if isinstance(model, FmuPlant):
        model = BlockModel(model.reading)  # its signals: all that the comparison of logs needs
    given = None if model is None else as_model(model)
    model = None if given is None else with_constants(given)  # of unknown functions nothing is needed here
    block = structure(model) if model is not None else None
    errors, warnings = list(unread), list[str]()
    found = []
    for k, log in enumerate(logs):
        report(0.4 * k / len(logs), f"looking at {log.name}")
        craft = None if model is None else model.is_craft
        turning = [] if block is None else angles(block)
        found.append(facts(log, *_roles(block), files[k] if files else None, craft, turning))
        warnings += found[-1].remarks
        if model is not None:
            _collect(partial(check_logs, model, [log]), errors, warnings)
            errors += slow_rows(model, log)
    tried: Trial = ((), (), ())
    if given is not None and model is not None and not errors:
        report(0.4, "comparing the logs")
        if len(logs) > 1:
            _collect(lambda: check_logs(model, logs), errors, warnings)
        if not errors:
            report(0.5, "a trial fit")
            tried = (
                _shown(given, logs, fixed, errors, warnings, report)
                if fmu is None
                else _shown_of_fmu(fmu, logs, errors, warnings, report)
            )
    seen = [line for line in warnings if line not in errors]
    return Checked(tuple(found), _once(errors), _once(seen), model.name if model is not None else "", *tried)


def _roles(block: Block | None) -> tuple[list[str], dict[str, str]]:
    """Return the names of the command columns, and the units given by the model."""
    if block is None:
        return [], {}
    every = (*block.inputs, *block.states, *block.outputs)
    return [s.name for s in block.inputs], {s.name: s.unit for s in every}


def _collect(work: Callable[[], list[str]], errors: list[str], warnings: list[str]) -> None:
    try:
        warnings += work()
    except InputError as error:
        errors.append(str(error))


def _shown(
    model: Subject,
    logs: Sequence[Log],
    fixed: Sequence[str],
    errors: list[str],
    warnings: list[str],
    report: Callable[[float, str], None],
) -> Trial:
    try:
        model, assumed = with_known_period(model, None, fixed)
        warnings += assumed
        with catch_warnings(action="ignore", category=UserWarning):  # already reported by earlier checks
            trial = identify(
                model,
                logs,
                fixed=fixed,
                most_rows=MOST_ROWS,
                progress=lambda part, what: report(0.5 + 0.5 * part, what),
            )
    except InputError as error:
        errors.append(str(error))
        return (), (), ()
    known: list[str] = []
    _collect(lambda: check_fitted(trial.fit), errors, known)
    warnings += [line for line in known if "is not excited by these logs" not in line]  # already in the table
    if trial.outliers:
        warnings.append(
            f"{trial.outliers} of {trial.rows} rows are outliers of the fitted model: left out of a fit"
        )
    return trial.coefficients, trial.groups, trial.kept


def _shown_of_fmu(
    plant: FmuPlant,
    logs: Sequence[Log],
    errors: list[str],
    warnings: list[str],
    report: Callable[[float, str], None],
) -> Trial:
    try:
        with catch_warnings(action="ignore", category=UserWarning):  # already reported by earlier checks
            trial = trial_fit(plant, logs, MOST_ROWS, lambda part, what: report(0.5 + 0.5 * part, what))
    except InputError as error:
        errors.append(str(error))
        return (), (), ()
    if trial.misfit:
        warnings.append(trial.misfit)
    return trial.coefficients, (), ()


def _once(lines: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(lines))


def _timing_text(t: Timing, named: bool) -> list[str]:
    name = f"{t.of}: " if named else ""
    trials = f" in {t.trials} trials" if t.trials > 1 else ""
    lines = [f"{name}{t.rows} rows, {t.seconds:.4g} s{trials}, {t.rate:.4g} measurements a second"]
    kind = "a steady clock" if t.steady else "no steady sampling clock"
    jitter = f", stamps scatter by {1e3 * t.jitter:.3g} ms" if t.jitter > 1e-6 else ""
    late = f", at most {1e3 * t.worst_delay:.3g} ms late" if t.worst_delay > 1e-6 else ""
    lost = f", {t.lost} samples lost" if t.lost else ""
    gaps = [f"{a:.2f}-{b:.2f} s" for a, b in t.gaps]
    more = f" and {len(gaps) - SHOWN} more" if len(gaps) > SHOWN else ""
    lines.append(
        f"{kind}{jitter}{late}{lost}; " + (f"gaps: {', '.join(gaps[:SHOWN])}{more}" if gaps else "no gaps")
    )
    return lines


def _column_table(f: LogFacts) -> list[str]:
    rows: list[tuple[str, ...]] = [
        ("column", "unit", "from", "to", "noise", "resolution", "outliers", "changes every", "missing")
    ]
    known = [c for c in f.columns if c.kind != "other"] or list(f.columns)
    for c in known:
        every = f"{c.change_every:.3g} s" if c.change_every else ""
        span = (f"{c.low:.4g}", f"{c.high:.4g}", _number(c.noise), _number(c.resolution))
        rows.append(
            (c.name, c.unit or "?", *span, _outliers(c), every, f"{c.missing:,}" if c.missing else "")
        )
    if not any(row[-1] for row in rows[1:]):
        rows = [row[:-1] for row in rows]
    lines = list(aligned(rows))
    rest = [c.name for c in f.columns if c not in known]
    if rest:
        more = f" and {len(rest) - LISTED} more" if len(rest) > LISTED else ""
        lines.append(f"not checked: {', '.join(rest[:LISTED])}{more}")
    if f.rejected:
        spans = [f"{s.start:.2f}-{s.stop:.2f} s ({s.reason})" for s in f.rejected[:SHOWN]]
        more = f" and {len(f.rejected) - SHOWN} more" if len(f.rejected) > SHOWN else ""
        count = sum(s.rows for s in f.rejected)
        lines.append(f"{count} poses that no craft could reach: {', '.join(spans)}{more}")
    return lines


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _outliers(c: Column) -> str:
    if not c.outliers:
        return "" if c.noise is None else "none"
    first = ", ".join(f"{t:.2f} s" for t in c.outliers[:2])
    return f"{len(c.outliers)} ({first}{', ...' if len(c.outliers) > 2 else ''})"


def _coefficient_table(found: Checked) -> list[str]:
    rows = [("coefficient", "estimate", "std. error", "unit", "shown")]
    for c in found.coefficients:
        std = f"{c.std:.2g}" if math.isfinite(c.std) else "unknown"
        rows.append((c.name, f"{c.value:.4g}", std, c.unit, _verdict(c)))
    rows += [(g.name, f"{g.value:.4g}", f"{g.std:.2g}", g.unit, _share(g.value, g.std)) for g in found.groups]
    rows += [(c.name, f"{c.value:.4g}", "kept", c.unit, c.kept) for c in found.kept]
    return [f"  {line}" for line in aligned(rows)]


def _verdict(c: Fitted) -> str:
    if not c.excited:
        return f"no: {c.reason}"
    if not c.trusted:
        return f"not to be trusted: {'; '.join(map(str, c.readings))}"
    return _share(c.value, c.std)


def _share(value: float, std: float) -> str:
    part = std / abs(value) if value else math.inf
    return f"yes, to {percent(part)}" if part < 1 else "yes: not distinguished from zero"
