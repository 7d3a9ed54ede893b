"""PySINDy on residuals: sparse regression of what the model leaves on a library of laws.

Brunton, Proctor, Kutz, PNAS 113 (2016); Kaptanoglu et al., JOSS 7 (2022) 3994. The model's coefficients are
refitted beside the library. Window of smoothing and threshold are chosen by the held-out log; between equals,
fewer terms.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.core.block import Block
from hovercontrol.errors import InputError
from hovercontrol.logs import Log
from hovercontrol.missing_physics.answer import Answer, Term
from hovercontrol.missing_physics.cases import law_unit, with_rates
from hovercontrol.missing_physics.rivals.residuals import Residuals, beside, residuals
from hovercontrol.models.interface import AnyModel, as_model

Array = NDArray[np.float64]

WINDOWS = (7, 15, 31)
#: Thresholds, relative to the scatter of the residual, of columns of unit scatter.
THRESHOLDS = tuple(np.geomspace(0.02, 0.8, 16))
#: A library term counts if the held-out mean square falls by this share; fewer terms are kept within it.
WORTH = 0.02
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
        from pysindy.optimizers import STLSQ  # type: ignore[import-untyped]
    except ImportError:
        raise InputError('--tool sindy needs pysindy: pip install "hovercontrol[rivals]"') from None
    given = as_model(model)
    block = given.plant()
    laws = library(block)
    found: dict[str, tuple[float, list[tuple[sp.Expr, float, float]]]] = {}
    for window in WINDOWS:
        fits, held = [residuals(block, log, window) for log in train], residuals(block, holdout, window)
        for equation in fits[0].left:
            score, terms = _sparse(STLSQ, laws, block, fits, held, equation)
            if equation not in found or score < found[equation][0]:
                found[equation] = (score, terms)
    every = [(e, law, value, std) for e, (_, own) in found.items() for law, value, std in own]
    told = tuple(Term(e, str(law), value, std) for e, law, value, std in every)
    return Answer("missing" if told else "none", told, added(block, [(e, x, v) for e, x, v, _ in every]))


def added(block: Block, terms: list[tuple[str, sp.Expr, float]]) -> Block:
    """Return the Block with terms, each with its coefficient as a parameter."""
    from hovercontrol.core.signals import Signal

    rates, parameters = dict(block.derivatives), []
    for k, (equation, law, value) in enumerate(terms):
        signal = Signal(f"found_{k}", law_unit(equation, law, block), start=value)
        parameters.append(signal)
        smooth = law.replace(sp.sign, lambda a: sp.tanh(a / 1e-2)) if law.has(sp.sign) else law
        rates[equation] = rates[equation] + signal.symbol * smooth
    return with_rates(block, rates, parameters=tuple(parameters))


def _columns(laws: list[sp.Expr], block: Block, of: Residuals) -> Array:
    symbols = [s.symbol for s in (*block.states, *block.inputs)]
    n = next(iter(of.signals.values())).size
    values = sp.lambdify(symbols, laws, "numpy")(*(of.signals[s.name] for s in symbols))
    return np.array([np.broadcast_to(np.asarray(v, dtype=float), (n,)) for v in values]).T


def _sparse(
    optimizer: Any, laws: list[sp.Expr], block: Block, fits: list[Residuals], held: Residuals, equation: str
) -> tuple[float, list[tuple[sp.Expr, float, float]]]:
    """Return the held-out score of one equation, and the terms with coefficients and standard errors.

    The score is the mean square of what remains of the held-out residual, over the same
    of the refitted model without any term.
    """
    known = np.concatenate([f.known[equation] for f in fits])
    whole = np.concatenate([_columns(laws, block, f) for f in fits])
    y_all = np.concatenate([f.left[equation] for f in fits])
    y, rest = beside(y_all, known), beside(whole, known)
    sizes, before = rest.std(axis=0), whole.std(axis=0) + np.abs(whole.mean(axis=0))
    keep: list[int] = []
    for j in np.flatnonzero(sizes > 0.02 * before):  # others are what the model has already
        unit = rest[:, j] / np.linalg.norm(rest[:, j])
        if all(abs(unit @ rest[:, i]) < TWINS * np.linalg.norm(rest[:, i]) for i in keep):
            keep.append(int(j))
    scale = float(y.std()) or 1e-300
    a = rest[:, keep] / sizes[keep]
    wanted, held_known = held.left[equation], held.known[equation]
    held_columns = _columns(laws, block, held)

    def remains(chosen: list[int]) -> tuple[float, Array]:
        """Return the held-out mean square with coefficients of the training logs."""
        both = np.column_stack([known, whole[:, chosen]])
        c = np.linalg.lstsq(both, y_all, rcond=None)[0]
        return float(np.mean((wanted - np.column_stack([held_known, held_columns[:, chosen]]) @ c) ** 2)), c

    nothing, _ = remains([])
    best, chosen = nothing, []
    tried: set[tuple[int, ...]] = {()}
    for threshold in THRESHOLDS[::-1]:  # few terms first
        fit = optimizer(threshold=threshold, alpha=1e-6, max_iter=30).fit(a, (y / scale)[:, None])
        terms = tuple(keep[j] for j in np.flatnonzero(fit.coef_[0]))
        if terms in tried or len(terms) > 12:
            continue
        tried.add(terms)
        left, _ = remains(list(terms))
        if left < best - WORTH * nothing:
            best, chosen = left, list(terms)
    if not chosen:
        return 1.0, []
    _, c = remains(chosen)
    both = np.column_stack([known, whole[:, chosen]])
    off = y_all - both @ c
    # Residuals of a smoothed derivative correlate: n is divided by their correlation time in samples
    lags = [float(off[:-k] @ off[k:] / (off @ off)) for k in range(1, min(60, off.size // 2))]
    together = 1.0 + 2.0 * sum(itertools.takewhile(lambda r: r > 0.05, lags))
    spread = np.sqrt(np.diag(np.linalg.pinv(both.T @ both)) * off.var() * together)
    p = known.shape[1]
    return best / nothing, [(laws[j], float(c[p + k]), float(spread[p + k])) for k, j in enumerate(chosen)]
