"""Thresholds of the discrepancy workflow: the evidence that an effect needs to be named, with reasons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from hovercontrol.identification.engine.fit import Fit


class Likely(Protocol):
    """A fit: twice its negative log likelihood, and its unknowns."""

    @property
    def cost(self) -> float:
        """Twice the negative log likelihood."""

    @property
    def p(self) -> NDArray[np.float64]:
        """The unknowns, shape (P,)."""


@dataclass(frozen=True)
class Criteria:
    """Thresholds.

    Attributes
    ----------
    level : float
        Probability of one false name among all candidates considered: the p-value over blocks must lie below
        this level divided by the number of candidates (Bonferroni).
    least, each : float
        An effect with k parameters must reduce twice the negative log likelihood by ``least + each k``. This
        is a likelihood ratio of e^10, and e^2 more for each parameter (a Bayes factor that Kass and Raftery,
        JASA 90 (1995), call decisive). `level` asks for a similar chi-squared among sixty candidates.
    other_sign : float
        Probability, shared among all candidates considered, that a further block gives the coefficient the
        opposite sign. It limits the standard deviation of the coefficient from block to block, measurement
        noise removed (:meth:`spread`): a third of the coefficient among forty candidates, 0.47 among the
        three drags of an axis. A real cause is invariant, a substitute for it is not (Peters, Buehlmann,
        Meinshausen, J. R. Stat. Soc. B 78 (2016)).
    blocks : int
        Minimum number of blocks with information on a coefficient; with fewer, their scatter is not tested.
    apart : float
        A rival is kept if its penalised cost exceeds that of the named effect by less than this (a
        likelihood ratio of e^6).
    apart_t : float
        A rival is also kept if it trails by fewer than this many standard errors of the difference over
        blocks (Vuong, Econometrica 57 (1989)). At two, 2.5 % of the true ones trail by more.
    chance : float
        An effect that contains another as a limit is named in its place, or is its rival, only if its extra
        parameters are significant at this level, divided by the number of candidates (chi-squared test of the
        likelihood ratio: Wilks, Ann. Math. Stat. 9 (1938)).
    remains : float
        An equation has a remainder if process noise in it reduces twice the negative log likelihood by more
        than this. The noise has two parameters, its size and its correlation time.
    negligible : float
        Process noise below this fraction of the observed acceleration counts as zero: the steps of the
        simulation cause as much.
    share : float
        A candidate is not fitted if its cross-validated gain is below this fraction of the best one's.
    tries : int
        Maximum number of candidates fitted to find the best.
    worse : float
        An effect is dropped if, at most horizons, the held-out errors of all channels together rise by more
        than this many standard errors over blocks, unless the likelihood of the held-out log rises by more
        than this many of its own standard errors.
    better : float
        A log counts as predicted better if these errors, averaged over horizons, fall by more than this many
        standard errors.
    confirmed : float
        Where a remainder is left and predictions do not get significantly better, an effect must reduce twice
        the negative log likelihood of the held-out log by this many standard errors over blocks. A false
        effect does so in 5 % of cases. A usual level, chosen after a false name with t = 1.5 was seen.
    most : float
        An effect that removes this fraction of the squared held-out errors at one horizon, all channels
        together, is confirmed by that alone. A few events may cause nearly all of the error; t over all
        blocks is then about one.
    visible : float
        The held-out log can judge an effect if the standard error s of its gain is above this. Twice a log
        likelihood ratio of mean mu has the variance 4 mu, so an effect as large as fitted would gain
        mu = s^2/4, or t = mu/s = s/4: on average what `confirmed` asks.
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
    tries: int = 4
    worse: float = 3.0
    better: float = 2.0
    confirmed: float = 1.64
    most: float = 0.5
    visible: float = 6.6

    def penalised(self, fit: Likely) -> float:
        """Return the penalised cost of a fit: minus twice the log likelihood, plus `each` per unknown."""
        return fit.cost + self.each * len(fit.p)

    def left(self, fit: Fit) -> NDArray[np.bool_]:
        """Return the equations in which a fit has more than negligible process noise, as a mask."""
        return np.asarray(fit.noise.process > self.negligible * fit.problem.accelerations)

    def spread(self, looked_at: int) -> float:
        """Return the largest standard deviation allowed from block to block, relative to the coefficient.

        A normal estimate of mean 1 and standard deviation s is negative with probability Phi(-1/s). Set to
        `other_sign` over n candidates this gives ``s = 1 / Phi^-1(1 - other_sign/n)``.

        Examples
        --------
        >>> round(CRITERIA.spread(40), 2), round(CRITERIA.spread(3), 2)
        (0.33, 0.47)
        """
        return float(1.0 / norm.isf(self.other_sign / max(looked_at, 1)))


#: The values in use.
CRITERIA = Criteria()
