"""The result of a diagnosis: the verdict, the named effects, the evidence and the remainder."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.folders import write_folder
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.effects.law import VALUES, TableLaw, is_law
from hovercontrol.identification.diagnose.coefficients import Refitted, refitted
from hovercontrol.identification.diagnose.evidence.effect_evidence import Evidence
from hovercontrol.identification.diagnose.evidence.holdout import Ahead, Gap
from hovercontrol.identification.diagnose.evidence.laws import regime_of, worst
from hovercontrol.identification.diagnose.evidence.missing import Missing
from hovercontrol.identification.diagnose.evidence.remainder import Remainder
from hovercontrol.identification.diagnose.evidence.sensors import SlowError
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.diagnose.laws.regions import Range, acting_side, region_of
from hovercontrol.identification.diagnose.laws.scan import Yardstick
from hovercontrol.identification.diagnose.places import acts_in, place_of, place_of_rival
from hovercontrol.identification.diagnose.search.confirm import Rival, Selection
from hovercontrol.identification.diagnose.search.leads import Lead
from hovercontrol.identification.diagnose.search.trace import Decision, decisions_about
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.diagnose.verdict import Verdict
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.groups import Group
from hovercontrol.identification.engine.subject import Subject

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
@dataclass(frozen=True)
class Found:
    """One parameter of an added effect.

    Attributes
    ----------
    effect, parameter : str
        ``"slope"``, ``"slope_x"``.
    acts_in : str
        Where it acts: ``"u' v'"``, ``"thrust"``, ``"measured r"``.
    value, std : float
        Estimate and its standard error.
    unit : str
    place : str
        Where in the loop: ``"force in u' v'"``, ``"actuator of thrust"``, ``"command of u"``,
        ``"sensor of r"``, ``"clock of the log"``.
    body, force_unit : float, str
        The model's mass or inertia, if it turns the value into a force, and the unit of that; else 0, "".

    Examples
    --------
    >>> Found("slope", "slope_x", "u' v'", 0.2, 0.003, "m/s^2").parameter
    'slope_x'
    """

    effect: str
    parameter: str
    acts_in: str
    value: float
    std: float
    unit: str
    place: str = ""
    body: float = 0.0
    force_unit: str = ""

    __repr__ = short_repr

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval, value +- 1.96 std."""
        return self.value - 1.96 * self.std, self.value + 1.96 * self.std


@checked
@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The effects that a model lacks, with the evidence.

    Attributes
    ----------
    verdict : {"effect", "none", "ambiguous", "partial", "unexplained"}
    effects : tuple of Found
        Parameters of the named effects.
    rivals : tuple of Rival
        Effects that the logs do not distinguish from named ones.
    evidence : dict of str to Evidence
        Evidence for each named effect.
    remainders : tuple of Remainder
        Remainder of each equation on which forces act.
    slow_errors : tuple of SlowError
        Errors of sensors that contradict others by more than noise.
    leads : tuple of Lead
        Best candidates that are not named, with the reason.
    model, amended, refitted : Model or BlockModel
        The given model; the model with the named effects and all coefficients fitted; the given model with
        its coefficients fitted.
    before, after : Gap or None
        Errors of `refitted` and `amended` on the held-out logs.
    ahead : tuple of Ahead
        The same errors at several horizons.
    train_before, train_after : Gap
        Errors on the training logs.
    selection : Selection
        Result of the search.
    held_before, held_after : Fit or None
        Fits of `refitted` and `amended` to the held-out logs, of path and noise alone.
    missing : tuple of Missing
        The acceleration that the given model lacks, by log and equation.
    missing_after : tuple of Missing
        The acceleration that the amended model still lacks.
    regime : str
        Where the missing acceleration of the given model acts, as text.
    rows_dropped : int
        Number of rows of the training logs with a sample left out.
    rows_down_weighted : int
        Number of rows with a down-weighted sample: it differs from its neighbours, but not enough to be left
        out.
    warnings : tuple of str
    experiment : Experiment or None
        Next experiment, if one would settle an ambiguous case, tell apart laws that are the same in these
        logs, or reduce a large standard error.
    advice : str
        The experiment in one sentence, or why there is none; empty if none is needed.
    trace : tuple of Decision
        Every decision of the search, in order.
    yardsticks : tuple of Yardstick
        For each equation with a remainder: how much any law of a few signals could still take.
    functions : tuple of FittedFunction
        The model's unknown functions (:func:`hovercontrol.unknown`): as tables, and the forms they may have.
        `model` has the likeliest form in place of each.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.identification.diagnose import diagnose
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.documents.samples import sample_path
    >>> log = read_log(sample_path()).between(0.0, 15.0)
    >>> found = diagnose(hc.vehicle("c17_experiment"), [log], names=["slope"])
    >>> found  # doctest: +ELLIPSIS
    Diagnosis of 'c17_experiment': none
    Missing: nothing beyond noise.
    No log was held out; ...
    Unmodelled residual: none beyond noise.
    >>> found.rows_dropped
    0
    """

    verdict: Verdict
    effects: tuple[Found, ...]
    rivals: tuple[Rival, ...]
    evidence: dict[str, Evidence]
    remainders: tuple[Remainder, ...]
    slow_errors: tuple[SlowError, ...]
    leads: tuple[Lead, ...]
    model: Subject
    amended: Subject
    refitted: Subject
    before: Gap | None
    after: Gap | None
    ahead: tuple[Ahead, ...]
    train_before: Gap
    train_after: Gap
    selection: Selection
    held_before: Fit | None
    held_after: Fit | None
    missing: tuple[Missing, ...]
    missing_after: tuple[Missing, ...]
    regime: str
    rows_dropped: int
    rows_down_weighted: int
    warnings: tuple[str, ...] = ()
    experiment: Experiment | None = None
    advice: str = ""
    trace: tuple[Decision, ...] = ()
    yardsticks: tuple[Yardstick, ...] = ()
    functions: tuple[FittedFunction, ...] = ()

    def taken(self, equation: str) -> float:
        """Return the gain of the named effects that act in an equation or on commands.

        In twice the log likelihood, in all equations together.

        Parameters
        ----------
        equation : str
            ``"r'"``.
        """
        acting = {e.effect for e in self.effects if equation in e.acts_in.split() or "command" in e.acts_in}
        return sum(self.selection.gains[n] for n in acting)

    def why(self, effect: str) -> list[Decision]:
        """Return the decisions of the search about an effect: why it is named, or why not.

        Parameters
        ----------
        effect : str
            Name of an effect; for one that was not considered the list is empty.
        """
        return decisions_about(self.trace, effect)

    @property
    def coefficients(self) -> tuple[Refitted, ...]:
        """Every coefficient of the amended model, fitted or kept."""
        return self._refitted[0]

    @property
    def groups(self) -> tuple[Group, ...]:
        """Products and sums of coefficients that the logs determine though they determine no member alone."""
        return self._refitted[1]

    @cached_property
    def _refitted(self) -> tuple[tuple[Refitted, ...], tuple[Group, ...]]:
        return refitted(self.selection.final, self.model.coefficients(), self.selection.undecided)

    def result(self) -> dict[str, Any]:
        """Return the entries of ``result.json``."""
        return {
            "verdict": self.verdict,
            "effects": self._effects(),
            "functions": [f.result() for f in self.functions],
            "coefficients": [asdict(c) for c in self.coefficients],
            "groups": [{"name": g.name, "value": g.value, "std": g.std, "unit": g.unit} for g in self.groups],
            "rivals": [
                {"name": r.name, "place": place_of_rival(r), "reason": reason_of(r)} for r in self.rivals
            ],
            "gap": {
                "train": {"before": self.train_before.nrmse, "after": self.train_after.nrmse},
                "holdout": {
                    "before": self.before.nrmse,
                    "after": self.after.nrmse,
                    "floor": self.after.floor,
                    "horizon": self.after.horizon,
                    "ahead": [a.__dict__ for a in self.ahead],
                }
                if self.before and self.after
                else {},
            },
            "remainder": {
                r.equation: {
                    "rms": r.rms,
                    "unit": r.unit,
                    "share_explained": r.share_explained,
                    "averaged_over": r.over,
                    "gain": r.gain,
                    "where": self._left(r.equation) if r.there else None,
                    "predictable": self._predictable(r.equation),
                }
                for r in self.remainders
            },
            "slow_errors": {
                s.channel: {"rms": s.rms, "noise": s.noise, "unit": s.unit, "over": s.over}
                for s in self.slow_errors
            },
            "leads": [
                {"name": lead.name, "gain": lead.gain, "blocks_t": lead.blocks_t, "reason": lead.reason}
                for lead in self.leads
            ],
            "trace": [row.result() for row in self.trace],
            "where": self._where(),
            "next_experiment": self.advice or None,
            "rows_dropped": self.rows_dropped,
            "rows_down_weighted": self.rows_down_weighted,
            "warnings": list(self.warnings),
        }

    def _effects(self) -> list[dict[str, Any]]:
        """Return the named effects for :meth:`result`."""
        names = dict.fromkeys(e.effect for e in self.effects)
        numbers = {name: [e for e in self.effects if e.effect == name] for name in names}
        return [
            {
                "name": name,
                "kind": "law" if is_law(name) else "effect",
                "equation": own[0].acts_in,
                "place": own[0].place,
                "coefficient": main.value,
                "std": main.std,
                "unit": main.unit,
                "numbers": {e.parameter: {"value": e.value, "std": e.std, "unit": e.unit} for e in own},
                "region": self.region(name) or None,
                "function": self.function(name),
                "evidence": self.evidence[name].result(),
                "readings": [name, *(r.name for r in self.rivals if r.same and r.instead_of == name)],
            }
            for name, own in numbers.items()
            for main in (peak_of(own),)
        ]

    def region(self, name: str) -> list[Range]:
        """Return the ranges of a signal in which a named effect acts; empty if everywhere.

        Parameters
        ----------
        name : str
        """
        e = self.amended.effect(name)
        return region_of(e) or acting_side(self.model, self.amended, e)

    def function(self, name: str) -> dict[str, Any] | None:
        """Return a named effect that is a table: signals, grid, values and their standard errors; else None.

        Parameters
        ----------
        name : str
        """
        law = self.amended.effect(name)
        if not isinstance(law, TableLaw):
            return None
        argument, grid, values = law.table()
        std = {e.parameter: e.std for e in self.effects if e.effect == name}
        own = {law.values[y]: std.get(law.parameter(y), 0.0) for y in VALUES}
        signals = [argument, *(f.text for f in law.product if f is not law.curve())]
        return {"signals": signals, "grid": grid, "values": values, "std": [own.get(v, 0.0) for v in values]}

    def _predictable(self, equation: str) -> dict[str, Any] | None:
        """Return how much any law of a few signals could still take in an equation."""
        found = next((y for y in self.yardsticks if y.equation == equation), None)
        if found is None:
            return None
        share = found.share(self.taken(equation))
        return {"signals": list(found.signals), "gain": found.gain, "share_named": share}

    def _left(self, equation: str) -> dict[str, Any]:
        """Return where the remainder of one equation acts: as text, and times in the log with most of it."""
        same = [m for m in self.missing_after if m.equation == equation]
        most = max(same, key=lambda m: m.share)
        return {
            "regime": regime_of(same),
            "log": most.log,
            "segments": [list(s) for s in most.segments],
        }

    def _where(self) -> dict[str, Any]:
        """Return where the given model lacks most: equation, regime, and the times in the worst log.

        In `regions` and `rows`, where what stays unnamed acts: ranges of signals, and rows of the logs.
        """
        left = self.selection.regions
        unnamed = {
            "regions": [{"equation": f"{r.equation}'", **one} for r in left for one in r.region()],
            "rows": [
                {"equation": m.equation, "log": m.log, "rows": np.searchsorted(m.time, m.segments).tolist()}
                for m in self.missing_after
                if m.segments and any(r.there and r.equation == m.equation for r in self.remainders)
            ],
        }
        most = worst(self.missing)
        if most is None or not most.segments:
            return {"equation": None, "segments": [], "regime": self.regime, **unnamed}
        return {
            "equation": most.equation,
            "log": most.log,
            "segments": [list(s) for s in most.segments],
            "regime": self.regime,
            **unnamed,
        }

    def sentences(self) -> tuple[str, ...]:
        """Return sentences on unknown functions, missing effects, the held-out error, and the remainder."""
        from hovercontrol.identification.diagnose.report import gap_sentence, headline, remainder_sentence

        found = (f.sentence() for f in self.functions)
        return *found, headline(self), gap_sentence(self), remainder_sentence(self)

    def __repr__(self) -> str:
        return "\n".join((f"Diagnosis of {self.model.name!r}: {self.verdict}", *self.sentences()))

    def _repr_html_(self) -> str:
        from hovercontrol.identification.diagnose.display import diagnosis_html

        return diagnosis_html(self, self.sentences())

    def plot(self) -> Figure:
        """Return a figure of the errors without and with the added effects."""
        from hovercontrol.identification.diagnose.display import diagnosis_figure

        return open_in_pyplot(diagnosis_figure(self))

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``result.json``, the amended model and, if there is one, ``next_experiment.csv``.

        A craft is written as ``model.toml``. For a Block, ``parameters.toml`` holds coefficients and effects.

        Parameters
        ----------
        folder : path
            Created if it does not exist.
        """
        from hovercontrol.craft.models.parameters import FITTED, save_fitted

        text = json.dumps(_finite(self.result()), indent=2, allow_nan=False, default=float) + "\n"

        def write(place: Path) -> None:
            (place / "result.json").write_text(text, encoding="utf-8")
            save_fitted(self.amended, place)
            if self.experiment:
                self.experiment.save(place / "next_experiment.csv")

        return write_folder(folder, write, stale=(*FITTED, "next_experiment.csv"))


def peak_of(numbers: Sequence[Found]) -> Found:
    """Return the number that stands for an effect: its first, or the largest value of a table."""
    first = numbers[0]
    if not first.parameter.endswith(f"_{VALUES[0]}"):
        return first
    return max(numbers, key=lambda n: abs(n.value))


def reason_of(rival: Rival) -> str:
    """Return why a rival is not distinguished from a named effect."""
    if rival.same and is_law(rival.name):
        return f"the same as {rival.instead_of} in these logs, but it breaks a symmetry of the model"
    if rival.same:
        return f"equivalent to {rival.instead_of} in every log"
    return (
        f"instead of {rival.instead_of}: behind by {rival.behind:.1f} in twice the log likelihood, "
        f"{rival.t:.1f} standard errors over segments"
    )


def _finite(value: Any) -> Any:
    """Return a result with None for numbers that are not finite, since JSON has no NaN."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def numbers_of(fit: Fit, names: Sequence[str]) -> tuple[Found, ...]:
    """Return the parameters of effects of a fitted model."""
    problem, C = fit.problem, fit.covariance
    forces = problem.model.force_scales()
    found = []
    for name in names:
        e = problem.model.effect(name)
        for key in e.numbers:
            parameter = e.parameter(key)
            if parameter not in problem.names or parameter == e.friction_width():
                continue
            j = problem.names.index(parameter)
            unit = problem.block.parameter(parameter).unit
            std = math.sqrt(max(C[j, j], 0.0))
            where = acts_in(fit, name), place_of(problem.model, e)
            force = forces.get(parameter, (0.0, ""))
            found.append(Found(name, parameter, where[0], float(fit.p[j]), std, unit, where[1], *force))
    return tuple(found)
