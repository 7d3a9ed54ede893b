"""The three kinds of evidence for a named effect: likelihood, agreement of blocks, held-out predictions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hovercontrol.base.short_repr import short_repr
from hovercontrol.identification.diagnose.evidence.blocks import Blocks
from hovercontrol.identification.diagnose.evidence.holdout import Gained, Horizons


@dataclass(frozen=True, eq=False)
class Evidence:
    """The evidence for one named effect.

    Attributes
    ----------
    gain : float
        Reduction of twice the negative log likelihood, with the other effects in the model.
    blocks : Blocks
    holdout : Horizons
        Errors on the held-out log without and with the effect; empty without such a log.
    gained : Gained or None
        Gain in likelihood on the held-out log; None without such a log.
    """

    gain: float
    blocks: Blocks
    holdout: Horizons = field(default_factory=Horizons)
    gained: Gained | None = None

    __repr__ = short_repr

    def result(self) -> dict[str, Any]:
        """Return the entries of ``result.json``."""
        b = self.blocks
        return {
            "gain": self.gain,
            "blocks": {
                "n": b.n,
                "same_sign": b.same_sign,
                "t": b.t,
                "spread": b.spread,
                "p_value": b.p_value,
            },
            "holdout_gain": {"gain": self.gained.gain, "t": self.gained.t} if self.gained else None,
            "holdout": [
                {
                    "horizon": a.horizon,
                    "channel": a.channel,
                    "before": a.before,
                    "after": a.after,
                    "unit": a.unit,
                    "t": a.t,
                }
                for a in self.holdout.each
            ],
        }
