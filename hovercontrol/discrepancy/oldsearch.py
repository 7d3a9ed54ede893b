"""Where a search for effects stands, and the fits and scores that every step of it makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hovercontrol.discrepancy.candidates import Scored, Scores, Signatures, candidates
from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.gains import refuse_gains
from hovercontrol.discrepancy.ladder import rungs
from hovercontrol.discrepancy.noise import Noise
from hovercontrol.discrepancy.outliers import cleaned, without_outliers
from hovercontrol.discrepancy.selection import Selection
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.weighing import least_gain

#: Times at most that outliers are looked for: large ones hide small ones.
CLEANED = 3


class Search:
    """One search.

    Attributes
    ----------
    model : Model or BlockModel
        As given: about its coefficients the prior lies.
    data : Data
        Less what stands out so far.
    names : sequence of str or None
        Effects to consider.
    max_effects : int
    rungs : sequence of float
        Lengths of windows, growing [s].
    dirty : bool
        Whether anything was left out.
    plain : Noise
        That of the measurements alone.
    tried : (Scored, Fit) or None
        What took most without process noise, and yet not enough.
    found : Selection
        Where it stands.
    """

    def __init__(
        self,
        model: Subject,
        data: Data,
        names: Sequence[str] | None,
        max_effects: int,
        tell: Callable[[float, str], None],
    ) -> None:
        self.model, self.data, self.names, self.max_effects = model, data, names, max_effects
        self.rungs, self._tell = rungs(model, data), tell
        tell(0.05, "fitting the model as it is")
        base = fit(model, data, self.rungs[0])
        for _ in range(CLEANED):
            clean = without_outliers(base)
            if clean is None:
                break
            self.data = clean
            base = fit(model, clean, self.rungs[0], near=base)
        refuse_gains(base)
        self.dirty = self.data is not data
        self.plain = base.noise
        self.tried: tuple[Scored, Fit] | None = None
        self.found = Selection(base, base)

    def fit(
        self,
        model: Subject,
        near: Fit,
        *,
        length: float | None = None,
        noise: Noise | None = None,
        frozen: bool = False,
        finer: int = 1,
    ) -> Fit:
        """Fit from where `near` ended, by default over windows and with noise like its own."""
        length = length or near.windowed.length
        noise = noise or near.noise
        own = self.model
        return fit(model, self.data, length, noise, prior_model=own, near=near, frozen=frozen, finer=finer)

    def scores(self, of: Fit) -> Scores:
        """Score the candidates beside a fit."""
        return Scores(of, Signatures(of, candidates(of, self.names)))

    def worth(self, scores: Scores, chi2_per_dof: float) -> list[Scored]:
        """Return the effects whose gain is worth their numbers; note those that may not be."""
        best = scores.best()
        bar = max(1.0, chi2_per_dof)
        worth = [s for s in best if s.allowed and s.gain > least_gain(s) * bar]
        least = worth[0].gain if worth else 0.0
        for s in best:
            if not s.allowed and s.gain > max(least_gain(s) * bar, least):
                why = "fits best with a sign that its bounds forbid (a drag would feed energy)"
                if (s.candidate.name, why) not in self.found.rejected:
                    self.found.rejected.append((s.candidate.name, why))
        return worth

    def clean(self) -> None:
        """Leave out what stands out beside what was found so far: residuals of what lacks are as steep."""
        found = self.found
        clean = cleaned(found.final.model, self.data, self.rungs[:2]) if self.dirty else self.data
        if clean is self.data:
            return
        self.data, self.plain = clean, self.plain.but(measured=clean.noise)
        for name in ("base", "final"):
            old = getattr(found, name)
            noise = old.noise.but(measured=clean.noise)
            setattr(found, name, self.fit(old.model, old, noise=noise))

    def progress(self, what: str) -> None:
        """Tell how far the search is: nobody knows how many effects are to come."""
        self._tell(0.1 + 0.7 * (1 - 0.6 ** (1 + len(self.found.steps))), what)
