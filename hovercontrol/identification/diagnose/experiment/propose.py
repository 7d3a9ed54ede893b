"""The next experiment: commands that distinguish rivals, or reduce a large standard error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.craft.effects.law import is_law
from hovercontrol.identification.diagnose.experiment.predict import PROPOSAL, Search
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.diagnose.experiment.separate import Other, separate
from hovercontrol.identification.diagnose.experiment.sharpen import sharpen, sharpen_missing
from hovercontrol.identification.diagnose.search.confirm import Selection
from hovercontrol.identification.diagnose.unknown.forms import rivals_of
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.engine.fit import Fit

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.diagnosis import Found


def next_experiment(
    selection: Selection,
    effects: Sequence[Found],
    functions: Sequence[FittedFunction] = (),
    lacking: Sequence[str] = (),
    search: Search | None = None,
) -> tuple[Experiment | None, str]:
    """Return the next experiment and a sentence on it; None and an empty text if none is needed.

    It tells rivals apart, or else shows most of a remainder, or else reduces a large standard error.

    Parameters
    ----------
    effects : sequence of Found
        Parameters of the named effects.
    functions : sequence of FittedFunction, optional
        Unknown functions, with their forms.
    lacking : sequence of str, optional
        States in whose equations a remainder is left.
    search : Search, optional
        The manoeuvres.
    """
    final, search = selection.final, search or Search()
    # twins shift every log alike; laws that are the same in these logs may differ in others
    apart = sorted((r for r in selection.rivals if not r.same or is_law(r.name)), key=lambda r: r.same)
    if apart:
        name = apart[0].instead_of
        others = [Other(r.fit, r.name, r.behind) for r in apart if r.instead_of == name]
        return _proposed(separate(final, name, others, search=search))
    for f in functions:
        best, rivals = f.forms[0], rivals_of(f)
        others = [Other(r.fit, r.text, 2.0 * math.log(best.odds(r))) for r in rivals]
        if others:
            return _proposed(separate(best.fit, f"{f.name} = {best.text}", others, search=search))
    missing, why = sharpen_missing(final, lacking, search=search) if lacking else (None, "")
    if missing:
        return missing, why
    if selection.rivals:
        return None, same_time((selection.rivals[0].instead_of, selection.rivals[0].name))
    sharper = _of_large_error(final, effects, functions, search)
    return sharper, sharper.text if sharper else why


def _of_large_error(
    final: Fit, effects: Sequence[Found], functions: Sequence[FittedFunction], search: Search
) -> Experiment | None:
    """Return the manoeuvre that most reduces the largest relative standard error, if that is large."""
    own = [(n.std, n.value, final, [n.parameter], n.parameter) for n in effects]
    for f in functions:
        form = f.forms[0]
        known = form.function.parameters
        if form.numbers:
            numbers = zip(known, form.numbers.values(), strict=True)
            own += [(std, value, form.fit, [p], p) for p, (value, std) in numbers]
        else:
            std, size = (float(np.sqrt(np.mean(a**2))) for a in (f.std, f.values))
            own += [(std, size, form.fit, list(known), f"the table of {f.name}")]
    relative = [
        (abs(std) / max(abs(value), 1e-12), fit, parameters, name)
        for std, value, fit, parameters, name in own
        if set(parameters) <= set(fit.problem.names)
    ]
    error, fit, parameters, name = max(relative, key=lambda one: one[0], default=(0.0, final, [], ""))
    return sharpen(fit, parameters, name, search=search) if error > PROPOSAL.badly else None


def _proposed(found: Experiment | str) -> tuple[Experiment | None, str]:
    return (None, found) if isinstance(found, str) else (found, found.text)


def same_time(names: tuple[str, str]) -> str:
    """Return why no manoeuvre distinguishes two effects that are both time shifts."""
    first, second = names
    return (
        f"no log distinguishes {first} from {second}: a delay of the commands and late time stamps shift "
        f"every log alike; use one clock for commands and sensors, or measure the delay of a sensor "
        f"separately"
    )
