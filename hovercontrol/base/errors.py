"""The error for wrong input, with a one-line message.

Everything the user can get wrong (a name, a unit, a row of a log) raises :class:`InputError`. The command
line prints its text and ends with status 2; scripts catch it like any :class:`ValueError`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from typing import Any

#: Longest line of an error, longest name that is compared with others, most names that are listed.
LONGEST_LINE, LONGEST_NAME, MOST_NAMES = 1000, 100, 60


class InputError(ValueError):
    r"""Wrong input: what was expected, what was found and where, in one line.

    Examples
    --------
    >>> str(InputError("log.csv, row 3:\n  no number"))
    'log.csv, row 3: no number'
    """

    def __init__(self, text: object = "") -> None:
        super().__init__(one_line(text))


class ArgumentError(InputError):
    """Wrong input of which the log is not at fault, but what the caller says of it: a name, a unit, a frame.

    Examples
    --------
    >>> isinstance(ArgumentError("frame: expected one of ned, found 'nde'"), InputError)
    True
    """


class CallError(InputError, TypeError):
    """A call with an unknown, a missing or a surplus argument; a :class:`TypeError`, as Python raises.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> try:
    ...     hc.circle(1.0, rat=0.2)
    ... except CallError as error:
    ...     print(error)
    circle: got an unexpected keyword argument 'rat'; did you mean 'rate'?
    """


class SmoothedFrictionWarning(UserWarning):
    """A pole of a linear system comes from the smoothing of dry friction, not from the craft.

    Parameters
    ----------
    text : object
        One line: the pole, the velocity, the width of the smoothing, and what to use instead.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():  # where the smoothed slope is what is wanted
    ...     warnings.simplefilter("ignore", SmoothedFrictionWarning)
    """

    def __init__(self, text: object = "") -> None:
        super().__init__(one_line(text))


def one_line(text: object, longest: int = LONGEST_LINE) -> str:
    r"""Return a text as one line that a terminal shows as it is.

    Examples
    --------
    >>> one_line("a\n  b \x1b[31m")
    'a b \\x1b[31m'
    """
    raw = text if isinstance(text, str) else str(text)
    line = " ".join(raw[: 4 * longest].split())
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)
    return line if len(line) <= longest else f"{line[: longest - 40]} ... {line[-30:]}"


def shown(value: Any, longest: int = 80) -> str:
    """Return how a value is written in an error line, however large it is.

    Examples
    --------
    >>> shown("a"), shown(10**5000), shown(list(range(99)), 20)
    ("'a'", 'a number of 5001 digits', '[0, 1, 2, 3...98]')
    """
    if isinstance(value, int) and abs(value) >= 10**40:
        return f"a number of {_digits(value)} digits"
    try:
        text = one_line(repr(value), 10 * longest)
    except (Exception, SystemExit):  # a list of huge numbers; a class of the user's that cannot be shown
        return f"a {type(value).__name__}"
    return text if len(text) <= longest else f"{text[: longest - 8]}...{text[-4:]}"


def _digits(value: int) -> int:
    """Return the number of digits of a huge number, which may be too long to be written."""
    guess = int(abs(value).bit_length() * 0.30102999566398120)
    return guess + (abs(value) >= 10**guess)


def did_you_mean(name: object, known: Iterable[object]) -> str:
    """Return the end of an error line: the nearest known name, or what there is to choose from.

    A name is never proposed in its own place.

    Examples
    --------
    >>> did_you_mean("yaw_colomb", ["yaw_coulomb", "thrust"])
    "; did you mean 'yaw_coulomb'?"
    >>> did_you_mean("zzz", ["b", "a"])
    '; known: a, b'
    """
    names = sorted(str(one)[:LONGEST_NAME] for one in known if str(one) != name)
    words = {word: one for one in reversed(names) for word in [*one.split("_"), one]}
    nearest = get_close_matches(
        name[:LONGEST_NAME] if isinstance(name, str) else shown(name), words, n=1, cutoff=0.6
    )
    if nearest:
        return f"; did you mean {words[nearest[0]]!r}?"
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return f"; known: {', '.join(names[:MOST_NAMES])}{more}" if names else "; there are none"


def by_last_part(name: str, known: Collection[str]) -> str:
    """Return the one known name that ends in ``.NAME``; the name itself if it is known or several end so.

    Examples
    --------
    >>> by_last_part("u", ["plant.u", "plant.v"]), by_last_part("u", ["plant.u", "estimator.u"])
    ('plant.u', 'u')
    """
    found = [one for one in known if one.rpartition(".")[2] == name]
    return found[0] if name not in known and len(found) == 1 else name


def check_known(name: object, known: Collection[object], text: str) -> None:
    """Raise if a name is not among the known ones; the error is the text and the nearest known name.

    Examples
    --------
    >>> check_known("thrst", ["thrust", "rudder"], "controller: no input 'thrst'")
    Traceback (most recent call last):
    hovercontrol.base.errors.InputError: controller: no input 'thrst'; did you mean 'thrust'?
    """
    if name not in known:
        raise InputError(f"{text}{did_you_mean(name, known)}")
