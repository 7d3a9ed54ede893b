"""PySINDy on residuals: sparse regression of what the model leaves on a library of laws.

Brunton, Proctor, Kutz, PNAS 113 (2016); Kaptanoglu et al., JOSS 7 (2022) 3994. The model's coefficients are
refitted beside the library. Two of its optimizers propose sets of terms: thresholded least squares (STLSQ) at
16 thresholds and greedy orthogonal least squares (FROLS) with 1 to 4 terms. Set and window of smoothing are
chosen by the held-out log; fewer terms where more gain little.
"""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
import sympy as sp
from threadpoolctl import threadpool_limits

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.benchmark.answer import Answer, Term
from hovercontrol.identification.benchmark.rivals.residuals import (
    Residuals,
    beside,
    columns_of,
    refitted,
    residuals,
    solved,
)
from hovercontrol.logs import Log

WINDOWS = (7, 15, 31)
#: Thresholds, relative to the scatter of the residual, of columns of unit scatter.
THRESHOLDS = tuple(np.geomspace(0.02, 0.8, 16))
#: A further term counts if the held-out mean square falls by this share of what it is without any.
WORTH = 0.02
#: Terms of an equation: of the greedy search, and at most.
MOST, MOST_TERMS = 4, 8
#: Two columns that correlate more are one.
TWINS = 0.999


def library(block: Block) -> list[sp.Expr]:
    """Return the laws: one, powers, absolute values, signs, products of two signals, sines of angles."""
    positions = {s.symbol for s in block.states if s.unit == "m"}
    every = [s for s in (*block.states, *block.inputs) if s.symbol not in positions]
    angles = [s.symbol for s in block.states if s.unit == "rad"]
    free = [s.symbol for s in every if s.symbol not in angles or _acts(block, s.symbol)]
    found: list[sp.Expr] = [sp.S.One]
    for a in free:
        found += [a, sp.Abs(a) * a, a**2, a**3, sp.sign(a)]
    for a, b in itertools.combinations(free, 2):
        found += [a * b, sp.Abs(a) * b, sp.Abs(b) * a, a**2 * b, b**2 * a]
    for q in angles:
        found += [sp.sin(q), sp.cos(q), sp.sin(2 * q), sp.cos(2 * q)]
    return found


def _acts(block: Block, angle: sp.Symbol) -> bool:
    """Return whether an angle bears on an equation other than a position's."""
    return any(
        angle in block.expand(block.derivatives[s.name]).free_symbols for s in block.states if s.unit != "m"
    )


def answer(model: AnyModel, train: tuple[Log, ...], holdout: Log) -> Answer:
    """Return the answer of PySINDy on the residuals of the model.

    Raises
    ------
    InputError
        If pysindy is not installed.
    """
    try:
        from pysindy.optimizers import FROLS, STLSQ  # type: ignore[import-untyped]
    except ImportError:
        raise InputError('--tool sindy needs pysindy: pip install ".[rivals]"') from None
    block = as_model(model).plant()
    laws = library(block)
    best: dict[str, tuple[float, list[int], list[Residuals]]] = {}
    with threadpool_limits(1, "blas"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # thresholds that leave nothing are part of the search
        optimizers = [FROLS(max_iter=k) for k in range(1, MOST + 1)]
        optimizers += [STLSQ(threshold=t, alpha=1e-6) for t in THRESHOLDS]
        for window in WINDOWS:
            fits, held = [residuals(block, log, window) for log in train], residuals(block, holdout, window)
            for equation in fits[0].left:
                score, chosen = _sparse(optimizers, laws, block, fits, held, equation)
                if equation not in best or score < best[equation][0]:
                    best[equation] = score, chosen, fits
        terms = [(e, laws[j]) for e, (_, chosen, _) in best.items() for j in chosen]
        smoothest = min(best.values(), key=lambda b: b[0])[2]
        amended, found = refitted(block, smoothest, terms)
    told = tuple(Term(e, str(law), value, std) for e, law, value, std in found)
    return Answer("missing" if told else "none", told, amended)


def _sparse(
    optimizers: list[Any],
    laws: list[sp.Expr],
    block: Block,
    fits: list[Residuals],
    held: Residuals,
    equation: str,
) -> tuple[float, list[int]]:
    """Return the held-out score of one equation, and the chosen laws.

    The score is the mean square of what remains of the held-out residual, over the same of the refitted model
    without any term.
    """
    known = np.concatenate([f.known[equation] for f in fits])
    whole = np.concatenate([columns_of(laws, block, f) for f in fits])
    y_all = np.concatenate([f.left[equation] for f in fits])
    y, rest = beside(y_all, known), beside(whole, known)
    sizes, before = rest.std(axis=0), np.sqrt(np.mean(whole**2, axis=0))
    keep: list[int] = []
    for j in np.flatnonzero(sizes > 0.02 * before):  # others are what the model has already
        unit = rest[:, j] / np.linalg.norm(rest[:, j])
        if all(abs(unit @ rest[:, i]) < TWINS * np.linalg.norm(rest[:, i]) for i in keep):
            keep.append(int(j))
    scale = float(y.std()) or 1e-300
    a, target = rest[:, keep] / sizes[keep], (y / scale)[:, None]
    wanted, held_known = held.left[equation], held.known[equation]
    held_columns = columns_of(laws, block, held)

    def remains(chosen: tuple[int, ...]) -> float:
        """Return the held-out mean square with coefficients of the training logs."""
        c = solved(np.column_stack([known, whole[:, chosen]]), y_all)
        return float(np.mean((wanted - np.column_stack([held_known, held_columns[:, chosen]]) @ c) ** 2))

    sets = {tuple(keep[j] for j in np.flatnonzero(o.fit(a, target).coef_[0])) for o in optimizers if keep}
    nothing = remains(())
    best = nothing
    chosen: tuple[int, ...] = ()
    for terms in sorted(sets, key=lambda s: (len(s), s)):  # few terms first
        if 0 < len(terms) <= MOST_TERMS:
            left = remains(terms)
            if left < best - WORTH * nothing * (len(terms) - len(chosen)):
                best, chosen = left, terms
    return best / nothing if chosen else 1.0, list(chosen)
