"""What the samples after the alarm say of each candidate alone, by the sums of :mod:`.pairs`.

There the error at the alarm is estimated, so that no onset is needed, and the response is linearised at the
estimate. With h the evidence of each on these samples, H the largest of a candidate, N the number of
innovations and E their sum of squares, the candidate of H leaves ``R = E - H - N``. It is enough if R is
below two standard deviations of noise, ``(2 N)^(1/2)``, or what a response leaves that is not linear by a
part of :data:`.pairs.BENT`, and if no two changes are likely. Then, with ``D = 2 ln(1/error)`` and R' what R
exceeds noise by,

- one with ``h < H - D - 2 R'`` is outdone;
- if ``H > 2 D``, so that a candidate above that has evidence of its own, it is possible where no unknown
  acceleration has more by that either, whatever the tests from the onset say of these: they are linearised
  before the change;
- the candidate of H is safe if all unknown accelerations are outdone: what has refuted it was wrong.

Lags are never outdone, since their response at another size has another shape, nor are errors of sensors,
which the error at the alarm imitates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.control.observers.ins.kalman import Equations, chosen
from hovercontrol.identification.monitor.bank import Bank
from hovercontrol.identification.monitor.candidates import Candidate
from hovercontrol.identification.monitor.pairs import BENT, LEFT
from hovercontrol.identification.monitor.refined import DECIDES, FAR, within


@dataclass(frozen=True)
class AfterAlarm:
    """What the samples between the alarm and this tick say of each candidate alone.

    Attributes
    ----------
    outdone, near, safe : list of sympy.Expr
        For each candidate and unknown acceleration, whether another one explains them far more, and enough;
        for each candidate, whether it does nearly as well as the best, and whether no unknown acceleration
        does.
    """

    outdone: list[sp.Expr]
    near: list[sp.Expr]
    safe: list[sp.Expr]


def after_alarm(
    write: Equations,
    candidates: Sequence[Candidate],
    forces: int,
    bank: Bank,
    limits: Sequence[tuple[sp.Expr, sp.Expr]],
    several: sp.Expr,
) -> AfterAlarm:
    """Write which candidates explain the samples after the alarm, by the sums of :mod:`.pairs`.

    Parameters
    ----------
    forces : int
        Number of unknown accelerations.
    several : sympy.Expr
        1 if two changes were likely at the tick before.
    """
    J = len(candidates)
    if J < 2:
        return AfterAlarm([sp.false] * (J + forces), [sp.false] * J, [sp.false] * J)

    def sums(key: str) -> sp.Symbol:
        return sp.Symbol(f"pair_{key}", real=True)

    h = [
        write.define(
            f"after_alarm[{j}]", likelihood(sums(f"b[{j}]"), sp.Max(sums(f"J[{j},{j}]"), 1e-300), *limits[j])
        )
        for j in range(J + forces)
    ]
    best = write.define("most_after_alarm", sp.Max(*h[:J], evaluate=False))
    unknown = write.define("unknown_after_alarm", sp.Max(*h[J:], evaluate=False)) if forces else sp.S.Zero
    N, D = len(bank.whitened) * (bank.age[0] - 1), DECIDES * sp.Max(*bank.dispersion)
    noise = LEFT * sp.sqrt(2 * sp.Max(N, 0))
    left = write.define("left_after_alarm", sums("energy") - best - N)
    fits = sp.And(several < sp.S.Half, left < sp.Max(noise, BENT**2 * best))
    apart = write.define("apart_after_alarm", D + 2 * sp.Max(0, left - noise))
    least = write.define("least_after_alarm", chosen(fits, best - apart, -sp.Float(FAR)))
    top = sp.Max(best, unknown)
    enough = write.define("near_after_alarm", chosen(sp.And(fits, best > 2 * D), top - apart, sp.Float(FAR)))
    sure = write.define("safe_after_alarm", chosen(sp.And(fits, unknown < best - apart), best, sp.Float(FAR)))
    spared = {*lasting(candidates), *(j for j, c in enumerate(candidates) if c.seen)}
    return AfterAlarm(
        [sp.false if j in spared else g < least for j, g in enumerate(h)],
        [sp.false if j in spared else g >= enough for j, g in enumerate(h[:J])],
        [sp.false if j in spared else g >= sure for j, g in enumerate(h[:J])],
    )


def likelihood(b: sp.Expr, information: sp.Expr, lower: sp.Expr, upper: sp.Expr) -> sp.Expr:
    """Return g, the largest ``2 b theta - I theta^2`` with theta between bounds."""
    if lower.is_infinite and upper.is_infinite:
        return b**2 / information
    if lower == 0 and upper.is_infinite:
        return sp.Max(0, b) ** 2 / information
    theta = within(b / information, lower, upper)
    return theta * (2 * b - information * theta)


def lasting(candidates: Sequence[Candidate]) -> list[int]:
    """Return the numbers, from 0, of candidates with a memory: lags and delays."""
    return [j for j, c in enumerate(candidates) if c.memory or c.delay]
