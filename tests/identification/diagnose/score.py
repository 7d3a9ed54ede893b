"""How an outcome counts: right, honest, missed or wrong."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, get_args

Outcome = Literal["right", "honest", "missed", "wrong"]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)

#: In a log a delay of all commands is a clock that is late: one finding under two names.
ONE_FINDING = {"time_offset": "input_delay"}


def outcome(
    hidden: Iterable[str],
    verdict: str,
    named: Iterable[str],
    rivals: Iterable[tuple[str, str]] = (),
    *,
    remainder: bool = False,
) -> Outcome:
    """Return how an outcome counts.

    ========  ======================================================================================
    right     the hidden effects and nothing else are named, with the verdict `effect` or `partial`;
              where none is hidden: the verdict `none`, or, where a remainder is there, `unexplained`
    honest    `ambiguous`, where each hidden effect is named or a rival, and each false name has a
              hidden effect as its rival; `unexplained`, or `partial` without a false name, though an
              effect was hidden
    missed    `none` though an effect was hidden; `effect` that names only some of those hidden
    wrong     all else: a false name, an alarm where nothing is missing
    ========  ======================================================================================

    A delay of the commands and an offset of the clock are one finding: each counts as the other, and they
    are no rivals of each other.

    Parameters
    ----------
    hidden : iterable of str
        Effects of the catalogue that were hidden.
    verdict : str
    named : iterable of str
        Effects that are named.
    rivals : iterable of (str, str)
        Each rival and what it may stand in the place of.
    remainder : bool, optional
        Whether something acted that is in no catalogue.

    Examples
    --------
    >>> outcome(["slope"], "partial", ["slope"], remainder=True)
    'right'
    >>> outcome(["slope"], "ambiguous", ["wind"], [("slope", "wind")])
    'honest'
    >>> outcome([], "effect", ["wind"], remainder=True)
    'wrong'
    """
    truth, names = _findings(hidden), _findings(named)
    pairs = {(a, b) for a, b in ((_finding(a), _finding(b)) for a, b in rivals) if a != b}
    if verdict == "ambiguous" and not pairs and names:
        verdict = "effect"
    false = names - truth
    if verdict == "none":
        return "missed" if truth else "right"
    if verdict == "unexplained":
        if truth:
            return "honest"
        return "right" if remainder else "wrong"
    if verdict in ("effect", "partial"):
        if false or not truth:
            return "wrong"
        if names == truth:
            return "right"
        return "honest" if verdict == "partial" else "missed"
    if verdict == "ambiguous":
        inside = names | {a for a, _ in pairs}
        settled = all(any(a in truth for a, b in pairs if b == name) for name in false)
        return "honest" if truth and truth <= inside and settled else "wrong"
    raise ValueError(f"unknown verdict {verdict!r}")


def _finding(name: str) -> str:
    return ONE_FINDING.get(name, name)


def _findings(names: Iterable[str]) -> set[str]:
    return {_finding(name) for name in names}


def shares(outcomes: Sequence[str]) -> dict[Outcome, int]:
    """Return how many of each."""
    return {o: sum(x == o for x in outcomes) for o in OUTCOMES}
