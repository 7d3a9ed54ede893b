"""What came of a search: the verdict, the effects that are named, the gap, and where it is."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.experiment import Experiment
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.holdout import Gap
from hovercontrol.discrepancy.ladder import ladder
from hovercontrol.discrepancy.laws import worst
from hovercontrol.discrepancy.localize import Missing, localize
from hovercontrol.discrepancy.noise import Noise
from hovercontrol.discrepancy.outliers import LeftOut
from hovercontrol.discrepancy.probes import Sign
from hovercontrol.discrepancy.selection import Rival, Selection
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.verdict import Verdict
from hovercontrol.discrepancy.weighing import EACH
from hovercontrol.files import write_whole
from hovercontrol.model import Model


@dataclass(frozen=True)
class Found:
    """One number of an effect that was added.

    Attributes
    ----------
    effect, parameter : str
        ``"slope"``, ``"slope_x"``.
    acts_in : str
        Where it acts: ``"u' v'"``, ``"thrust"``, ``"measured r"``.
    value, std : float
        Estimate and its standard error.
    unit : str
    """

    effect: str
    parameter: str
    acts_in: str
    value: float
    std: float
    unit: str

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - 1.96 * self.std, self.value + 1.96 * self.std


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a model lacks, with the evidence.

    Attributes
    ----------
    verdict : {"effect", "none", "ambiguous", "unexplained"}
    effects : tuple of Found
        Numbers of the effects that are named; empty if the verdict is not to name any.
    rivals : tuple of Rival
        Effects that these logs cannot tell from named ones.
    signs : tuple of Sign
        Of something that is not in the catalogue.
    model, amended : Model
        As given; with the named effects and all coefficients fitted.
    refitted : Model
        As given, its coefficients fitted like those of `amended`.
    before, after : Gap or None
        On the hold-out log, of `refitted` and `amended`.
    rival_gaps : dict of str to Gap
        On the hold-out log, by name, of the model with a rival in the place of what it rivals.
    held : Data or None
        The hold-out log as it was used: without what stands out.
    left_out : tuple of LeftOut
        Samples that were not used, by log (the hold-out log last), channel and reason.
    train_before, train_after : Gap
        On the training logs.
    selection : Selection
        The search itself.
    noise : Noise
        What is missing, taken as process noise.
    missing : tuple of Missing
        The force that the given model lacks, by log and equation: where effects are named, with the
        coefficients of `amended`; else with those of `refitted`.
    regime : str
        In words, where that force is.
    rows_dropped : int
        Rows of the training logs of which a sample was left out.
    warnings : tuple of str
        About the logs, one line each.
    experiment : Experiment or None
        What to drive next, where that would settle an ambiguous case or tell a coefficient better.
    advice : str
        That in one sentence, or why there is no such experiment; empty where none is wanted.
    """

    verdict: Verdict
    effects: tuple[Found, ...]
    rivals: tuple[Rival, ...]
    signs: tuple[Sign, ...]
    model: Subject
    amended: Subject
    refitted: Subject
    before: Gap | None
    after: Gap | None
    train_before: Gap
    train_after: Gap
    selection: Selection
    noise: Noise
    missing: tuple[Missing, ...]
    regime: str
    rows_dropped: int
    warnings: tuple[str, ...] = ()
    experiment: Experiment | None = None
    advice: str = ""
    rival_gaps: dict[str, Gap] = field(default_factory=dict)
    held: Data | None = None
    left_out: tuple[LeftOut, ...] = ()

    def missing_after(self) -> tuple[Missing, ...]:
        """Return the force that the amended model still lacks on the training logs."""
        data = self.selection.final.windowed.data
        near = fit(self.amended, data, ladder(data)[:2][-1], frozen=True)
        return tuple(localize(near, self.noise.like(len(near.windowed.free))))

    def result(self) -> dict[str, Any]:
        """Return what ``result.json`` holds."""
        held = self.before is not None and self.after is not None
        names = dict.fromkeys(e.effect for e in self.effects)
        numbers = {name: [e for e in self.effects if e.effect == name] for name in names}
        return {
            "verdict": self.verdict,
            "effects": [
                {
                    "name": name,
                    "equation": own[0].acts_in,
                    "coefficient": own[0].value,
                    "std": own[0].std,
                    "unit": own[0].unit,
                    "numbers": {e.parameter: {"value": e.value, "std": e.std, "unit": e.unit} for e in own},
                }
                for name, own in numbers.items()
            ],
            "rivals": [
                {
                    "name": r.name,
                    "reason": f"instead of {r.instead_of}: behind by {r.behind:.1f} in twice the log "
                    f"likelihood, {EACH:g} charged for each number; "
                    f"correlation of signatures {r.correlation:.3f}",
                }
                for r in self.rivals
            ],
            "gap": {
                "train": {"before": self.train_before.nrmse, "after": self.train_after.nrmse},
                "holdout": {
                    "before": self.before.nrmse if self.before else {},
                    "after": self.after.nrmse if self.after else {},
                    "floor": self.after.floor if self.after else {},
                }
                if held
                else {},
            },
            "where": self._where(),
            "signs": [{"kind": s.kind, "text": s.text, "gain": s.gain} for s in self.signs],
            "process_noise": self._process(),
            "next_experiment": self.advice or None,
            "rows_dropped": self.rows_dropped,
            "warnings": list(self.warnings),
        }

    def _where(self) -> dict[str, Any]:
        """Return in which equation, when (of the first log in which it shows) and in which regime."""
        most = worst(self.missing)
        if most is None or not most.segments:
            return {"equation": None, "segments": [], "regime": self.regime}
        return {
            "equation": most.equation,
            "log": most.log,
            "segments": [list(s) for s in most.segments],
            "regime": self.regime,
        }

    def _process(self) -> dict[str, float]:
        final = self.selection.final
        names = [final.windowed.block.states[i].name for i in final.windowed.free]
        return {f"{n}'": float(v) for n, v in zip(names, final.noise.process, strict=True) if v > 0}

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``result.json``, ``model.toml`` and, where there is one, ``next_experiment.csv``."""
        from hovercontrol.modelfile import save_model

        folder = Path(folder)
        text = json.dumps(_finite(self.result()), indent=2, allow_nan=False, default=float) + "\n"
        files = [write_whole(folder / "result.json", lambda path: path.write_text(text, encoding="utf-8"))]
        if isinstance(self.amended, Model):
            files.append(save_model(self.amended, folder / "model.toml"))
        if self.experiment:
            files.append(self.experiment.save(folder / "next_experiment.csv"))
        return files


def _finite(value: Any) -> Any:
    """Return a result with null where a number is not finite: JSON knows no NaN."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def numbers_of(fit: Fit, names: Sequence[str]) -> tuple[Found, ...]:
    """Return the numbers of effects of a fitted model."""
    w, C = fit.windowed, fit.covariance
    found = []
    for name in names:
        e = w.model.effect(name)
        for key in e.numbers:
            parameter = e.parameter(key)
            if parameter not in w.names or (key == "width" and e.numbers[key].neutral != 0.0):
                continue
            j = w.names.index(parameter)
            unit = w.block.parameter(parameter).unit
            std = math.sqrt(max(C[j, j], 0.0))
            found.append(Found(name, parameter, acts_in(fit, name), float(fit.p[j]), std, unit))
    return tuple(found)


def acts_in(fit: Fit, name: str) -> str:
    """Return where an effect acts, in words of the equations."""
    w = fit.windowed
    e = w.model.effect(name)
    own = {w.block.parameter(e.parameter(k)).symbol for k in e.numbers}
    block = w.block
    rows = [f"{s.name}'" for s in block.states if block.expand(block.derivatives[s.name]).free_symbols & own]
    rows += [
        o.name.replace("_measured", " as measured")
        for o in block.outputs
        if block.expand(block.output_expressions[o.name]).free_symbols & own
    ]
    return " ".join(rows) or ("all commands" if type(e).kind() == "input" else "the log's clock")
