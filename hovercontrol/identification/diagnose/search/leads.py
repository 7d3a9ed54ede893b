"""The best candidates that are not named, each with the reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.identification.diagnose.criteria import Criteria
from hovercontrol.identification.diagnose.evidence.sensors import only_noise
from hovercontrol.identification.diagnose.search.fit import Tried
from hovercontrol.identification.diagnose.search.rules import why_not
from hovercontrol.identification.diagnose.search.score import Scored
from hovercontrol.identification.engine.fit import Fit

#: Reason why an effect outside the catalogue is not named.
ASKED_FOR = "named only where it is asked for"


@dataclass(frozen=True)
class Lead:
    """A candidate with evidence that is not named.

    Attributes
    ----------
    name : str
    gain : float
    blocks_t : float
    reason : str
    blocks_n : int
        Number of blocks with information on its size; 0 if it was not fitted.
    """

    name: str
    gain: float
    blocks_t: float
    reason: str
    blocks_n: int = 0


def leads(
    seen: Sequence[Scored],
    tried: Mapping[str, Tried],
    named: Sequence[str],
    dropped: Sequence[Lead],
    final: Fit,
    criteria: Criteria,
) -> tuple[Lead, ...]:
    """Return the best candidates besides the named effects, with the reason why they are not named.

    Parameters
    ----------
    seen : sequence of Scored
        Scores of candidates with all added effects in the model.
    tried : mapping of str to Tried
        The candidates that were fitted.
    named : sequence of str
    dropped : sequence of Lead
        Effects added and dropped again.
    final : Fit
        Fit of the amended model.
    criteria : Criteria
    """
    found = list({lead.name: lead for lead in dropped if lead.name not in named}.values())
    listed = {*named, *(lead.name for lead in found)}
    nearest = 0 if only_noise(final, criteria) else 3  # this many are listed whatever their gain
    for s in seen:
        if s.candidate.name in listed or (s.gain < criteria.least and len(found) >= nearest):
            continue
        t = tried.get(s.candidate.name)
        if t is not None:
            reason = why_not(t, len(seen), criteria) or "another candidate explains more"
            if t.gain < 0.0:
                reason = f"the fit does not reach its predicted gain of {s.gain:.3g}"
            found.append(Lead(t.name, max(t.gain, 0.0), t.blocks.t, reason, t.blocks.n))
            continue
        score_t = float(np.sqrt(max(s.chi2, 0.0)))
        if not s.allowed:
            reason = "fits best with a sign or size that its bounds forbid"
        elif s.gain < criteria.least + criteria.each * len(s.parts):
            asked = criteria.least + criteria.each * len(s.parts)
            reason = f"gains {s.gain:.3g} in twice the log likelihood, {asked:g} are asked for"
        elif s.p_value > criteria.level / max(len(seen), 1):
            reason = f"segments of the logs do not agree on it (t = {score_t:.1f})"
        elif s.candidate.trial.mistaken_for:
            reason = ASKED_FOR
        else:
            reason = "another candidate explains more"
        found.append(Lead(s.candidate.name, s.gain, score_t, reason))
    return tuple(found[:8])
