"""Simple laws of a missing force in one velocity or command; without one, the conditions where it acts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.unitsyntax import parse_unit
from hovercontrol.identification.diagnose.evidence.missing import Missing


@dataclass(frozen=True)
class LawCriteria:
    """Settings that decide whether a missing force follows a simple law, and where it is reported to act.

    No published source: set by hand, exercised by tests/identification/diagnose/test_laws.py.

    Attributes
    ----------
    most : float
        Minimum fraction of the force's mean square that a law must explain.
    simpler : float
        Fraction that it must explain in addition to a simpler law.
    there : float
        Fraction of the rows in which a force must be significant.
    small : float
        Force relative to the spread of its velocity below which it is ignored [1/s].
    still : float
        A quantity below this fraction of its root mean square counts as near zero.
    step : float
        A change of a command by more than this fraction of its root mean square is a step.
    fresh : float
        Time after a step within which rows count as just after it [s].
    """

    most: float = 0.75
    simpler: float = 0.02
    there: float = 0.01
    small: float = 0.02
    still: float = 0.1
    step: float = 0.5
    fresh: float = 0.3


#: The values in use.
LAWS = LawCriteria()


#: Laws, simplest first: text, power of the quantity's unit, function of the quantity x and its size (rms).
_SHAPES: tuple[tuple[str, int, Callable[[Array, float], Array]], ...] = (
    ("constant: about {c}", 0, lambda x, size: np.ones_like(x)),
    ("in proportion to {x}: about {c} times {x}", 1, lambda x, size: x),
    ("with the sign of {x}: about {c}", 0, lambda x, size: np.tanh(x / (LAWS.still * size))),
    ("like {x}^2: about {c} times {x}^2", 2, lambda x, size: x**2),
    ("like {x} |{x}|: about {c} times {x} |{x}|", 2, lambda x, size: x * np.abs(x)),
)


@dataclass(frozen=True)
class Law:
    """A missing force as a simple function of one quantity.

    Attributes
    ----------
    quantity : str
        A velocity or command: ``"r"``; empty for a constant.
    value : float
        Factor of the function.
    unit : str
        Unit of the value.
    explained : float
        Fraction of the force's mean square that the law explains.
    text : str
        ``"in proportion to r: about -2.46 1/s times r"``.
    """

    quantity: str
    value: float
    unit: str
    explained: float
    text: str


def law(forces: Sequence[Missing]) -> Law | None:
    """Return the simple law that the missing force of one equation follows, if there is one.

    Parameters
    ----------
    forces : sequence of Missing
        Of one equation, log by log.
    """
    found = [law for law in laws(forces) if law.explained > LAWS.most]
    most = max((law.explained for law in found), default=0.0)
    return next((law for law in found if law.explained > most - LAWS.simpler), None)


def laws(forces: Sequence[Missing]) -> list[Law]:
    """Return every simple law, fitted to the missing force of one equation, the simplest first.

    With the force f and its standard error s in each row, and the function phi of a law::

        value = sum(phi f / s^2) / sum(phi^2 / s^2),    explained = value^2 sum(phi^2 / s^2) / sum(f^2 / s^2)

    Parameters
    ----------
    forces : sequence of Missing
        Of one equation, log by log.
    """
    force, band = (np.concatenate([getattr(m, key) for m in forces]) for key in ("force", "band"))
    found = []
    for words, power, shape in _SHAPES:
        same: list[Law] = []
        for k, quantity in enumerate(forces[0].over):
            x = np.concatenate([m.over[k].values for m in forces])
            known = np.isfinite(x) & np.isfinite(force) & (band > 0.0)
            size = _size(x[known])
            if not size or ("{x}" not in words and same):
                continue
            column, weight = shape(x[known], size), band[known] ** -2
            whole, along = float(weight @ force[known] ** 2), float(weight @ column**2)
            value = float(weight @ (column * force[known])) / along
            explained = value**2 * along / whole if whole > 0.0 else 0.0
            name = quantity.name if "{x}" in words else ""
            unit = _quotient(forces[0].unit, quantity.unit, power)
            text = words.format(x=name, c=f"{value:.3g} {unit}".strip())
            same.append(Law(name, value, unit, explained, text))
        found += sorted(same, key=lambda law: -law.explained)
    return found


def _quotient(above: str, below: str, power: int) -> str:
    """Return the unit of a coefficient, as ``"1/s"``."""
    found = f"{parse_unit(above) / parse_unit(below) ** power:~C}".replace("**", "^")
    return above if power == 0 else "" if found in ("1", "") else found


def is_there(force: Missing) -> bool:
    """Whether a force is significant in enough rows, and not negligible in size."""
    return force.share >= LAWS.there and force.rms >= small(force)


def small(force: Missing) -> float:
    """Return the size below which a force is negligible: a fraction of its velocity's spread, per second."""
    own = next((q.values for q in force.over if f"{q.name}'" == force.equation), np.zeros(1))
    known = own[np.isfinite(own)]
    return LAWS.small * float(known.std()) if known.size else 0.0


def worst(missing: Sequence[Missing]) -> Missing | None:
    """Return the force with the largest share of significant rows times size over acceleration."""
    return max(missing, key=lambda m: m.share * m.rms / m.seen, default=None)


def regime(missing: Sequence[Missing]) -> str:
    """Return as text where the missing force of the worst equation acts, and on what the others depend.

    Parameters
    ----------
    missing : sequence of Missing
        Of all logs and equations.
    """
    first = worst(missing)
    if first is None or first.share < LAWS.there:
        return "nowhere beyond the noise"
    said = []
    for equation in dict.fromkeys([first.equation, *(m.equation for m in missing)]):
        same = [m for m in missing if m.equation == equation]
        found = law(same) if any(is_there(m) for m in same) else None
        if found:
            said.append(f"in {equation}, {found.text}")
        elif equation == first.equation:
            said.append(f"in {equation}, {_where(same)}")
    return "; ".join(said)


def regime_of(same: Sequence[Missing]) -> str:
    """Return as text where the force of one equation acts, or on what it depends; empty if not significant.

    Parameters
    ----------
    same : sequence of Missing
        Of that equation, log by log.
    """
    return regime(same).partition(", ")[2] if any(is_there(m) for m in same) else ""


def _where(same: Sequence[Missing]) -> str:
    """Return the condition that best separates large from small force of one equation, as text.

    The criterion is the ratio of the mean square force in the rows where the condition holds to that in the
    others; below 1.5 the force acts "all along".
    """
    force = np.concatenate([m.force for m in same])
    best, words = 1.5, "all along"
    for text, rows in _conditions(same):
        inside = rows & np.isfinite(force)
        outside = ~rows & np.isfinite(force)
        if inside.mean() < 0.05 or outside.mean() < 0.05:
            continue
        ratio = float(np.mean(force[inside] ** 2) / max(np.mean(force[outside] ** 2), 1e-300))
        if ratio > best:
            best, words = ratio, text
    return words


def _conditions(same: Sequence[Missing]) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return conditions on velocities and commands, each with its text."""
    found = []
    for k, quantity in enumerate(same[0].over):
        name, values = quantity.name, np.concatenate([m.over[k].values for m in same])
        size = _size(values[np.isfinite(values)]) or 1.0
        found += [
            (f"where {name} > 0", values > LAWS.still * size),
            (f"where {name} < 0", values < -LAWS.still * size),
            (f"where {name} is large", np.abs(values) > size),
        ]
        if quantity.is_command:
            fresh = [_fresh(m.time, m.over[k].values, LAWS.step * size, LAWS.fresh * m.tempo) for m in same]
            found.append((f"just after steps of {name}", np.concatenate(fresh)))
        else:
            found.append((f"near standstill of {name}", np.abs(values) < LAWS.still * size))
    time = np.concatenate([(m.time - m.time[0]) / max(m.time[-1] - m.time[0], 1e-9) for m in same])
    return [*found, ("late in each log", time > 0.5), ("early in each log", time < 0.5)]


def _fresh(time: Array, command: Array, step: float, soon: float) -> NDArray[np.bool_]:
    """Return the rows less than `soon` [s] after a step of a command, as a mask."""
    at = time[1:][np.abs(np.diff(command)) > step]
    ago = time - np.concatenate([[-np.inf], at])[np.searchsorted(at, time, side="right")]
    return np.asarray(ago < soon)


def _size(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
