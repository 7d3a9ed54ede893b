"""The next experiment: commands that set rivals apart, or tell more of a coefficient that is known badly.

Commands keep to what was driven in the logs; where the model bounds an input, to at most twice that within
the bounds, and to no direction that was never driven.

Every manoeuvre of a family is simulated with one rival as the truth and the other fitted to it, coefficients
and all, and the other way round: what the fit cannot take up is what the added log will say (the
discrimination design of Atkinson and Fedorov, Biometrika 62, 1975, over a family instead of a continuum).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.manoeuvres import Manoeuvre, family, reach
from hovercontrol.discrepancy.noise import Noise
from hovercontrol.discrepancy.reduce import scaled_inverse
from hovercontrol.discrepancy.subject import Subject, structure, timing, unknowns
from hovercontrol.discrepancy.windowed import Windowed
from hovercontrol.files import write_whole
from hovercontrol.identify.measure import Measured

Array = NDArray[np.float64]

#: Fall of minus twice the log likelihood that settles a case, as an expectation.
SETTLES = 40.0

#: A coefficient of which the standard error is more than this part is known badly.
BADLY = 0.1

#: Shortest step between two commands of a proposal [s].
TICK = 0.02


@dataclass(frozen=True, eq=False)
class Experiment:
    """A proposal.

    Attributes
    ----------
    name : str
        Of the manoeuvre: ``"spin"``.
    text : str
        One sentence: what to drive, and why.
    time : ndarray, shape (n,)
        [s].
    commands : dict of str to ndarray, shape (n,)
        By the plant's inputs, each held until the next row.
    worth : float
        Expected fall of minus twice the log likelihood between the rivals; or the factor by which the
        standard error of a badly known coefficient falls.
    """

    name: str
    text: str
    time: Array
    commands: Mapping[str, Array]
    worth: float

    def save(self, path: str | Path) -> Path:
        """Write the commands to a CSV file with the columns of a log."""
        rows = np.column_stack([self.time, *self.commands.values()])
        head = ",".join(["time", *self.commands])
        return write_whole(
            Path(path), lambda p: np.savetxt(p, rows, delimiter=",", fmt="%.6g", header=head, comments="")
        )


def separate(
    final: Fit, one: Subject, other: Subject, names: tuple[str, str], *, seed: int = 0
) -> Experiment | str:
    """Return the manoeuvre that best tells two models apart, or why none does.

    Parameters
    ----------
    final : Fit
        Of the logs so far.
    one, other : Model or BlockModel
        As fitted to them.
    names : (str, str)
        What is in the one and in the other.
    seed : int, optional
        Of the manoeuvres drawn at random.
    """
    best: tuple[float, Manoeuvre, Data] | None = None
    for manoeuvre in _family(final, seed):
        worth, runs = np.inf, None
        for truth, rival in ((one, other), (other, one)):
            seen = predicted(truth, final.windowed.data, manoeuvre)
            runs = runs or seen
            if not np.isfinite(seen.logs[0].values).all():
                worth = 0.0
                break
            worth = min(worth, _left(final, rival, seen))
        if runs is not None and (best is None or worth > best[0]):
            best = worth, manoeuvre, runs
    first, second = names
    if best is None or best[0] < SETTLES:
        found = f" ({best[0]:.2g} of the {SETTLES:g} needed, by {best[1].name})" if best else ""
        return f"no manoeuvre within the limits of the commands tells {first} from {second}{found}"
    worth, manoeuvre, seen = best
    text = (
        f"Drive {manoeuvre.text}{_room(seen)}: {first} and {second} then differ by about {worth:.3g} "
        f"in twice the log likelihood ({SETTLES:g} settle it)."
    )
    return Experiment(manoeuvre.name, text, manoeuvre.time, manoeuvre.commands, worth)


def only_late(model: Subject, name: str) -> bool:
    """Tell whether all that an effect of a model says is how late something is.

    Examples
    --------
    >>> from hovercontrol.effects import effect
    >>> from hovercontrol.vehicles import c17_simulation
    >>> late = c17_simulation().with_effects([effect("time_offset", seconds=0.1), effect("slope", x=0.1)])
    >>> only_late(late, "time_offset"), only_late(late, "slope")
    (True, False)
    """
    times = {parameter.rpartition(".")[2] for parameter in timing(model) if parameter}
    own = {model.effect(name).parameter(k) for k in model.effect(name).numbers}
    return bool(own & set(unknowns(model))) and own <= times


def same_time(names: tuple[str, str]) -> str:
    """Return why nothing that is driven tells two effects apart that say how late something is."""
    first, second = names
    return (
        f"no log tells {first} from {second}: in each, commands that act late and measurements stamped late "
        "are the same; one clock for commands and sensors would, or a sensor's delay measured by itself"
    )


def sharpen(final: Fit, name: str, *, seed: int = 0) -> Experiment | None:
    """Return the manoeuvre that tells most of a badly known coefficient; None if none does.

    Parameters
    ----------
    final : Fit
        Of the logs so far.
    name : str
        A parameter of the fitted model.
    seed : int, optional
        Of the manoeuvres drawn at random.
    """
    w = final.windowed
    j = w.names.index(name)
    now = float(final.covariance[j, j])
    known = final.normal.S + np.diag(final.prior)
    best: tuple[float, Manoeuvre, Data] | None = None
    for manoeuvre in _family(final, seed):
        seen = predicted(final.model, w.data, manoeuvre)
        if not np.isfinite(seen.logs[0].values).all():
            continue
        added = _fit(final, final.model, seen, frozen=True)
        then = float(scaled_inverse(known + added.normal.S)[j, j])
        worth = float(np.sqrt(now / then)) if then > 0.0 else 0.0
        if best is None or worth > best[0]:
            best = worth, manoeuvre, seen
    if best is None or best[0] < 1.5:
        return None
    worth, manoeuvre, seen = best
    text = (
        f"Drive {manoeuvre.text}{_room(seen)}: the standard error of {name} then falls by a factor of "
        f"{worth:.2g}."
    )
    return Experiment(manoeuvre.name, text, manoeuvre.time, manoeuvre.commands, worth)


def predicted(model: Subject, like: Data, manoeuvre: Manoeuvre) -> Data:
    """Return what a model would measure during a manoeuvre, from rest, without noise."""
    block = structure(model)
    inputs = np.array([manoeuvre.commands[s.name] for s in block.inputs])
    n = len(manoeuvre.time)
    start = np.repeat(np.array([s.start for s in block.states])[:, None], n, axis=1)
    empty = Measured(
        manoeuvre.name,
        manoeuvre.time,
        0.0,
        inputs,
        like.channels,
        np.zeros((len(like.channels), n)),
        start,
        ((0, n),),
        ((0, n),),
        (),
        n,
    )
    data = Data((empty,), like.channels, like.noise)
    w = Windowed(model, data, float(manoeuvre.time[-1]) + 1.0)
    w.set_step(w.start, w.cut.start)
    residual, _ = w.linearise(w.start, w.cut.start, jacobian=False)
    seen = Measured(
        empty.name, empty.time, 0.0, inputs, empty.channels, -residual[0].T, w.x[:, :, 0].T,
        empty.segments, empty.stretches, (), n,
    )  # fmt: skip
    return Data((seen,), like.channels, like.noise)


def _family(final: Fit, seed: int) -> Sequence[Manoeuvre]:
    data = final.windowed.data
    names = [s.name for s in final.windowed.block.inputs]
    every = np.concatenate([m.inputs for m in data.logs], axis=1)
    signals = dict(zip(names, final.windowed.block.inputs, strict=True))
    limits = {name: reach(signals[name], row) for name, row in zip(names, every, strict=True)}
    step = float(np.median(np.diff(data.logs[0].time)))
    return family(limits, max(step, TICK), seed)


def _fit(final: Fit, model: Subject, data: Data, frozen: bool = False) -> Fit:
    length = final.windowed.length
    noise: Noise | None = final.noise if final.noise.has_process else None
    if noise is not None:
        free = len(Windowed(model, data, length).free)
        noise = noise.like(free)
    return fit(model, data, length, noise, frozen=frozen)


def _left(final: Fit, rival: Subject, seen: Data) -> float:
    """Return the misfit of a rival, fitted, to what it should not explain: no noise is in it."""
    found = _fit(final, rival, seen)
    return float(found.normal.rest)


def _room(seen: Data) -> str:
    """Return in words how much floor a manoeuvre takes."""
    log = seen.logs[0]
    if not {"x", "y"} <= set(log.channels):
        return ""
    wide, deep = (float(np.ptp(log.values[log.channels.index(c)])) for c in ("x", "y"))
    return f" (takes {wide:.0f} m by {deep:.0f} m)"
