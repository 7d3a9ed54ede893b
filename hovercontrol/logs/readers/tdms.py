"""TDMS of LabVIEW, read by npTDMS: one table per group, timed by a channel or by a waveform's increment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.matlab import CLOCKS
from hovercontrol.logs.readers.tables import Table, Tables, faults, library, unit_or_none

_START = "wf_start_time"

#: Properties of a waveform's clock.
_CLOCK = ("wf_increment", "wf_start_offset", _START)


def tdms(file: Path) -> Tables:
    """Open a measurement; channels keep their names, or ``group/name`` if two groups have the same name.

    Raises
    ------
    InputError
        If npTDMS is missing, or the file is damaged or contains no channel of numbers.
    """
    module = library(file, "nptdms", "TDMS files", "logs-all", package="npTDMS")
    tables: list[Table] = []
    with faults(file, "TDMS"):
        measured = module.TdmsFile.read(str(file))
        names = [channel.name for group in measured.groups() for channel in group.channels()]
        every = [channel for group in measured.groups() for channel in group.channels() if len(channel)]
        dated = all(_is_waveform(c) == isinstance(c.properties.get(_START), np.datetime64) for c in every)
        for group in measured.groups():
            for rows in sorted({len(channel) for channel in group.channels()} - {0}):
                own = [c for c in group.channels() if len(c) == rows and c.dtype.kind in "biufM"]
                if own:
                    tables.append(_table(file, group.name, own, names, several=bool(tables), dated=dated))
    if not tables:
        raise InputError(f"{file}: a TDMS file without channels of numbers")
    return Tables(file, tables)


def _is_waveform(channel: Any) -> bool:
    return bool(channel.properties.get("wf_increment"))


def _table(
    file: Path, group: str, channels: Sequence[Any], names: list[str], *, several: bool, dated: bool
) -> Table:
    """Return a table; with `dated` times of waveforms are absolute, since all of them state their start."""
    called = {f"{group}/{c.name}" if names.count(c.name) > 1 else c.name: c for c in channels}
    units = {
        name: unit
        for name, c in called.items()
        if (
            unit := unit_or_none(
                str(c.properties.get("unit_string", c.properties.get("NI_UnitDescription", "")))
            )
        )
    }
    units |= {name: "ns" for name, c in called.items() if c.dtype.kind == "M"}
    clock = next((n for n, c in called.items() if c.name.lower() in CLOCKS or c.dtype.kind == "M"), "")
    steps = {tuple(c.properties.get(name) for name in _CLOCK) for c in channels}
    known: dict[str, Any] = {}
    said = ""
    if not clock and len(steps) == 1 and _is_waveform(channels[0]):
        step, offset, start = steps.pop()
        clock = f"{group}/time" if several else "time"
        times = float(offset or 0.0) + step * np.arange(len(channels[0]))
        known[clock], units[clock] = times, "s"
        if dated:
            begin = np.datetime64(start, "ns").astype(np.int64)
            known[clock], units[clock] = begin + np.rint(times * 1e9).astype(np.int64), "ns"
        said = f"times by the increment of the waveform, {step:g} s"

    def load(names: Sequence[str]) -> dict[str, Any]:
        return {n: known[n] if n in known else _numbers(called[n][:]) for n in names}

    name = f"{group} ({len(channels[0])} rows)" if several else group
    return Table(file, name, [*known, *called], len(channels[0]), load, clock, units, said)


def _numbers(values: Any) -> Any:
    found = np.asarray(values)
    if found.dtype.kind == "M":
        return found.astype("datetime64[ns]").astype(np.int64)
    return found.astype(np.uint8) if found.dtype.kind == "b" else found
