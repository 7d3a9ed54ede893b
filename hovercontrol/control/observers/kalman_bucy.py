"""The Kalman-Bucy estimator of C17 (sections III and V) as a Block, for any Block linear in its coefficients.

The coefficients are appended to the measured states, ``xi = [x, c]``. The system
``xi' = A xi + [h, 0], A = [[0, G], [0, 0]]`` is linear and time-varying because G and h use the measured
signals [C17 eq 2, 3, 4, 5]. The estimator is its Kalman-Bucy filter; for the hovercraft it has the matrices
of [C17 eq 13]. Signal names follow python-control's estimators: ``xhat[i]``, ``P[i,j]`` (here the upper
triangle). Of a sampled Block it is the filter of :mod:`.ticking`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import simplified
from hovercontrol.control.observers.diagonal import diagonal, intensities
from hovercontrol.control.observers.regression import regression
from hovercontrol.control.observers.ticking import sampled_estimator


@checked
def kalman_bucy(
    block: Block,
    estimate: Sequence[str] | None = None,
    *,
    R: ArrayLike = 1e-5,
    Q: ArrayLike = 1e-2,
    P0: ArrayLike = 1e-2,
    name: str = "estimator",
) -> Block:
    """Return the estimator of chosen coefficients of a Block.

    Of a sampled Block it is :func:`~hovercontrol.control.observers.ticking.sampled_estimator`, with its
    period.

    Parameters
    ----------
    block : Block
        Its states are measured, under their own names.
    estimate : sequence of str, optional
        Coefficients to estimate (default: all in which the Block is linear); the others remain parameters of
        the estimator.
    R : array_like, scalar or shape (n,), optional
        Intensities of the measurement noise of the n states that the coefficients act on.
    Q : array_like, scalar or shape (n + m,), optional
        Intensities of the disturbances of those states and of the m coefficients.
    P0 : array_like, scalar or shape (n + m,), optional
        Initial variances.
    name : str, optional

    Returns
    -------
    Block
        Inputs: the measured states and the Block's inputs. Outputs: ``NAME_hat`` for each coefficient.
        States: ``xhat[i]`` (starting at the Block's own start and parameter values), ``P[i,j]``, i <= j.

    Raises
    ------
    InputError
        If the Block is not linear in a coefficient (the message says where), R, Q or P0 have the wrong
        length, R is not positive, or Q or P0 is negative.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> e = kalman_bucy(c17_simulation().plant(), R=1e-5, Q=[1e-4] * 3 + [1e-2] * 8)
    >>> len(e.states), e.outputs[4].name
    (77, 'yaw_coulomb_hat')
    """
    if block.period:
        return sampled_estimator(block, estimate, period=block.period, R=R, Q=Q, P0=P0, name=name)
    regression(block, estimate)  # errors name the Block, not the estimator
    block = block.named(name)  # the remaining parameters belong to the estimator
    model = regression(block, estimate)
    n, m = len(model.states), len(model.coefficients)
    size = n + m
    xi = [*model.states, *model.coefficients]
    Rs, Qs = intensities(model.states, xi, R, Q)
    p_start = diagonal("P0", P0, size)

    xhat = [
        s.replace(name=f"xhat[{i}]", description=f"estimate of {s.name}", lower=-np.inf, upper=np.inf)
        for i, s in enumerate(xi)
    ]
    P = {
        (i, j): Signal(
            f"P[{i},{j}]",
            simplified(f"({xi[i].unit})*({xi[j].unit})"),
            "error covariance",
            start=p_start[i] if i == j else 0.0,
        )
        for i in range(size)
        for j in range(i, size)
    }

    cov = sp.Matrix(size, size, lambda i, j: P[min(i, j), max(i, j)].symbol)
    # xihat' = [h + G chat, 0] + K (x - xhat),  K = P C' R^-1,  P' = A P + P A' + Q - K C P
    # with C = [I, 0], so that P C' is the first n columns of P.
    # A regressor that is more than a single signal is computed once, as a definition.
    G, definitions = _named_regressors(model.G)
    innovation = [sp.Symbol(f"innovation[{i}]", real=True) for i in range(n)]
    for i, s in enumerate(model.states):
        definitions[innovation[i].name] = s.symbol - xhat[i].symbol
    gain = sp.Matrix(size, n, lambda i, j: cov[i, j] / Rs[j].symbol)
    estimates = sp.Matrix([x.symbol for x in xhat[n:]])
    drift = [*(sp.Matrix(model.h) + G * estimates), *([sp.S.Zero] * m)]
    correction = gain * sp.Matrix(innovation)
    derivatives = {x.name: drift[i] + correction[i] for i, x in enumerate(xhat)}
    AP = sp.Matrix.vstack(G * cov[n:, :], sp.zeros(m, size))
    for (i, j), signal in P.items():
        noise = Qs[i].symbol if i == j else sp.S.Zero
        loss = sum(gain[i, k] * cov[k, j] for k in range(n))
        derivatives[signal.name] = AP[i, j] + AP[j, i] + noise - loss

    used = set().union(*(e.free_symbols for e in (*derivatives.values(), *definitions.values()))) - {time}
    measured = [s for s in block.states if s.symbol in used]
    return Block(
        name,
        states=(*xhat, *P.values()),
        inputs=(*measured, *(s for s in block.inputs if s.symbol in used)),
        outputs=model.hats,
        parameters=(*Rs, *Qs, *(p for p in block.parameters if p.symbol in used)),
        derivatives=derivatives,
        definitions=definitions,
        output_expressions={hat.name: x.symbol for hat, x in zip(model.hats, xhat[n:], strict=True)},
    )


def _named_regressors(G: sp.Matrix) -> tuple[sp.Matrix, dict[str, sp.Expr]]:
    definitions: dict[str, sp.Expr] = {}

    def named(i: int, j: int) -> sp.Expr:
        e = G[i, j]
        if e.is_Atom or (-e).is_Atom:
            return e
        symbol = sp.Symbol(f"G[{i},{j}]", real=True)
        definitions[symbol.name] = e
        return symbol

    return sp.Matrix(*G.shape, named), definitions
