"""Selection of the coefficients to estimate."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.engine.subject import named, same_widths, unknowns


def chosen(
    model: AnyModel, names: Sequence[str] | None, fixed: Sequence[str] = (), filled: Sequence[str] = ()
) -> tuple[str, ...]:
    """Return the names of the coefficients to estimate, as the model names them.

    Parameters
    ----------
    names : sequence of str or None
        Names with or without the Block's name as prefix; default: a craft's linear coefficients, or all
        parameters of a Block.
    fixed : sequence of str, optional
        Names of coefficients that keep their values.
    filled : sequence of str, optional
        Parameters of tables in place of unknown functions, which are always estimated and not returned.

    Raises
    ------
    InputError
        If a name is unknown (the message names the nearest), listed twice, both fitted and fixed, or no
        coefficient is left.
    """
    subject = as_model(model)
    kept = named(subject, fixed)
    found = subject.free_coefficients() if names is None else named(subject, names)
    told = {*unknowns(subject), *same_widths(subject)}
    for name in found:
        if name not in told:
            raise InputError(f"{name!r} is a constant of its effect, which logs do not tell: leave it out")
    both = [name for name in found if name in kept] if names is not None else []
    if both:
        raise InputError(f"coefficient {both[0]!r} is to be fitted and fixed")
    found = tuple(name for name in found if name not in (*kept, *filled))
    if not found and not filled:
        raise InputError(
            f"{model.name!r} has no coefficients to identify{' that are not fixed' if kept else ''}"
        )
    return found
