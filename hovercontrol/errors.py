"""The one kind of error a user causes: wrong input, said in one line.

Everything the user can get wrong (a name, a unit, a row of a log) raises :class:`InputError`. The command
line prints its text and ends with status 2; scripts catch it like any :class:`ValueError`.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """What was expected, what was found and where, in one line."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of an error line: the nearest known name, or what there is to choose from.

    Examples
    --------
    >>> did_you_mean("yaw_colomb", ["yaw_coulomb", "thrust"])
    "; did you mean 'yaw_coulomb'?"
    >>> did_you_mean("zzz", ["b", "a"])
    '; known: a, b'
    """
    names = sorted(known)
    nearest = get_close_matches(name, names, n=1, cutoff=0.6)
    if nearest:
        return f"; did you mean {nearest[0]!r}?"
    return f"; known: {', '.join(names)}" if names else "; there are none"
