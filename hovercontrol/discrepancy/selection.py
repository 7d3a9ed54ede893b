"""What a search found: effects that were added, their gains, and rivals that logs do not tell from them."""

from __future__ import annotations

from dataclasses import dataclass, field

from hovercontrol.discrepancy.fit import Fit
from hovercontrol.discrepancy.subject import Subject


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that the logs cannot tell from a named one.

    Attributes
    ----------
    name, instead_of : str
    behind : float
        How much less likely it is, in twice the log likelihood, each number more charged (`charged`).
    correlation : float
        Of the two signatures, the model's own unknowns projected out.
    model : Model
        With this effect in the other's place, fitted.
    """

    name: str
    instead_of: str
    behind: float
    correlation: float
    model: Subject


@dataclass(eq=False)
class Selection:
    """What was selected.

    Attributes
    ----------
    base, final : Fit
        The given model and the amended one, fitted alike.
    effects : list of str
        Names of what was added.
    gains : dict of str to float
        Fall of minus twice the log likelihood that each brings.
    rivals : list of Rival
    steps : list of (str, float)
        What was added in which order, with its score.
    rejected : list of (str, str)
        Effects that fit but may not be, with the reason.
    process : bool
        Whether process noise was needed.
    slow : float
        chi2 per degree of freedom that longer windows leave, where neither effects nor process noise explain
        it; else 0.
    """

    base: Fit
    final: Fit
    effects: list[str] = field(default_factory=list)
    gains: dict[str, float] = field(default_factory=dict)
    rivals: list[Rival] = field(default_factory=list)
    steps: list[tuple[str, float]] = field(default_factory=list)
    rejected: list[tuple[str, str]] = field(default_factory=list)
    process: bool = False
    slow: float = 0.0
