"""Diagnose, propose an experiment, take its log, diagnose again: until settled or not worth another run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.arguments import at_least
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.craft.models.interface import AnyModel
from hovercontrol.identification.diagnose.diagnose import diagnose
from hovercontrol.identification.diagnose.diagnosis import Diagnosis
from hovercontrol.identification.diagnose.experiment.predict import Search
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.diagnose.experiment.propose import next_experiment
from hovercontrol.logs import Log

#: Number of random manoeuvres among those from which an experiment is chosen.
DRAWN = 10


@checked
@dataclass(frozen=True, eq=False)
class Campaign:
    """Diagnoses, each on one log more, and the experiments between them.

    Attributes
    ----------
    diagnoses : tuple of Diagnosis
        The last one is on all logs. Its `experiment` is the next one; None if it is settled, or not worth
        another run.
    experiments : tuple of Experiment
        Those that were run.
    logs : tuple of Log
        All training logs.
    """

    diagnoses: tuple[Diagnosis, ...]
    experiments: tuple[Experiment, ...]
    logs: tuple[Log, ...]

    @property
    def diagnosis(self) -> Diagnosis:
        """The diagnosis on all logs."""
        return self.diagnoses[-1]

    @property
    def next(self) -> Experiment | None:
        """The next experiment; None if it is settled, or no experiment is worth it."""
        return self.diagnosis.experiment

    def __repr__(self) -> str:
        after = self.diagnosis.advice or "Settled: no further experiment is needed."
        runs = [f"after {len(self.logs)} logs, {len(self.experiments)} of them proposed"]
        return "\n".join([*runs, repr(self.diagnosis), after])


@checked
def experiment(
    model: AnyModel,
    logs: Sequence[Log],
    holdout: Log | Sequence[Log] | None = None,
    *,
    fly: Callable[[Experiment], Log] | None = None,
    flights: int = 2,
    within: Mapping[str, tuple[float, float]] | None = None,
    fixed: Sequence[str] = (),
    names: Sequence[str] | None = None,
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
) -> Campaign:
    """Propose the experiment that settles a diagnosis; with a machine to run it, go on until it is settled.

    Where the logs do not tell effects apart, or forms of an unknown function, the experiment is the shortest
    manoeuvre in which they surely differ, given what the logs already show; it states how sure the answer
    will be. Where something without a name remains, it is the one that shows most of it. Otherwise it is the
    one that most reduces a large standard error (:mod:`.experiment.propose`).

    Parameters
    ----------
    model, logs, holdout, fixed, names, seed, progress
        As for :func:`hovercontrol.diagnose`.
    fly : callable, optional
        Runs an experiment and returns its log. Without it the next experiment is only proposed.
    flights : int, optional
        Maximum number of experiments to run.
    within : mapping of str to (float, float), optional
        Ranges that measured channels must not leave: ``{"x": (-2, 2), "u": (0, 1.5)}``.

    Returns
    -------
    Campaign

    Raises
    ------
    InputError
        As :func:`hovercontrol.diagnose`; or if a range names a channel that no log has, or is empty.

    Examples
    --------
    A machine with nothing missing needs no experiment:

    >>> import numpy as np
    >>> import hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0)
    >>> F = hc.Signal("F", "m/s^2", lower=-2.0, upper=2.0)
    >>> cart = hc.Block("cart", [v], [F], [v], [k], {"v": F.symbol - k.symbol * v.symbol})
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 10.0, 0.05)
    >>> push = np.repeat(rng.uniform(-1, 1, 20), 10)
    >>> seen = hc.simulate(cart, t, {"F": push}).outputs + 1e-3 * rng.normal(size=t.size)
    >>> found = hc.experiment(cart, [hc.Log("run", t, {"v": seen, "F": push})])
    >>> found.next, found.diagnosis.verdict
    (None, 'none')
    """
    at_least("experiment: flights", flights)
    box = dict(within or {})
    _check_box(logs, box)
    every, diagnoses, run = list(logs), list[Diagnosis](), list[Experiment]()
    while True:
        k = len(run)
        found = diagnose(model, every, holdout, fixed=fixed, names=names, seed=seed, progress=progress)
        search = Search(seed + k, DRAWN, box)
        left = [r.equation.removesuffix("'") for r in found.remainders if r.there]
        proposal, advice = next_experiment(found.selection, found.effects, found.functions, left, search)
        diagnoses.append(replace(found, experiment=proposal, advice=advice))
        if proposal is None or fly is None or k == flights:
            return Campaign(tuple(diagnoses), tuple(run), tuple(every))
        run.append(proposal)
        every.append(fly(proposal))


def _check_box(logs: Sequence[Log], box: Mapping[str, tuple[float, float]]) -> None:
    known = dict.fromkeys(c for log in logs for c in log.columns)
    for name, (low, high) in box.items():
        check_known(name, known, f"experiment: within: no log has {name!r}")
        if not (np.isfinite([low, high]).all() and low < high):
            raise InputError(f"experiment: within: {name}: expected low < high, found {low:g} and {high:g}")
