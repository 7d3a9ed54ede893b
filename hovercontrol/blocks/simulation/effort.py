"""Count the derivative evaluations of a SciPy solver; warn about a slow run and stop a stalled one."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.simulation.reasons import StoppedError, where_it_stops

#: Number of derivative evaluations between two checks of the pace; they take a few seconds.
LOOKED_AFTER = 50_000

#: Limits on the number of evaluations that the rest of a run needs at its present pace. Above TOLD (minutes)
#: the user is warned. A run above STOPPED (hours) at LOOKS checks in a row is stopped.
TOLD, STOPPED, LOOKS = 5_000_000, 100_000_000, 8


class Effort:
    """Counts the derivative evaluations of a run and checks its pace every LOOKED_AFTER evaluations.

    Parameters
    ----------
    block : Block
        As for :func:`hovercontrol.blocks.simulation.reasons.where_it_stops`.
    params : sequence of float
        Parameter values in order.
    begin, end : float
        Begin and end of the run [s].
    rtol, atol : float
        Tolerances of the solver.
    """

    def __init__(
        self, block: Block, params: Sequence[float], begin: float, end: float, rtol: float, atol: float
    ) -> None:
        self._block, self._params, self._span, self._end = block, params, end - begin, end
        self._allowed = {"rtol": rtol, "atol": atol}
        self._calls = self._slow = 0
        self._seen, self._told = begin, False

    def spend(self, t: float, x: Sequence[float], u: Sequence[float]) -> None:
        """Count an evaluation at time `t` [s].

        Raises
        ------
        StoppedError
            If the run would need more than STOPPED evaluations at LOOKS checks in a row.
        """
        self._calls += 1
        if self._calls % LOOKED_AFTER:
            return
        # evaluations still needed = (end - t) / (time advanced since the last check) * LOOKED_AFTER
        moved, self._seen = t - self._seen, t
        needed = (self._end - t) / moved * LOOKED_AFTER if moved > 0.0 else float("inf")
        self._slow = self._slow + 1 if needed > STOPPED else 0
        if self._slow >= LOOKS:
            raise self.stopped(t, x, u, f"too many steps to reach {self._end:.6g} s")
        if needed > TOLD and not self._told:
            self._told = True
            warnings.warn(
                self._block.where(
                    f"the simulation is at t = {t:.6g} s and advances by {moved:.2g} s in {LOOKED_AFTER} "
                    f"evaluations{self.where(t, x, u)}"
                ),
                stacklevel=2,
            )

    def where(self, t: float, x: Sequence[float], u: Sequence[float]) -> str:
        """Return the end of a message: the state and the switch that slow the run down."""
        return where_it_stops(self._block, t, x, u, self._params, span=self._span, **self._allowed)

    def stopped(self, t: float, x: Sequence[float], u: Sequence[float], reason: str) -> StoppedError:
        """Return the error that ends a run."""
        where = self.where(t, x, u)
        line = f"the simulation stops at t = {t:.6g} s: {reason}{where}"
        return StoppedError(self._block.where(line), 4, where)
