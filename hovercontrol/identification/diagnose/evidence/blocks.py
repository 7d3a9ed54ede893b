"""An effect's size estimated on disjoint blocks of the logs: a real cause has the same size in all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.signals import time
from hovercontrol.craft.effects import Effect, Shape
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.passes import inverse


@dataclass(frozen=True, eq=False)
class Blocks:
    """An effect's size on each block, relative to its size on all blocks.

    Attributes
    ----------
    estimate, std : ndarray, shape (W,)
        Estimate of each block and its standard error; 1 is the estimate from all blocks. The standard error
        is infinite where a block has no information.
    log : ndarray of int, shape (W,)
        Index of the log of each block.
    n : int
        Number of blocks with information.
    same_sign : int
        Number of these blocks whose estimate has the sign of the weighted mean.
    t : float
        Size over its standard error from the scatter over blocks, with capped weights (:func:`capped`).
    dof : float
        Effective number of blocks minus one: a few blocks may carry all information.
    spread : float
        Standard deviation of the size from block to block, measurement noise removed, weighted as in `t`:
        blocks with more information weigh more.
    """

    estimate: Array
    std: Array
    log: NDArray[np.intp]
    n: int
    same_sign: int
    t: float
    dof: float
    spread: float

    __repr__ = short_repr

    @property
    def p_value(self) -> float:
        """Two-sided p-value of t."""
        return float(2.0 * stats.t.sf(abs(self.t), max(self.dof, 1e-3)))


@dataclass(frozen=True)
class BlockCriteria:
    """Weighting of the blocks of logs.

    No published source: set by hand, exercised by tests/identification/diagnose/test_blocks.py.

    Attributes
    ----------
    enough : int
        Effective number of blocks that must share the weight. If fewer blocks carry nearly all information,
        their weight is capped.
    part : float
        The same as a fraction of the informative blocks; the smaller of the two numbers applies.
    """

    enough: int = 8
    part: float = 0.75


#: The values in use.
BLOCKS = BlockCriteria()


def capped(information: Array) -> Array:
    """Return the weights of blocks: their information, capped so that enough blocks share the weight.

    ``w = min(I, h)``, with h the largest cap for which the effective number of blocks,
    ``(sum w)^2 / sum w^2``, is at least that of :data:`BLOCKS`.

    Examples
    --------
    >>> information = np.r_[100.0, np.ones(9)]
    >>> weights = capped(information)
    >>> bool(weights[0] < 10.0), weights[1:].tolist() == information[1:].tolist()
    (True, True)
    """
    low, high = 0.0, float(information.max(initial=0.0))
    enough = min(BLOCKS.enough, BLOCKS.part * np.count_nonzero(information))
    if _sharing(information) >= enough:
        return information
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _sharing(np.minimum(information, middle)) >= enough else (low, middle)
    return np.asarray(np.minimum(information, high))


def _sharing(weights: Array) -> float:
    """Return the effective number of blocks, (sum w)^2 / sum w^2: that of as many equal weights."""
    squares = float((weights**2).sum())
    return float(weights.sum()) ** 2 / squares if squares > 0 else 0.0


def scatter(score: Array, information: Array, log: NDArray[np.intp]) -> Blocks:
    """Return the estimates of each block of one parameter whose size on all logs is 1.

    With the score u_w, information I_w and capped weight w_w of block w::

        estimate   e_w = u_w / I_w,    standard error I_w^(-1/2)
        size       e = sum w_w e_w / sum w_w
        variance   s^2 = W/(W - 1) sum w_w^2 (e_w - e)^2 / (sum w_w)^2,
                   at least that of measurement noise, sum (w_w^2 / I_w) / (sum w_w)^2
        t          e / s
        spread^2   [n/(n - 1) sum w_w^2 (e_w - e)^2 - sum w_w^2 / I_w] / (sum w_w^2 e^2),
                   n = (sum w_w)^2 / sum w_w^2

    Parameters
    ----------
    score : ndarray, shape (W,)
        Of each block, at size zero.
    information : ndarray, shape (W,)
    log : ndarray of int, shape (W,)
    """
    total = float(information.sum())
    known = information > 1e-9 * total
    with np.errstate(all="ignore"):
        estimate = np.where(known, score / information, 0.0)
        std = np.where(known, 1.0 / np.sqrt(information), np.inf)
    counts = information > 0.05 * total / max(len(information), 1)
    n = int(counts.sum())
    weights = capped(information)
    effective, whole = _sharing(weights), max(float(weights.sum()), 1e-300)
    size = float((weights * estimate).sum()) / whole
    squares = (weights * (estimate - size)) ** 2
    W = len(score)
    robust = np.sqrt(float(squares.sum()) * W / max(W - 1, 1)) / whole
    own = np.sqrt(float((weights[known] ** 2 / information[known]).sum())) / whole
    t = size / max(robust, own, 1e-300)  # a few uninformative blocks may agree by chance
    spread = 0.0
    if effective > 1.5:
        both = float((weights**2).sum())
        variance = float(squares.sum()) / both * effective / (effective - 1.0)
        noise = float((weights[known] ** 2 / information[known]).sum()) / both
        spread = float(np.sqrt(max(variance - noise, 0.0))) / max(abs(size), 1e-300)
    same = int((estimate[counts] * np.sign(size) > 0).sum())
    return Blocks(estimate, std, log, n, same, abs(t), max(effective - 1.0, 0.0), spread)


def of_effect(fit: Fit, name: str) -> Blocks:
    """Return the estimates of a fitted effect's size on each block, other unknowns estimated on all blocks.

    Parameters
    ----------
    name : str
        An effect of its model. If several parameters scale it, the estimate is along their direction.
    """
    problem = fit.problem
    e = problem.model.effect(name)
    scaling = [
        (problem.names.index(e.parameter(k)), n.neutral)
        for k, n in e.numbers.items()
        if not np.isnan(n.neutral) and e.parameter(k) in problem.names
    ]
    log = problem.rows.block_log
    if not scaling:
        raise KeyError(name)
    mine = [j for j, _ in scaling]
    away = np.array([fit.p[j] - neutral for j, neutral in scaling]) / problem.slope(fit.p)[mine]
    others = [j for j in fit.movable if j not in mine]
    information, u = along(fit.S, fit.g, fit.prior.precision, mine, others, away)
    # u_w is the score at the fitted size, 1; at size zero it is u_w + I_w
    found = scatter(u + information, information, log)
    return replace(found, spread=max(found.spread, _uneven(fit, name)))


def along(
    S: Array, g: Array, precision: Array, mine: list[int], others: list[int], away: Array
) -> tuple[Array, Array]:
    """Return each block's information and score along a direction of some unknowns.

    The other unknowns are re-estimated on all blocks together. With m the unknowns `mine`, o the others, a
    the direction `away` and Lambda the precision of the prior::

        B = (sum_w S_oo + Lambda)^-1 sum_w S_om
        I_w = a'(S_mm - S_mo B - B'S_om + B'S_oo B) a,    u_w = a'(g_m - B'g_o)
    """
    J, u = S[:, mine][:, :, mine], g[:, mine]
    if others:
        total = S.sum(axis=0) + np.diag(precision)
        back = inverse(total[np.ix_(others, others)]) @ total[np.ix_(others, mine)]
        cross = S[:, mine][:, :, others]
        J = (
            J
            - cross @ back
            - np.swapaxes(cross @ back, 1, 2)
            + np.einsum("pm,wpq,qk->wmk", back, S[:, others][:, :, others], back)
        )
        u = u - g[:, others] @ back
    return np.maximum(np.einsum("m,wmk,k->w", away, J, away), 0.0), u @ away


def _uneven(fit: Fit, name: str) -> float:
    """Return the spread over blocks of the effects that an effect modulates, relative to the modulation.

    A jump of all drags at one time implies one set of drags before it and another after it. If each block
    needs a set of its own, the floor differs from place to place instead. The result is 0 for an effect that
    modulates no others.
    """
    problem = fit.problem
    e = problem.model.effect(name)
    if type(e).factors is Effect.factors:
        return 0.0
    symbols = e.symbols(problem.block.name)
    others = set(e.factors(symbols, SimpleNamespace(time=time)))
    modulated = np.zeros(len(fit.p))
    for o in problem.model.effects:
        if o.name in others and o.parameter("value") in problem.names:
            j = problem.names.index(o.parameter("value"))
            modulated[j] = fit.p[j]
    scaling = [(k, n.neutral) for k, n in e.numbers.items() if not np.isnan(n.neutral)]
    size = max(abs(e.values[k] - neutral) / max(abs(e.values[k]), abs(neutral)) for k, neutral in scaling)
    information = np.maximum(np.einsum("p,wpq,q->w", modulated, fit.S, modulated), 0.0)
    # I_w = a'S_w a and u_w = a'g_w along a, the coefficients of the modulated effects
    own = scatter(fit.g @ modulated + information, information, problem.rows.block_log)
    return own.spread / max(size, 1e-9)


def agreement(fit: Fit, less: Fit, name: str) -> Blocks:
    """Return how blocks agree on a fitted effect: on its size or, if no parameter scales it, on its gain.

    For gains d_w of W blocks, t is that of their signed roots, ``r_w = sgn(d_w) |d_w|^(1/2)`` and
    ``t = mean(r) / (std(r) / W^(1/2))`` (Barndorff-Nielsen, Biometrika 73 (1986)). The gains themselves are
    uneven: a limit, for instance, is reached more often in some blocks than in others.

    Parameters
    ----------
    fit : Fit
        With the effect.
    less : Fit
        Without it.
    """
    e = fit.problem.model.effect(name)
    scaled = any(
        not np.isnan(n.neutral) and e.parameter(k) in fit.problem.names for k, n in e.numbers.items()
    )
    if scaled:
        return of_effect(fit, name)
    found = of_gain(less.block_costs - fit.block_costs, fit.problem.rows.block_log)
    return replace(found, spread=_uneven_shape(fit, name))


def of_gain(gain: Array, log: NDArray[np.intp]) -> Blocks:
    """Return how blocks agree on a gain; see :func:`agreement`. The spread is zero.

    Parameters
    ----------
    gain : ndarray, shape (W,)
        Reduction of twice the negative log likelihood of each block.
    log : ndarray of int, shape (W,)
        Index of the log of each block.
    """
    total = float(gain.sum())
    counts = np.abs(gain) > 0.05 * abs(total) / max(gain.size, 1)
    effective = total**2 / max(float((gain**2).sum()), 1e-300)
    root = np.sign(gain) * np.sqrt(np.abs(gain))  # roots are about normal, gains are not
    t = float(root.mean() / max(root.std(ddof=1) / np.sqrt(gain.size), 1e-300)) if gain.size > 1 else 0.0
    share = gain * gain.size / max(abs(total), 1e-300)
    dof = max(gain.size - 1.0 if effective > 1 else 0.0, 0.0)
    return Blocks(
        share, np.full(gain.size, np.nan), log, int(counts.sum()), int((gain[counts] > 0).sum()),
        abs(t) if total > 0 else 0.0, dof, 0.0,
    )  # fmt: skip


def _uneven_shape(fit: Fit, name: str) -> float:
    """Return the spread over blocks of the shape parameter of an effect, relative to its value."""
    problem = fit.problem
    e = problem.model.effect(name)
    mine = [
        problem.names.index(e.parameter(k))
        for k, n in e.numbers.items()
        if isinstance(n, Shape) and n.search and e.parameter(k) in problem.names
    ]
    if not mine:
        return 0.0
    others = [j for j in fit.movable if j not in mine]
    away = np.zeros(len(mine))
    away[0] = 1.0 if problem.log_scale[mine[0]] else fit.p[mine[0]]
    information, u = along(fit.S, fit.g, fit.prior.precision, mine, others, away)
    return scatter(u + information, information, problem.rows.block_log).spread
