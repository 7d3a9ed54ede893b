"""Several trials in one file: where each begins."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.logs.log import Floats, Trial


@dataclass(frozen=True)
class TrialCriteria:
    """Thresholds for the start of a new trial in a file.

    No published source: set by hand, tested in tests/logs/test_trials.py.

    Attributes
    ----------
    rows : int
        Minimum number of rows of a trial whose time restarts; a single row out of order is an error.
    back : float
        Minimum jump back in time, as a fraction of the previous trial.
    on : float
        Maximum mean time step in the first `rows` rows after the jump, in usual time steps: time must
        continue as before.
    pause : float
        Minimum pause [s] between two trials; shorter gaps are bridged by the model.
    steps : float
        The same in usual time steps; both must be exceeded.
    """

    rows: int = 10
    back: float = 0.5
    on: float = 5.0
    pause: float = 30.0
    steps: float = 100.0


#: The values in use.
TRIALS = TrialCriteria()


def trial_rows(time: Floats, label: Floats | None = None) -> NDArray[np.intp]:
    """Return the first row of each trial; empty if there is one trial.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times as in the file [s].
    label : ndarray, shape (n,), optional
        The trial of each row. Without it, a trial begins where time restarts or after a long pause.

    Examples
    --------
    >>> t = 0.1 * np.arange(50)
    >>> trial_rows(np.concatenate([t, t, t + 100.0])).tolist()
    [0, 50, 100]
    >>> trial_rows(t, t // 2).tolist()
    [0, 20, 40]
    """
    if label is not None:
        firsts = np.flatnonzero(np.diff(label)) + 1
    else:
        again = _restarts(time)
        step = np.diff(time)
        usual = float(np.median(np.abs(step))) if step.size else 0.0
        firsts = np.union1d(again, np.flatnonzero(step > max(TRIALS.pause, TRIALS.steps * usual)) + 1)
    return np.append(0, firsts).astype(np.intp) if firsts.size else np.empty(0, dtype=np.intp)


def _restarts(time: Floats) -> NDArray[np.intp]:
    """Return the rows at which time restarts; empty if time runs backwards in any other way."""
    back = np.flatnonzero(np.diff(time) < 0.0) + 1
    edges = [0, *back.tolist(), time.size]
    longest = TRIALS.on * TRIALS.rows * float(np.median(np.abs(np.diff(time)))) if back.size else 0.0
    for k, row in enumerate(back.tolist(), 1):
        begin, end = edges[k - 1], edges[k + 1]
        if (
            min(row - begin, end - row) < TRIALS.rows
            or time[row - 1] - time[row] < TRIALS.back * (time[row - 1] - time[begin])
            or time[row + TRIALS.rows - 1] - time[row] > longest
            or time[row + 1] > time[row - 1]  # one row out of order
        ):
            return np.empty(0, dtype=np.intp)
    return back


def in_sequence(time: Floats, firsts: NDArray[np.intp]) -> tuple[Floats, tuple[Trial, ...]]:
    """Return the times [s] of trials placed one after the other, and the trials.

    The times do not change if each trial begins after the end of the previous one. Otherwise each trial is
    shifted by a fixed round number of seconds more than the previous one. This number is at least twice the
    time span of all trials.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Increasing within each trial [s].
    firsts : ndarray of int
        The first row of each trial.

    Examples
    --------
    >>> time, trials = in_sequence(np.array([0.0, 1.0, 2.0, 0.0, 1.0]), np.array([0, 3]))
    >>> time.tolist(), [trial.shift for trial in trials]
    ([0.0, 1.0, 2.0, 5.0, 6.0], [0.0, 5.0])
    """
    if (np.diff(time) > 0.0).all():
        return time, tuple(Trial(int(first)) for first in firsts)
    span = max(2.0 * float(np.ptp(time)), 1e-9)
    power = 10.0 ** math.floor(math.log10(span))
    step = power * next(k for k in (1, 2, 5, 10) if k * power >= span)
    number = np.searchsorted(firsts, np.arange(time.size), side="right") - 1
    return time + step * number, tuple(Trial(int(first), step * k) for k, first in enumerate(firsts))


def trials_text(file: str, trials: tuple[Trial, ...], column: str = "") -> str:
    """Return the one-line note on the trials of a file.

    Examples
    --------
    >>> trials_text("a.csv", (Trial(0), Trial(100, 20.0)))
    'a.csv: 2 trials, since time begins again; each is moved 20 s further than the last'
    """
    shift = trials[1].shift
    why = f"by column {column!r}" if column else "since time " + ("begins again" if shift else "pauses")
    later = f"; each is moved {shift:g} s further than the last" if shift else ""
    return f"{file}: {len(trials)} trials, {why}{later}"
