"""A complete identification, as in ``hovercontrol identify``: fit, predict, write and plot."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.folders import write_folder
from hovercontrol.base.percent import percent
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import cut
from hovercontrol.base.text_table import aligned
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.craft.models.parameters import FITTED, save_fitted
from hovercontrol.identification.engine.measure import MOST_ROWS, Measured
from hovercontrol.identification.identify.display import free_run_figure
from hovercontrol.identification.identify.fit import identify, measure_shared, refuse_other_units
from hovercontrol.identification.identify.predict import FreeRun, Prediction, prediction, run_of, smoothed
from hovercontrol.identification.identify.result import Identified
from hovercontrol.logs import VELOCITY, Log
from hovercontrol.logs.duplicates import refuse_duplicates

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class StudyCriteria:
    """Settings for the evaluation of predictions.

    No published source: set by hand, tested in tests/identification/identify/test_study.py.

    Attributes
    ----------
    horizon : float
        Prediction horizon [s]; one time step if a log is slower.
    part : float
        Maximum horizon as a fraction of the longest stretch of a log without a break.
    """

    horizon: float = 1.0
    part: float = 0.5


#: The values in use.
JUDGEMENT = StudyCriteria()


#: Maximum number of rejected spans listed for a log; the file contains all of them.
SHOWN = 6


@dataclass(frozen=True)
class Judged:
    """The identified model's predictions on one log.

    Attributes
    ----------
    label : str
        The log's name without suffix.
    holdout : bool
    prediction : Prediction
    run : FreeRun
    channels : tuple of str
        The evaluated channels: the body velocities of a craft, or all channels of any other system.
    """

    label: str
    holdout: bool
    prediction: Prediction
    run: FreeRun
    channels: tuple[str, ...] = VELOCITY

    @property
    def worse(self) -> tuple[str, ...]:
        """The channels that are predicted worse than by constant velocities."""
        share = self.prediction.share
        return tuple(c for c in self.channels if c in share and not share[c] <= 1.0)


@dataclass(frozen=True)
class Study:
    """The result of an identification and its predictions of each log.

    Parameters
    ----------
    judged : tuple of Judged
        Training logs first, then held-out logs.
    """

    found: Identified
    judged: tuple[Judged, ...]

    @classmethod
    def make(
        cls,
        model: AnyModel,
        training: Sequence[Log],
        holdout: Sequence[Log] = (),
        *,
        coefficients: Sequence[str] | None = None,
        fixed: Sequence[str] = (),
        progress: Callable[[float, str], None] | None = None,
    ) -> Study:
        """Fit on the training logs, then predict every log.

        Parameters
        ----------
        coefficients, fixed : sequence of str, optional
            As for :func:`~hovercontrol.identification.identify.fit.identify`.
        progress : callable, optional
            Called with the finished fraction (0 to 1) and a text on the current step.

        Raises
        ------
        InputError
            As :func:`~hovercontrol.identification.identify.fit.identify`, or if a name is used twice.
        """
        report = progress or (lambda part, what: None)
        model = as_model(model)
        if not training:
            raise InputError("identification needs at least one log")
        if model.is_craft:
            refuse_other_units([*training, *holdout])
        _refuse_copies(model, training, holdout)
        report(0.0, "reading the measurements")
        measured: list[Measured] = measure_shared(model, training, MOST_ROWS)
        for log in holdout:
            measured += measure_shared(model, [log], MOST_ROWS)
        found = identify(
            model,
            measured[: len(training)],
            coefficients,
            fixed=fixed,
            progress=lambda part, what: report(0.2 + 0.6 * part, what),
        )
        labels = _labels([m.name for m in measured])
        horizon = min(map(_horizon, measured))
        judged = []
        for k, (label, data) in enumerate(zip(labels, measured, strict=True)):
            report(0.8 + 0.2 * k / len(measured), f"predicting {label}")
            held_out = k >= len(training)
            fit, own = (smoothed(found.model, data), 0) if held_out else (found.fit, k)
            run = run_of(model.name, fit, own)
            ahead = prediction(fit, horizon, own)
            channels = VELOCITY if model.is_craft else tuple(ahead.rms)
            judged.append(Judged(label, held_out, ahead, run, channels))
        return cls(found, tuple(judged))

    @property
    def negative(self) -> bool:
        """Whether a coefficient is not excited or trusted, or a log is not explained or poorly predicted."""
        found = self.found
        unexcited = not all(c.excited and c.trusted for c in found.coefficients)
        return unexcited or bool(found.misfit) or any(j.worse for j in self.judged if j.holdout)

    def __repr__(self) -> str:
        logs = ", ".join(f"{j.label}{' (held out)' * j.holdout}" for j in self.judged)
        return "\n".join([f"Study of {len(self.judged)} logs: {cut(logs)}", repr(self.found)])

    def _repr_html_(self) -> str:
        from hovercontrol.identification.identify.display import study_html

        return study_html(self)

    def plot(self, log: str = "") -> Figure:
        """Return a figure of the free run over a log, by label (default: the first held-out log, or first).

        Raises
        ------
        InputError
            If there is no such log; the message names the nearest.
        """
        runs = {j.label: j for j in sorted(self.judged, key=lambda j: not j.holdout)}
        if log and log not in runs:
            raise InputError(f"no log {log!r}{did_you_mean(log, runs)}")
        chosen = runs[log] if log else next(iter(runs.values()))
        return open_in_pyplot(free_run_figure(chosen.run, held_out=chosen.holdout))

    def text(self) -> str:
        """Return the results as plain text: coefficients, predictions, rejected spans."""
        rows = [("log", "channel", "error", "trivial", "unit", "share")]
        for j in self.judged:
            p, label = j.prediction, f"{j.label}{' (held out)' if j.holdout else ''}"
            for k, c in enumerate(p.rms):
                cells = (f"{p.rms[c]:.3g}", f"{p.trivial[c]:.3g}", p.units[c], percent(p.share[c], 3))
                rows.append(("" if k else label, c, *cells))
        ahead = self.judged[0].prediction.horizon
        still = "body velocities" if self.found.model.is_craft else "states"
        lines = [
            f"coefficients of {self.found.model.name}",
            self.found.table(),
            "",
            f"rms error {ahead:.3g} s ahead, beside that of the trivial prediction (constant {still})",
            *aligned(rows),
        ]
        lines += [
            f"{j.label}: the model predicts {', '.join(j.worse)} worse than that"
            for j in self.judged
            if j.worse
        ]
        rejects = self.found.model.is_craft or any(j.run.rejected for j in self.judged)
        lines += ["", "rejected: implausible motion"] if rejects else []
        for j in self.judged if rejects else ():
            spans = [f"{s.start:.2f}-{s.stop:.2f} s ({s.rows} rows, {s.reason})" for s in j.run.rejected]
            more = [f"and {len(spans) - SHOWN} more in rejected.csv"] if len(spans) > SHOWN else []
            lines.append(f"  {j.label}: " + (", ".join([*spans[:SHOWN], *more]) or "nothing"))
        return "\n".join(lines)

    def save(self, folder: str | Path) -> list[Path]:
        """Write model.toml, coefficients.csv, prediction.csv, rejected.csv and free_run_LOG.png.

        For a user's own Block, parameters.toml replaces model.toml
        (:func:`~hovercontrol.craft.models.parameters.load_parameters`). The files are written atomically;
        figures of an earlier run's logs are removed. Returns the files.
        """

        def write(temporary: Path) -> None:
            save_fitted(self.found.model, temporary)
            self.found.save_csv(temporary / "coefficients.csv")
            ahead = [
                [j.label, j.holdout, c, p.units[c], p.horizon, p.rms[c], p.trivial[c], p.share[c]]
                for j in self.judged
                for p in [j.prediction]
                for c in p.rms
            ]
            heading = ["log", "held_out", "channel", "unit", "horizon_s", "rms", "trivial", "share"]
            _table(temporary / "prediction.csv", heading, ahead)
            spans = [
                [j.label, s.start, s.stop, s.rows, s.reason] for j in self.judged for s in j.run.rejected
            ]
            _table(temporary / "rejected.csv", ["log", "start_s", "stop_s", "rows", "reason"], spans)
            for j in self.judged:
                figure = free_run_figure(j.run, held_out=j.holdout)
                figure.savefig(temporary / f"free_run_{j.label}.png", dpi=120)

        return write_folder(folder, write, stale=("free_run_*.png", *FITTED))


def _refuse_copies(model: AnyModel, training: Sequence[Log], holdout: Sequence[Log]) -> None:
    """Raise if a held-out log contains rows of a training log, or if training logs share rows."""
    block = as_model(model).plant()
    inputs = [s.name for s in block.inputs]
    seen = dict.fromkeys(s.name for s in (*block.outputs, *block.states))
    channels = [name for name in seen if name not in inputs]
    refuse_duplicates(training, holdout, channels, inputs)


def _table(path: Path, heading: list[str], rows: Sequence[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(heading)
        out.writerows(rows)


def _horizon(log: Measured) -> float:
    """Return the prediction horizon for a log [s]."""
    step = float(np.median(np.diff(log.time)))
    longest = max((float(log.time[b - 1] - log.time[a]) for a, b in log.segments), default=0.0)
    return max(min(JUDGEMENT.horizon, JUDGEMENT.part * longest), step)


def _labels(names: Sequence[str]) -> list[str]:
    """Return file names without suffix, numbered if two logs share one."""
    stems = [Path(name).stem for name in names]
    labels = [f"{s}_{stems[:k].count(s) + 1}" if stems.count(s) > 1 else s for k, s in enumerate(stems)]
    shared = sorted({s for s in labels if labels.count(s) > 1})
    if shared:
        raise InputError(f"logs share a name: {', '.join(shared)}")
    return labels
