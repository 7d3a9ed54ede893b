"""Symmetries of a model under changes of sign, and the laws that keep them.

A craft is the same to port and to starboard: with ``v, r, psi, y, rudder`` reversed, ``v'`` and ``r'`` are
reversed and ``u'`` is unchanged. A motor is the same in both directions. Where logs do not tell two laws
apart, the one that keeps the symmetries of the model is named: in a zigzag ``v r`` and ``abs(v) r`` are the
same up to a sign, but ``v r`` would turn a ship to the same side whichever way it drifts.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from hovercontrol.blocks.block import Block
from hovercontrol.craft.effects.law import TABLES, WINDOWS, Law
from hovercontrol.identification.engine.subject import Subject, structure

#: Functions of a signal that do not change with its sign.
EVEN = ("abs", "sqr", "cos", "cos2", "decaying")

#: Functions that differ for the two signs of their signal.
LOPSIDED = ("over", "under", "logistic", "bell", *WINDOWS, *TABLES)

#: A craft with fans, to port and to starboard: its fans do not change sign, they change place.
MIRROR = dict.fromkeys(("y", "psi", "v", "r", "fan_y", "fan_torque"), -1)

#: Most states and inputs for which all changes of sign are tried.
MOST = 10


#: Changes of sign, each by signal.
Signs = tuple[Mapping[str, int], ...]


def symmetries(model: Subject) -> Signs:
    """Return the changes of sign of states and inputs under which a model's equations stay the same.

    Parameters
    ----------
    model : Model or BlockModel

    Returns
    -------
    tuple of mapping of str to int
        Sign, 1 or -1, of each signal that changes.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> [sorted(signs) for signs in symmetries(hc.vehicle("c17_experiment"))]
    [['psi', 'r', 'rudder', 'v', 'y']]
    """
    if getattr(model, "fans", ()):
        return (MIRROR,)
    return _found(structure(model))


@lru_cache(maxsize=64)
def _found(block: Block) -> Signs:
    signals = (*block.states, *block.inputs)
    if len(signals) > MOST:
        return ()
    n, rng = len(block.states), np.random.default_rng(0)
    size = np.array([s.nominal for s in signals])[:, None]
    at = size * rng.uniform(-1.0, 1.0, (len(signals), 20))
    slopes = block.to_numpy().array_derivatives
    parameters = list(block.default_parameters.values())

    def derivatives(point: np.ndarray) -> np.ndarray:
        found = slopes(np.zeros(point.shape[1]), point[:n], point[n:], parameters)
        return np.stack([np.broadcast_to(f, point.shape[1]) for f in found])

    given = derivatives(at)
    scale = np.abs(given).max(axis=1, keepdims=True) + 1e-300
    kept = []
    for signs in itertools.product((1, -1), repeat=len(signals)):
        sign = np.array(signs)[:, None]
        if min(signs) > 0 or not (np.abs(derivatives(sign * at) - sign[:n] * given) < 1e-9 * scale).all():
            continue
        kept.append({s.name: -1 for s, one in zip(signals, signs, strict=True) if one < 0})
    return tuple(kept)


def broken_by(law: type[Law], signs: Signs) -> int:
    """Return the number of symmetries of a model that a law breaks.

    Parameters
    ----------
    law : type of Law
    signs : tuple of mapping of str to int
        As :func:`symmetries` returns them.

    Examples
    --------
    >>> from hovercontrol.craft.effects.law import law_class
    >>> units, mirror = {"v": "m/s", "r": "rad/s"}, ({"v": -1, "r": -1},)
    >>> [broken_by(law_class(f"law_r__{form}", units), mirror) for form in ("abs_v__r", "v__r")]
    [0, 1]
    """
    return sum(_sign(law, one) != one.get(law.equation, 1) for one in signs)


def _sign(law: type[Law], signs: Mapping[str, int]) -> int:
    """Return the sign of a law under changes of sign; 0 if it changes in another way."""
    found = 1
    for f in law.product:
        if f.operation in LOPSIDED and not f.of_abs and f.signal in signs:
            return 0
        found *= 1 if f.operation in EVEN or f.of_abs else signs.get(f.signal, 1)
    return found
