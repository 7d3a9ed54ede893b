"""Replay a log through a monitor: the timeline of its alarms and of the evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.folders import write_folder
from hovercontrol.base.plain_json import json_text, plain
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.identification.monitor.alarms import Alarm, Alarms
from hovercontrol.identification.monitor.feed import Feed, Tick, candidates_in, parameter_of
from hovercontrol.identification.monitor.notes import Note
from hovercontrol.identification.monitor.sensors import rounded_to
from hovercontrol.logs.log import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
@dataclass(frozen=True, eq=False)
class Replayed:
    """A log as a monitor saw it; the result of :func:`replay`.

    Attributes
    ----------
    log : str
        Name of the log.
    time : ndarray, shape (K,)
        Times of the ticks [s].
    evidence : dict of str to ndarray, shape (K,)
        Twice the log-likelihood ratio, by candidate.
    threshold : float
        Of the evidence, for an alarm.
    alarms : tuple of Alarm
        In the order of their times.
    late, restarts : int
        Rows left out because of their times; starts anew, after gaps of more than 30 s for one.
    notes : tuple of str
        Where the noise and the threshold come from, then what is wrong with the rows, one line each.
    hold : float
        Time after an alarm for which evidence is collected [s].

    Examples
    --------
    >>> import numpy as np
    >>> found = Replayed("run.csv", np.arange(3.0), {"v_bias": np.ones(3)}, 20.0, (), 0, 0, ())
    >>> print(found.text())
    run.csv: nothing changed in 2.0 s
    """

    log: str
    time: Array
    evidence: dict[str, Array]
    threshold: float
    alarms: tuple[Alarm, ...]
    late: int
    restarts: int
    notes: tuple[str, ...] = ()
    hold: float = 5.0

    def __repr__(self) -> str:
        return f"Replayed: {self.text()}"

    @property
    def seconds(self) -> float:
        """Length of the replay [s]."""
        return float(self.time[-1] - self.time[0]) if self.time.size else 0.0

    def text(self) -> str:
        """Return the timeline as plain text."""
        lines = list(self.notes)
        if self.late:
            lines.append(f"{self.log}: rows left out because of their times: {self.late}")
        if not self.alarms:
            lines.append(f"{self.log}: nothing changed in {self.seconds:.1f} s")
        for alarm in self.alarms:
            seen = ""
            if alarm.kind == "dead":
                ended = alarm.last < self.time[-1] - 1e-9
                seen = f" until {alarm.last:.1f} s" if ended else " until the end"
            elif alarm.last > alarm.time + self.hold and not math.isfinite(alarm.ended):
                seen = f"; still so at {alarm.last:.1f} s"
            lines.append(f"{alarm}{seen}")
        return "\n".join(lines)

    def to_json(self) -> dict[str, Any]:
        """Return the result for JSON; see ``hovercontrol schema monitor``."""
        found: dict[str, Any] = plain(
            {
                "log": self.log,
                "seconds": self.seconds,
                "ticks": int(self.time.size),
                "threshold": self.threshold,
                "candidates": list(self.evidence),
                "alarms": [alarm_json(a) for a in self.alarms],
                "largest_evidence": {k: float(v.max(initial=0.0)) for k, v in self.evidence.items()},
                "late_rows": self.late,
                "restarts": self.restarts,
                "notes": list(self.notes),
            }
        )
        return found

    def plot(self) -> Figure:
        """Return a figure: evidence of each candidate over time, the threshold, alarms and onsets."""
        from hovercontrol.identification.monitor.display import draw

        return open_in_pyplot(draw(self))

    def _repr_html_(self) -> str:
        from hovercontrol.identification.monitor.display import replayed_html

        return replayed_html(self)

    def save(self, folder: str | Path) -> list[Path]:
        """Write result.json, timeline.csv, timeline.png and timeline.svg.

        Parameters
        ----------
        folder : path
            Created if it does not exist.
        """
        from hovercontrol.identification.monitor.display import draw

        def write(temporary: Path) -> None:
            (temporary / "result.json").write_text(json_text(self.to_json()), encoding="utf-8")
            table = {"time": self.time, **{f"evidence_{k}": v for k, v in self.evidence.items()}}
            np.savetxt(
                temporary / "timeline.csv",
                np.stack(list(table.values()), axis=1),
                fmt="%.6g",
                delimiter=",",
                header=",".join(table),
                comments="",
            )
            figure = draw(self)
            for suffix in ("png", "svg"):
                figure.savefig(temporary / f"timeline.{suffix}", dpi=110)

        return write_folder(folder, write)


def alarm_json(alarm: Alarm) -> dict[str, Any]:
    """Return an alarm for JSON."""
    found: dict[str, Any] = plain(
        {
            "time": alarm.time,
            "name": alarm.name,
            "kind": alarm.kind,
            "change": alarm.change,
            "std": alarm.std,
            "unit": alarm.unit,
            "since": alarm.since,
            "rivals": list(alarm.rivals),
            "evidence": alarm.evidence,
            "last": alarm.last,
            "rate": alarm.rate,
            "rate_std": alarm.rate_std,
            "ended": alarm.ended,
            "beside": alarm.beside,
        }
    )
    return found


@checked
def replay(
    watch: Block,
    log: Log,
    *,
    hold: float | None = None,
    notes: Sequence[str] = (),
    progress: Callable[[float, str], None] | None = None,
) -> Replayed:
    """Replay a log through a monitor, in machine code.

    Parameters
    ----------
    watch : Block
        From :func:`~hovercontrol.identification.monitor.monitor.monitor`. With ``lost_samples`` gaps and lost
        samples are passed as such; without, the last sample is held.
    log : Log
        With the monitor's measured channels and commands.
    hold : float, optional
        Time after an alarm for which evidence is collected [s] (default: 2.5 times `settle` of the monitor,
        5 s for a craft).
    notes : sequence of str, optional
        Lines to begin the text with.
    progress : callable, optional
        Called with the finished fraction (0 to 1) and a text on the current step.

    Returns
    -------
    Replayed

    Raises
    ------
    InputError
        If the Block is not a monitor, or the log lacks one of its inputs.

    Examples
    --------
    >>> import numpy as np
    >>> import hovercontrol as hc
    >>> v, F, m = hc.Signal("v", "m/s"), hc.Signal("F", "N"), hc.Signal("m", "kg", start=2.0)
    >>> cart = hc.Block("cart", [v], [F], [v], [m], {"v": F.symbol / m.symbol})
    >>> watch = hc.monitor(
    ...     cart, ["m"], false_alarms_per_hour=1.0, period=0.1, measured=["v"],
    ...     process_noise={"v": 0.02}, measurement_noise={"v": 0.01},
    ... )
    >>> t = 0.1 * np.arange(300)
    >>> rng = np.random.default_rng(1)
    >>> F = np.where(t % 10.0 < 5.0, 1.0, -1.0)
    >>> m = np.where(t < 15.0, 2.0, 1.8)
    >>> v = np.concatenate([[0.0], np.cumsum(0.1 * F / m)[:-1]]) + 0.01 * rng.normal(size=t.size)
    >>> found = hc.replay(watch, hc.Log("run", t, {"v": v, "F": F}))
    >>> [alarm.name for alarm in found.alarms]
    ['m']
    """
    if hold is not None:
        positive("replay: hold", hold)
    report = progress or (lambda part, what: None)
    report(0.0, "compiling the monitor")
    feed, alarms = Feed(watch), Alarms(watch, hold)
    names = [*feed.measured, *feed.commands]
    for name in names:
        if not log.has(name):
            raise InputError(
                f"replay: log {log.name!r} has no column {name!r}{did_you_mean(name, log.columns)}"
            )
    seconds, settle_time = float(log.time[-1] - log.time[0]), parameter_of(watch, "settle")
    if seconds <= settle_time:
        raise InputError(
            f"replay: log {log.name!r} lasts {seconds:g} s: the tests begin {settle_time:g} s after the start"
        )
    columns = [(name, log[name]) for name in names]
    ticks: list[Tick] = []
    faults: list[Note] = []

    def take(found: Iterable[Tick | Note]) -> None:
        for one in found:
            if isinstance(one, Tick):
                ticks.append(one)
            elif not one.name:
                faults.append(one)
            for _ in events(feed, alarms, one):
                pass

    for k, time in enumerate(log.time.tolist()):
        take(feed.rows(time, {name: float(column[k]) for name, column in columns}))
        if k % 500 == 0:
            report(k / log.time.size, "replaying")
    take(feed.end())
    if ticks:
        list(alarms.end(ticks[-1].time))
    report(1.0, "done")
    lines = [*notes, *(f"{log.name}: {note.text}" for note in faults if note.rows < 2)]
    lines += [f"{log.name}: {line}" for line in _understated(watch, log, feed)]
    return _replayed(watch, log.name, feed, alarms, ticks, lines)


def _understated(watch: Block, log: Log, feed: Feed) -> Iterator[str]:
    """Give a line if a monitor knows no errors of its model, and for each channel whose rounding adds noise.

    Values rounded to q have the additional variance ``q^2/12``. The dispersion along a log covers it.
    """
    if not feed.knows_errors:
        yield (
            "the monitor knows no errors of its coefficients and noise (coefficient_std, or dispersion=True "
            "with a reference log): such errors raise more false alarms than asked for"
        )
    for name in () if feed.knows_dispersion else feed.measured:
        known = parameter_of(watch, f"measurement_noise_{name}")
        q = rounded_to(log[name], known)
        if q:
            unit = watch.signal(name).unit
            yield (
                f"{name} is rounded to {q:.3g} {unit}, so its noise is "
                f"{math.sqrt(known**2 + q**2 / 12.0):.2g} {unit} and not {known:.2g} {unit} as the monitor "
                "takes it: more false alarms than asked for"
            )


def events(feed: Feed, alarms: Alarms, one: Tick | Note) -> Iterator[tuple[str, Alarm]]:
    """Give the events of a tick, or of a note on a command; restart the tests after an alarm."""
    if isinstance(one, Note):
        yield from alarms.command(one)
        return
    for event, alarm in alarms.tick(one):
        yield event, settle(feed, alarms, event, alarm)
    if alarms.reset_due:
        feed.reset()


def settle(feed: Feed, alarms: Alarms, event: str, alarm: Alarm) -> Alarm:
    """Put a change that is named without a rival into the monitor; return the alarm with its size.

    Of two changes at once, both must be such that they can be put into it.
    """
    if event == "ended" and alarms.open is None and feed.holds(alarm.name):
        feed.adopt(alarm.name, -alarm.change)
    held = all(feed.holds(name) for name in (alarm.name, alarm.beside or alarm.name))
    if event != "named" or alarm.rivals or not math.isnan(alarm.ended) or not held:
        return alarm
    taken = feed.adopt(alarm.name, alarm.change)
    if taken == 0.0:  # at its bound already, another cause is likelier
        return alarm
    alarms.took(alarm, taken)
    return replace(alarm, change=taken)


def _replayed(
    watch: Block, log: str, feed: Feed, alarms: Alarms, ticks: Sequence[Tick], notes: Sequence[str]
) -> Replayed:
    outputs = [s.name for s in watch.outputs]
    values = np.array([tick.values for tick in ticks]).reshape(len(ticks), len(outputs))
    return Replayed(
        log,
        np.array([tick.time for tick in ticks]),
        {name: values[:, outputs.index(f"evidence_{name}")] for name in candidates_in(watch)},
        threshold_of(watch),
        tuple(sorted(alarms.found, key=lambda a: a.time)),
        feed.clock.late.total,
        feed.restarts,
        tuple(notes),
        alarms.hold,
    )


def threshold_of(watch: Block) -> float:
    """Return the threshold of the evidence of a monitor."""
    return parameter_of(watch, "threshold")
