"""Selection of the coefficients to estimate."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.models.interface import AnyModel, as_model


def chosen(model: AnyModel, names: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names of the coefficients to estimate, as the model names them.

    Parameters
    ----------
    names : sequence of str or None
        Names with or without the Block's name as prefix; default: all linear coefficients.

    Raises
    ------
    InputError
        If a name is unknown (the message names the nearest) or listed twice, or the model has no
        coefficients.
    """
    subject = as_model(model)
    known = subject.coefficients()
    if names is None:
        found = list(subject.linear_coefficients())
    else:
        found = []
        for name in names:
            if name not in known and name.rpartition(".")[2] not in known:
                hint = did_you_mean(name, known)
                raise InputError(f"{model.name!r} has no coefficient {name!r}{hint}")
            found.append(name if name in known else subject.coefficient_name(name))
        twice = [name for name, own in zip(names, found, strict=True) if found.count(own) > 1]
        if twice:
            raise InputError(f"coefficient {twice[0]!r} is named twice")
    if not found:
        raise InputError(f"{model.name!r} has no coefficients to identify")
    return tuple(found)
