"""The result as sentences: the missing effects, the held-out error and the remainder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hovercontrol.base.boundary import checked
from hovercontrol.base.percent import percent
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.law import is_law
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.holdout import Ahead, Gained, ahead
from hovercontrol.identification.diagnose.evidence.laws import regime
from hovercontrol.identification.diagnose.places import of_one_form
from hovercontrol.identification.diagnose.report import pictures
from hovercontrol.identification.diagnose.report.context import Context, held_out_words, numbers_by_effect
from hovercontrol.identification.diagnose.report.formatting import (
    effect_words,
    listed,
    meaning,
    number_of,
    plus_minus,
    prime,
    range_words,
    small,
    times,
    unit,
)
from hovercontrol.identification.diagnose.report.templates import legend, render
from hovercontrol.identification.diagnose.search.leads import ASKED_FOR, Lead

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.diagnosis import Diagnosis, Found

#: Explanation of each verdict.
MEANS = {
    "none": "nothing is missing beyond noise",
    "effect": "named, and nothing remains beyond noise",
    "partial": "named, and something remains",
    "ambiguous": "one of several effects or forms",
    "unexplained": "something is missing, no candidate effect explains it",
}


@dataclass(frozen=True)
class Significance:
    """Settings of what the headline reports as a change.

    Two standard errors are exceeded in one direction by chance in 2.3 % of normal samples.

    Attributes
    ----------
    sure : float
        Standard errors by which a held-out error must fall to be reported as a fall.
    nearest : int
        Maximum number of candidates mentioned in the headline.
    """

    sure: float = 2.0
    nearest: int = 2


#: The values in use.
SIGNIFICANCE = Significance()


@checked
def headline(d: Diagnosis) -> str:
    """Return one sentence on the missing effects.

    Parameters
    ----------
    d : Diagnosis

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.identification.diagnose import diagnose
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.documents.samples import sample_path
    >>> log = read_log(sample_path()).between(0.0, 15.0)
    >>> found = diagnose(hc.vehicle("c17_experiment"), [log], names=["slope"])
    >>> headline(found)
    'Missing: nothing beyond noise.'
    """
    if d.effects:
        said = [_named(d, name, numbers) for name, numbers in numbers_by_effect(d).items()]
        return f"Missing: {'; '.join(said)}."
    if not (any(r.there for r in d.remainders) or any(s.there for s in d.slow_errors)):
        return "Missing: nothing beyond noise."
    nearest = [_lead(lead) for lead in d.leads[: SIGNIFICANCE.nearest] if lead.gain > CRITERIA.least]
    came = f"; nearest {'comes' if len(nearest) == 1 else 'come'} {listed(nearest)}" if nearest else ""
    return f"Missing: a residual that no candidate effect explains{came}."


def _lead(lead: Lead) -> str:
    """Return a candidate as text with the reason why it is not named, or the option that would include it."""
    if lead.reason == ASKED_FOR:
        return f"{effect_words(lead.name)} (named where it is asked for: --effects {lead.name})"
    return f"{effect_words(lead.name)} ({lead.reason})"


def _named(d: Diagnosis, name: str, numbers: Sequence[Found]) -> str:
    """Return an effect with its parameters, equivalent effects and undistinguished rivals."""
    rivals = [r for r in d.rivals if r.instead_of == name]
    doubtful = listed([effect_words(r.name) for r in rivals if not r.same], "or")
    same = listed([effect_words(r.name) for r in rivals if r.same], "or")
    said = (
        f"{effect_words(name)}, {_function(d, name) or numbers_of(numbers)}"
        if numbers
        else effect_words(name)
    )
    region = d.region(name) if numbers and not any(key_of(n) == "at" for n in numbers) else []
    if region and d.function(name) is None:
        said += f", for {range_words(region, d.amended.law_units())}"
    if same and is_law(name):
        said += f" (or {same}: the same in these logs, but it breaks a symmetry of the model)"
    elif same:
        said += f" (or {same}: both have the same effect on every log)"
    return f"{said}, or else {doubtful}: these logs do not distinguish them" if doubtful else said


def _function(d: Diagnosis, name: str) -> str:
    """Return an effect that is a table as text: its largest value, and where it is zero; else empty."""
    function = d.function(name)
    if function is None:
        return ""
    grid, values = function["grid"], function["values"]
    k = max(range(len(values)), key=lambda k: abs(values[k]))
    argument = function["signals"][0]
    signal = argument.removeprefix("abs(").removesuffix(")")
    of, own = unit(d.amended.law_units()[signal]), unit(next(n.unit for n in d.effects if n.effect == name))
    zero = [f"below {grid[0]:.3g}"] if values[0] == 0.0 else []
    zero += [f"above {grid[-1]:.3g}"] if values[-1] == 0.0 else []
    largest = f"{plus_minus(values[k], function['std'][k])} {own} where {argument} is {grid[k]:.3g} {of}"
    return f"{largest}, zero {' and '.join(zero)} {of}".strip()


def numbers_of(numbers: Sequence[Found]) -> str:
    """Return the parameters of one effect, each with its standard error and unit."""
    if len(numbers) == 1:
        return number_of(numbers[0])
    return listed([f"{key_of(n) or 'value'} {number_of(n)}" for n in numbers])


def key_of(number: Found) -> str:
    """Return the name of a parameter within its effect; empty for the coefficient."""
    return number.parameter.removeprefix(number.effect).lstrip("_").replace("_", " ")


@checked
def gap_sentence(d: Diagnosis) -> str:
    """Return one sentence on the held-out error: the fraction explained, its rise, or its size.

    Parameters
    ----------
    d : Diagnosis

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.identification.diagnose import diagnose
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.documents.samples import sample_path
    >>> log = read_log(sample_path()).between(0.0, 15.0)
    >>> found = diagnose(hc.vehicle("c17_experiment"), [log], names=["slope"])
    >>> gap_sentence(found).partition(";")[0]
    'No log was held out'
    """
    held = d.held_before is not None
    if not d.effects:
        return _error_of_noise(d)
    far = d.ahead or ahead(d.selection.base, d.selection.final).each
    where = f"On the {held_out_words(d)}" if held else "No log was held out; on the training logs"
    best = most_fallen(far)
    one = len(numbers_by_effect(d)) == 1
    if best is None:
        return f"{where} {_risen(far, [e.gained for e in d.evidence.values() if e.gained])}."
    fall = 1.0 - best.after / best.before
    part = f"{percent(fall) if fall >= 0.01 else 'less than 1 %'} of the error of {best.channel}"
    figures = f"{small(best.before)} to {small(best.after)} {unit(best.unit)}".strip()
    who = "it removes" if one else "they remove"
    return f"{where} {who} {part} {best.horizon:.2g} s ahead ({figures})."


def _risen(far: Sequence[Ahead], gains: Sequence[Gained]) -> str:
    """Return text on the error that rises most, and whether the log is likelier; or that none falls."""
    risen = [a for a in far if a.t <= -SIGNIFICANCE.sure and a.after > a.before]
    if not risen:
        return "no channel is predicted significantly better"
    most = max(risen, key=lambda a: a.after / a.before)
    figures = f"{small(most.before)} to {small(most.after)} {unit(most.unit)}".strip()
    least = min((g.gain for g in gains), default=0.0)
    likelier = (
        f", though the log is likelier (twice its log likelihood gains {least:.3g})" if least > 0 else ""
    )
    return f"the error of {most.channel} {most.horizon:.2g} s ahead rises from {figures}{likelier}"


def most_fallen(far: Sequence[Ahead]) -> Ahead | None:
    """Return the channel and horizon with the largest significant fall of the error."""
    fallen = [a for a in far if a.t >= SIGNIFICANCE.sure and a.after < a.before]
    return max(fallen, key=lambda a: 1.0 - a.after / a.before, default=None)


def _error_of_noise(d: Diagnosis) -> str:
    """Return a sentence on the error that is largest in multiples of its noise."""
    gap = d.before or d.train_before
    ratios = {c: e / max(gap.floor[c], 1e-12) for c, e in gap.nrmse.items()}
    worst = max(ratios, key=lambda c: ratios[c])
    where = f"On the {held_out_words(d)}" if d.before else "No log was held out; on the training logs"
    told = f"{small(gap.rms[worst])} {unit(d.selection.base.problem.block.signal(worst).unit)}".strip()
    return (
        f"{where} the error of {worst} {gap.horizon:.2g} s ahead is {told}, {times(ratios[worst])} times its "
        "noise, the largest of all channels."
    )


@checked
def remainder_sentence(d: Diagnosis) -> str:
    """Return one sentence on the remainder: its size by equation, and where it acts.

    Parameters
    ----------
    d : Diagnosis

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.identification.diagnose import diagnose
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.documents.samples import sample_path
    >>> log = read_log(sample_path()).between(0.0, 15.0)
    >>> found = diagnose(hc.vehicle("c17_experiment"), [log], names=["slope"])
    >>> remainder_sentence(found)
    'Unmodelled residual: none beyond noise.'
    """
    left = [r for r in d.remainders if r.there]
    slow = [
        f"lasting errors of {small(s.rms)} {unit(s.unit)} in measured {s.channel} (noise: {small(s.noise)})"
        for s in d.slow_errors
    ]
    if not left:
        near = listed([f"{effect_words(t.name)} gains {t.gain:.3g}" for t in d.selection.undecided])
        doubt = f"nothing sure, but {near} in twice the log likelihood"
        return f"Unmodelled residual: {listed(slow) or (doubt if near else 'none beyond noise')}."
    sizes = listed([f"{small(r.rms)} {unit(r.unit)} in {prime(r.equation)}" for r in left])
    same = [m for m in d.missing_after if any(m.equation == r.equation for r in left)]
    where = prime(regime(same))
    most = "" if where.startswith("nowhere") else f"; it is largest {where}"
    said = f"{sizes} (averaged over {left[0].over:.2g} s){most}"
    return f"Unmodelled residual: {'; '.join([said, *slow])}."


def verdict(m: Context) -> str:
    """Return the first section of the page: the sentences, with bars of the error."""
    d = m.diagnosis
    said = [f.sentence() for f in d.functions]
    said += [_explained(d.amended.effect(n)) for n in numbers_by_effect(d)]
    said += [_explained(r.fit.model.effect(r.name)) for r in d.rivals if not r.same]
    said += _in_several_equations(d)
    if d.verdict == "none":
        said.append(
            "With its coefficients fitted again, the model explains these logs down to the noise of their "
            "measurements. An effect that these logs do not excite would not be seen."
        )
    return render(
        "verdict.html",
        verdict=d.verdict,
        meaning=MEANS[d.verdict],
        headline=headline(d),
        gap=gap_sentence(d),
        remainder=remainder_sentence(d),
        named=bool(d.effects),
        explained=said,
        **_bars(m),
    )


def _in_several_equations(d: Diagnosis) -> list[str]:
    """Return a sentence for each form that named effects have in several equations."""
    named = numbers_by_effect(d)
    groups = (g for g in of_one_form(d.amended) if all(n in named for n in g))
    return [
        f"{listed([effect_words(n) for n in g])}: one form in {len(g)} equations, as of one force that does "
        "not act at the centre of mass."
        for g in groups
    ]


def _explained(e: Effect) -> str:
    """Return the name of an effect with its description."""
    words = effect_words(e.name)
    name, text = words if is_law(e.name) else words.capitalize(), meaning(e)
    return text if text.startswith(f"{name}:") else f"{name}: {text}"


def _bars(m: Context) -> dict[str, object]:
    """Return bars of each channel's error at one horizon, with their title and legend."""
    kinds = legend("before", "after") if m.changed else legend("before")
    if not m.ahead:
        return {"bars": "", "bars_title": "", "kinds": kinds}
    best = most_fallen(m.ahead) if m.changed else None
    horizon = best.horizon if best else min((a.horizon for a in m.ahead), key=lambda h: abs(h - 1.0))
    bars = pictures.error_bars([a for a in m.ahead if a.horizon == horizon], m.changed, m.noise)
    alone = "" if m.changed else ", in multiples of the noise"
    title = f"Error {horizon:.2g} s ahead on the {m.shown_on}{alone}"
    return {"bars": bars, "bars_title": title, "kinds": kinds}
