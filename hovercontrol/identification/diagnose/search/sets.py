"""Sets of candidates, chosen on the table of whitened products by the gain on blocks left out."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from hovercontrol.base.short_repr import short_repr
from hovercontrol.identification.diagnose.criteria import Criteria
from hovercontrol.identification.diagnose.search.score import Scored, Scores

#: Number of effects, best first, among which sets of two and three are looked for.
AMONG = 8


@dataclass(frozen=True, eq=False)
class CandidateSet:
    """Candidates that the table is asked about together.

    Attributes
    ----------
    members : tuple of Scored
        Each at its best trial.
    columns : tuple of int
        Their columns in the table.
    gain : float
        Cross-validated gain: by how much minus twice the log likelihood of each block falls under sizes
        that all other blocks chose. It needs no penalty for the number of parameters: a needless one gains
        nothing on a block that did not choose its size.
    """

    members: tuple[Scored, ...]
    columns: tuple[int, ...]
    gain: float

    __repr__ = short_repr

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the members."""
        return tuple(s.candidate.name for s in self.members)


def singles(scores: Scores) -> list[CandidateSet]:
    """Return each effect alone at its best trial of an allowed size, the largest gain first.

    Parameters
    ----------
    scores : Scores
    """
    best: dict[str, CandidateSet] = {}
    for i, candidate in enumerate(scores.tried):
        s = scores.of(i)
        gain = scores.left_out_gain(i)
        if s.allowed and (candidate.name not in best or gain > best[candidate.name].gain):
            best[candidate.name] = CandidateSet((s,), scores.columns_of(i), gain)
    return sorted(best.values(), key=lambda one: -float(f"{one.gain:.6g}"))  # ties in the catalogue's order


def best_set(
    scores: Scores, alone: list[CandidateSet], criteria: Criteria, most: int = 3
) -> CandidateSet | None:
    """Return the best set of two or more effects; None if it gains no more than the best one needs alone.

    Parameters
    ----------
    scores : Scores
    alone : list of CandidateSet
        Effects alone, best first.
    criteria : Criteria
    most : int, optional
        Largest number of effects in a set.
    """
    few = alone[:AMONG]
    best = few[0] if few else None
    for count in range(2, most + 1):
        sets = [_joined(scores, members) for members in itertools.combinations(few, count)]
        fitting = [s for s in sets if s is not None]
        if best is None or not fitting:
            break
        richer = max(fitting, key=lambda s: s.gain)
        if richer.gain < best.gain + criteria.least:
            break
        best = richer
    return best if best is not None and len(best.members) > 1 else None


def _joined(scores: Scores, sets: tuple[CandidateSet, ...]) -> CandidateSet | None:
    """Return the union of sets; None if two members are the same in every log."""
    members = tuple(s for one in sets for s in one.members)
    if any(a.candidate.trial.twin(b.candidate.trial) for a, b in itertools.combinations(members, 2)):
        return None
    columns = tuple(c for one in sets for c in one.columns)
    return CandidateSet(members, columns, scores.left_out_gain_of(columns))
