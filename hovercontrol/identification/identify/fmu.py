"""Identification of an FMU's parameters from logs (:mod:`hovercontrol.fmi.replay.output_error`)."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.folders import write_folder
from hovercontrol.base.text_table import aligned
from hovercontrol.fmi.replay.held_out import held_out, shares_of
from hovercontrol.fmi.replay.output_error import FmuFit, fit_fmu, refine
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import trials_of
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.start_values import save_around, save_copy, save_csv, save_ssv
from hovercontrol.fmi.replay.unknowns import Unknowns
from hovercontrol.identification.engine.excitation import (
    EXCITATION,
    covariance,
    named_directions,
    reason,
    unexcited_directions,
)
from hovercontrol.identification.identify.result import Fitted
from hovercontrol.logs.log import Log

#: Most parameters that a trial fit takes by itself.
MOST_TRIED = 50


@checked
@dataclass(frozen=True, eq=False)
class FmuIdentified:
    """The result of :func:`~hovercontrol.identification.identify.fit.identify` of an FMU.

    Attributes
    ----------
    model : FmuPlant
        The model with the estimates.
    coefficients : tuple of Fitted
        Parameters of the FMU, then numbers of the effects around it. The states at the start of the logs are
        estimated too; their errors are part of the others'.
    covariance : ndarray, shape (P, P)
        Of the coefficients.
    unexcited : tuple of mapping
        Directions that the logs leave open: steps of coefficients that together change no measured channel.
    residual, spread : mapping
        Root mean square of measured minus computed, and spread of the measured values, of each channel.
    units : mapping
        Unit of each channel.
    orders : mapping
        Order of the autoregression of each channel's residual: 0 where it is white, as measurement noise is.
    rows : int
    logs : tuple of str
    converged : bool
    held_out : mapping
        Root mean square of the residual over its spread of each held-out log, by log and channel.
    fit : FmuFit
    """

    model: FmuPlant
    coefficients: tuple[Fitted, ...]
    covariance: Array
    unexcited: tuple[Mapping[str, float], ...]
    residual: Mapping[str, float]
    spread: Mapping[str, float]
    units: Mapping[str, str]
    orders: Mapping[str, int]
    rows: int
    logs: tuple[str, ...]
    converged: bool
    held_out: Mapping[str, Mapping[str, float]]
    fit: FmuFit

    def __getitem__(self, name: str) -> Fitted:
        for found in self.coefficients:
            if found.name == name:
                return found
        hint = did_you_mean(name, [f.name for f in self.coefficients])
        raise InputError(f"no coefficient {name!r} was identified{hint}")

    @property
    def negative(self) -> bool:
        """Whether a coefficient is not excited, the fit did not converge, or a residual is not white."""
        return not (all(c.excited for c in self.coefficients) and self.converged and not self.misfit)

    @property
    def misfit(self) -> str:
        """Message on residuals that depend on their past beyond chance; empty if there are none."""
        coloured = self.fit.whitening.coloured
        poor = [name for name, told in zip(self.orders, coloured, strict=True) if told]
        if not poor:
            return ""
        return (
            f"the residuals of {', '.join(poor)} depend on their past: the plant was disturbed, or the FMU "
            "lacks something; hovercontrol diagnose looks for it"
        )

    def table(self) -> str:
        """Return the result as text."""
        rows = [("coefficient", "value", "std", "unit", "")]
        for f in self.coefficients:
            remarks = [f"at its {f.bound} bound"] if f.bound else []
            remarks += [f"not excited: {f.reason}"] if f.reason else []
            std = f"{f.std:.2g}" if np.isfinite(f.std) else "inf"
            rows.append((f.name, f"{f.value:.5g}", std, f.unit, "; ".join(remarks)))
        channels = [
            (c, f"{self.residual[c]:.3g}", f"{self.spread[c]:.3g}", u, str(self.orders[c]))
            for c, u in self.units.items()
        ]
        lines = aligned(rows)
        lines += ["", *aligned([("channel", "residual", "spread", "unit", "order"), *channels])]
        for log, shares in self.held_out.items():
            said = ", ".join(f"{c} {share:.3g}" for c, share in shares.items())
            lines.append(f"{log} (held out): residual over spread: {said}")
        lines += ["", f"{self.rows} rows of {', '.join(self.logs)}"]
        lines += [self.misfit] if self.misfit else []
        lines += [] if self.converged else ["not converged"]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return self.table()

    def save_csv(self, path: str | Path) -> Path:
        """Write the coefficients, one row each, with all digits."""
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            rows = [
                {**{k: v for k, v in asdict(f).items() if k != "readings"}, "excited": f.excited}
                for f in self.coefficients
            ]
            out = csv.DictWriter(file, list(rows[0]) if rows else ["name"])
            out.writeheader()
            out.writerows(rows)
        return Path(path)

    def save(self, folder: str | Path) -> list[Path]:
        """Write coefficients.csv, start_values.csv, start_values.ssv, around.json and a copy of the FMU.

        The copy has the estimates as start values in its model description, and the same binary.
        """

        def write(temporary: Path) -> None:
            self.save_csv(temporary / "coefficients.csv")
            save_csv(self.model, temporary / "start_values.csv")
            save_ssv(self.model, temporary / "start_values.ssv")
            save_around(self.model.around, temporary / "around.json")
            save_copy(self.model, temporary / self.model.path.name)

        return write_folder(folder, write)


def identify_fmu(
    model: FmuPlant,
    logs: Sequence[Log],
    coefficients: Sequence[str] | None = None,
    holdout: Sequence[Log] = (),
    progress: Callable[[float, str], None] | None = None,
    *,
    fixed: Sequence[str] = (),
) -> FmuIdentified:
    """Estimate parameters of an FMU from logs; see :func:`~hovercontrol.identify`."""
    report = progress or (lambda part, what: None)
    for name in (*(coefficients or ()), *fixed):
        model.value(name)
    wanted = model.fit if coefficients is None else tuple(coefficients)
    model = replace(model, fit=tuple(name for name in wanted if name not in fixed))
    if not model.fit and not model.around.effects:
        raise InputError(f"{model.path}: no parameter to fit; those it has: {', '.join(model.parameters)}")
    if not logs:
        raise InputError("identification needs at least one log")
    rows = trials_of(model, logs)
    step = [0]

    def passed(what: str) -> None:
        step[0] += 1
        report(0.9 * step[0] / (1 + step[0]), what)

    with threadpool_limits(1, "blas"):
        fit = fit_fmu(model, rows, passed)
        held = {log.name: shares_of(held_out(fit.model, log)) for log in holdout}
    report(1.0, "done")
    return identified(fit, held)


def trial_fit(
    model: FmuPlant,
    logs: Sequence[Log],
    most_rows: int,
    progress: Callable[[float, str], None] | None = None,
) -> FmuIdentified:
    """Return estimates from the first rows of logs, with the standard errors that all rows give.

    Parameters
    ----------
    model : FmuPlant
        Without a `fit` all its parameters are fitted.
    logs : sequence of Log
    most_rows : int
        Of all logs together; the sensitivities at the estimates are computed over all rows.
    progress : callable, optional
        Called with the finished fraction (0 to 1) and a text on the current step.

    Raises
    ------
    InputError
        If a log does not fit the FMU, or it has more than `MOST_TRIED` parameters and no `fit`.
    """
    report, done = progress or (lambda part, what: None), [0]

    def passed(what: str) -> None:
        done[0] += 1
        report(0.9 * done[0] / (1 + done[0]), what)

    if not model.fit and not model.around.effects:
        if len(model.parameters) > MOST_TRIED:
            raise InputError(
                f"{model.path}: {len(model.parameters)} parameters, at most {MOST_TRIED} can be tried "
                "together; name those to fit"
            )
        model = replace(model, fit=tuple(model.parameters))
    rows = trials_of(model, logs)
    share = most_rows / sum(len(r.time) for r in rows)
    with threadpool_limits(1, "blas"):
        fit = fit_fmu(model, [r.head(min(share, 1.0)) for r in rows], passed)
        if share < 1.0:
            passed("sensitivities over all rows")
            try:
                fit = refine(Unknowns(fit.unknowns.plant, rows), fit.values, 0)
            except RunFailed as fault:
                raise InputError(f"FMU {model.name!r} failed on {rows[0].name}: {fault}") from None
    report(1.0, "done")
    return identified(fit, {})


def identified(fit: FmuFit, held: Mapping[str, Mapping[str, float]]) -> FmuIdentified:
    """Return the result of a fit."""
    unknowns, plant = fit.unknowns, fit.model
    C = covariance(fit.information, unknowns.size, fit.widen)
    own = list(unknowns.of_model)
    size = unknowns.size[own]
    C = C[np.ix_(own, own)]
    names = [unknowns.names[j] for j in own]
    directions = named_directions(unexcited_directions(C, size), size, names)
    alone = 1.0 / np.sqrt(np.maximum(np.diag(fit.information)[own], 1e-300))
    start = unknowns.plant
    found = []
    for k, j in enumerate(own):
        u, value, std = unknowns.every[j], float(fit.values[j]), float(np.sqrt(C[k, k]))
        bound = "lower" if value <= u.lower else "upper" if value >= u.upper else ""
        std = std if max(std, alone[k]) < EXCITATION.no_information * u.size else np.inf
        first = start.value(u.name) if u.place == "fmu" else start.around.values[u.name]
        why = reason(u.name, std, size[k], alone[k], directions, u.unit, ())
        found.append(Fitted(u.name, value, std, u.unit, first, bound, why))
    rows = unknowns.logs
    signals = (*plant.outputs, *plant.states)
    channels = [signals[i] for i in rows[0].places]
    every = np.concatenate([r.values for r in rows])
    spread = np.nanstd(every, axis=0)
    return FmuIdentified(
        plant,
        tuple(found),
        C,
        directions,
        {s.name: float(x) for s, x in zip(channels, fit.rms, strict=True)},
        {s.name: float(x) for s, x in zip(channels, spread, strict=True)},
        {s.name: s.unit for s in channels},
        {s.name: n for s, n in zip(channels, fit.whitening.orders, strict=True)},
        sum(int(np.isfinite(r.values).any(axis=1).sum()) for r in rows),
        tuple(dict.fromkeys(r.name for r in rows)),
        fit.converged,
        held,
        fit,
    )
