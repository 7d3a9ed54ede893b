"""Signatures of a monitor's candidates along a motion, from which its threshold is computed.

The monitor's own equations, run along the motion, give each candidate's eta, its column s, C and M = Phi A.
The signature of a change at the start tau of a window follows as in
:mod:`hovercontrol.identification.monitor.bank`:

    eta_i(tau) = eta_i - C_i Psi s(tau),   Psi <- M Psi.

They give the limited innovations e of a logged motion as well.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.identification.monitor.design import Design
from hovercontrol.identification.monitor.equations import column_block
from hovercontrol.identification.monitor.motion import Motion
from hovercontrol.identification.monitor.threshold import Signatures, signatures_of

#: Part of its bound below which the square of a signature is rounding: the terms of an effect that the
#: measured channels never show cancel up to 1e-32.
CANCELLED = 1e-20


def along_motion(design: Design, path: Motion) -> tuple[Design, Signatures, Array]:
    """Return signatures along a motion, and innovations, after the filter has settled.

    The signatures are those of the candidates and of the unknown changes, the design that without unknown
    changes that never show. The innovations, shape (K, m), are divided by their standard deviations and
    limited.

    Raises
    ------
    InputError
        If a candidate never shows along the motion.
    """
    own, columns, C, M, seen = _columns(design, path)
    # Square of the signature if no terms cancelled: sum over ticks and i of (|C_i| |s|)^2.
    most = ((np.abs(C)[:, None] @ np.abs(columns)[..., None]) ** 2).sum(axis=(0, 2, 3))
    eta = _in_windows(design, own, columns, C, M)
    shows = (eta**2).sum(axis=(0, 1, 3)) > CANCELLED * most
    for c, shown in zip(design.candidates, shows, strict=False):
        if not shown:
            measured = ", ".join(s.name for s in design.model.measured)
            raise InputError(
                f"{design.model.name}: candidate {c.name!r}: the measured channels {measured} never show it "
                "along the motion"
            )
    kept = [c for c, shown in zip(design.every, shows, strict=True) if shown]
    design = replace(design, unknowns=tuple(kept[len(design.candidates) :]))
    return design, signatures_of(eta[:, :, shows], design.first), seen


def _columns(design: Design, path: Motion) -> tuple[Array, Array, Array, Array, Array]:
    """Return eta, s, C, M and e at each settled tick.

    Their shapes are (K, J, m), (K, J, n), (K, m, n), (K, n, n) and (K, m).
    """
    block = column_block(design)
    run, names = Ticking(block), [s.name for s in (*design.model.measured, *design.model.plant.inputs)]
    signals = {s.name: s.start for s in block.inputs}
    channels, rows = [s.name for s in design.model.measured], []
    fresh = {n: channels.index(n[6:]) for n in signals if n.startswith("fresh_") and n[6:] in channels}
    for k, row in enumerate(np.hstack([path.measured, path.inputs]).tolist()):
        signals |= dict(zip(names, row, strict=True))
        signals |= {name: float(path.seen[k, i]) for name, i in fresh.items()}
        if "fresh" in signals:
            signals["fresh"] = float(path.seen[k].all())
        rows.append(list(run.tick(k * design.period, signals).values()))
    settled = np.array(rows[min(round(design.settle / design.period), len(rows) // 2) :])
    J, m, n = len(design.every), len(design.model.measured), len(design.model.plant.states)
    own, columns, C, M, seen = np.split(settled, np.cumsum([J * m, J * n, m * n, n * n]), axis=1)
    return own.reshape(-1, J, m), columns.reshape(-1, J, n), C.reshape(-1, m, n), M.reshape(-1, n, n), seen


def _in_windows(design: Design, own: Array, columns: Array, C: Array, M: Array) -> Array:
    """Return the signatures by tick, window, candidate and measurement."""
    K, J, m = own.shape
    W, n = design.windows, columns.shape[2]
    begun, Psi = np.repeat(columns[:1], W, axis=0), np.broadcast_to(np.eye(n), (W, n, n)).copy()
    eta = np.empty((K, W, J, m))
    for k in range(K):
        # eta(tau) = eta - C Psi s(tau), then Psi <- M Psi (see bank.py)
        eta[k] = own[k] - begun @ (C[k] @ Psi).swapaxes(1, 2)
        Psi = M[k] @ Psi
        for w in reversed(range(W)):
            if (k + 1) % (design.first * 2**w) == 0:
                begun[w] = begun[w - 1] if w else columns[min(k + 1, K - 1)]
                Psi[w] = Psi[w - 1] if w else np.eye(n)
    return eta
