"""The evidence required: thresholds of the discrepancy workflow, with reasons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from hovercontrol.estimation.fit import Fit


@dataclass(frozen=True)
class Criteria:
    """Thresholds.

    Attributes
    ----------
    level : float
        Chance of one false name among all candidates that are looked at: a p-value over blocks must lie
        below this over their number (Bonferroni).
    least, each : float
        Fall of twice the negative log likelihood that an effect must bring, beyond `each` for each of its
        numbers: odds of e^10 before, e^2 for each (a Bayes factor that Kass and Raftery, JASA 90 (1995), call
        decisive), as `level` asks of a chi-squared of sixty candidates.
    other_sign : float
        Chance of another sign in a further block, among all candidates that are looked at: that below which
        the standard deviation of a coefficient from block to block lies, noise taken off. A third of the
        coefficient among forty candidates, 0.47 among the three drags of an axis. A real cause is
        invariant, a stand-in is not (Peters, Buehlmann, Meinshausen, J. R. Stat. Soc. B 78 (2016)).
    blocks : int
        Fewest blocks with information on a coefficient for their scatter to be judged.
    apart : float
        A rival no more than this behind (odds of e^6) is not distinguished.
    apart_t : float
        Nor one behind by less than so many standard errors of the difference over blocks (Vuong,
        Econometrica 57 (1989)): at two, 2.5 % of true ones are.
    chance : float
        A law of which a named one is a limit is a rival where its further numbers gain more than they do by
        chance in all but this part of cases (Wilks, Ann. Math. Stat. 9 (1938)).
    remains : float
        Fall of twice the negative log likelihood by process noise in one equation from which on something
        remains there: two numbers, its size and its correlation time.
    negligible : float
        Process noise below this part of the accelerations seen is none: what steps of the simulation leave.
    share : float
        Score, in parts of the best one's, below which a candidate is not fitted.
    alike : float
        The same where the best one leaves nothing: only near twins do as well (signatures correlated by
        0.88 and more).
    tries : int
        Candidates that are fitted at most to find the best.
    worse : float
        Rise of the held-out errors of all channels together, in its standard errors over blocks, that no
        effect survives at most horizons, unless the likelihood of that log rises by as many of its own.
    better : float
        Fall of them, likewise and averaged over horizons, from which on a log is surely predicted better.
    confirmed : float
        Where something remains: fall of twice the negative log likelihood of the held-out log, in its
        standard errors over blocks, that a name needs unless predictions surely get better: what is no effect
        reaches it in 5 %. A usual level, chosen after a false name with t = 1.5 was seen.
    most : float
        Part of the squared held-out errors at a horizon, all channels together, that confirms a name by
        itself. A few events may hold nearly all of the error; over all blocks their t is then about one.
    visible : float
        That standard error from which on the held-out log can judge. An effect as large as it was fitted
        would bring a quarter of it in standard errors (a log ratio of likelihoods has four times its mean as
        variance), on average what `confirmed` asks.
    """

    level: float = 0.01
    least: float = 20.0
    each: float = 4.0
    other_sign: float = 0.05
    blocks: int = 6
    apart: float = 12.0
    apart_t: float = 2.0
    chance: float = 0.05
    remains: float = 28.0
    negligible: float = 4e-3
    share: float = 0.4
    alike: float = 0.8
    tries: int = 4
    worse: float = 3.0
    better: float = 2.0
    confirmed: float = 1.64
    most: float = 0.5
    visible: float = 6.6

    def penalised(self, fit: Fit) -> float:
        """Return minus twice the log likelihood of a fit, and `each` for each of its unknowns."""
        return fit.cost + self.each * len(fit.p)

    def left(self, fit: Fit) -> NDArray[np.bool_]:
        """Return in which equations a fit is left with process noise."""
        return np.asarray(fit.noise.process > self.negligible * fit.problem.accelerations)

    def spread(self, looked_at: int) -> float:
        """Return the largest standard deviation from block to block, in parts of a coefficient.

        Examples
        --------
        >>> round(CRITERIA.spread(40), 2), round(CRITERIA.spread(3), 2)
        (0.33, 0.47)
        """
        return float(1.0 / norm.isf(self.other_sign / max(looked_at, 1)))


#: What the package uses.
CRITERIA = Criteria()
