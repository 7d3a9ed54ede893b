"""The groups and channels of an MDF file, read by asammdf; run by :mod:`.apart`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

#: The files that were opened; the last is read.
_opened: list[Any] = []


def structure(file: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the groups of a file: name, rows, bytes of a row, master channel, channels of numbers."""
    from asammdf import MDF

    measured = MDF(file)
    _opened.append(measured)
    return [_group(measured, k, group) for k, group in enumerate(measured.groups)], {}


def _group(measured: Any, number: int, group: Any) -> dict[str, Any]:
    at = measured.masters_db.get(number)
    arrays = getattr(group, "channel_dependencies", None) or [None] * len(group.channels)
    channels = [  # the elements of an array are channels of their own, too
        (c.name, k, _unit(c))
        for k, c in enumerate(group.channels)
        if k != at and not arrays[k] and _is_number(c, measured)
    ]
    master = group.channels[at] if at is not None else None
    return {
        "name": str(getattr(group.channel_group, "acq_name", "") or "").strip(),
        "rows": int(group.channel_group.cycles_nr),
        "width": int(group.channel_group.samples_byte_nr),
        "all": [c.name for c in group.channels],
        "channels": channels,
        "master": str(master.name) if master is not None else "index",
        "unit": _unit(master) if master is not None else "",
        "timed": master is not None and getattr(master, "sync_type", 1) == 1,
    }


def values(group: int, channels: list[int | None]) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return channels of a group, the master for None: labels; numbers, raw and invalid samples."""
    found: dict[str, Any] = {}
    about: list[dict[str, Any]] = []
    for n, channel in enumerate(channels):
        if channel is None:
            about.append({})
            found[f"{n}"] = np.asarray(_opened[-1].get_master(group))
            continue
        said, numbers, raw = _channel(group, channel)
        about.append(said)
        found[f"{n}"] = numbers
        if said.get("labels"):
            found[f"{n} raw"] = raw.samples
        if raw.invalidation_bits is not None and np.any(raw.invalidation_bits):
            found[f"{n} invalid"] = np.asarray(raw.invalidation_bits, dtype=bool)
    return about, found


def _channel(group: int, channel: int) -> tuple[dict[str, Any], Any, Any]:
    measured, where = _opened[-1], {"group": group, "index": channel, "ignore_invalidation_bits": True}
    raw = measured.get(**where, raw=True)
    labels = list(_labels(raw.conversion))
    if not labels:
        numbers = np.asarray(measured.get(**where).samples)
        return {}, numbers if numbers.dtype.kind in "biuf" else np.asarray(raw.samples), raw
    own = raw.conversion.referenced_blocks.get("default_addr")
    converts = hasattr(own, "convert")
    said = {
        "labels": labels,
        "bits": int(measured.groups[group].channels[channel].bit_count),
        "scaled": converts and (getattr(own, "a", 0.0), getattr(own, "b", 0.0)) != (1.0, 0.0),
    }
    return said, own.convert(raw.samples) if converts else raw.samples, raw


def frames(group: int) -> tuple[None, dict[str, Any]]:
    """Return the frames of a group; `extended`, `lengths` and `channels` where they are stated."""
    measured = _opened[-1]
    names = {c.name for c in measured.groups[group].channels}
    wanted = {
        "ids": "ID", "extended": "IDE", "data": "DataBytes", "lengths": "DataLength", "channels": "BusChannel"
    }  # fmt: skip
    found = {
        ours: np.asarray(measured.get(f"CAN_DataFrame.{theirs}", group=group, raw=True).samples)
        for ours, theirs in wanted.items()
        if f"CAN_DataFrame.{theirs}" in names
    }
    return None, {**found, "times": np.asarray(measured.get_master(group))}


def _labels(conversion: Any) -> Iterator[tuple[float, float, str]]:
    """Yield first value, last value and text of each label of a conversion."""
    blocks = getattr(conversion, "referenced_blocks", None) or {}
    for k in range(len(blocks)):
        text = blocks.get(f"text_{k}")
        if not isinstance(text, bytes) or not text:
            continue
        at = getattr(conversion, f"val_{k}", getattr(conversion, f"param_val_{k}", None))  # MDF 4, MDF 3
        low, high = getattr(conversion, f"lower_{k}", at), getattr(conversion, f"upper_{k}", at)
        if low is not None and high is not None:
            yield float(low), float(high), text.decode("utf-8", errors="replace").strip("\0 ")


def _is_number(channel: Any, measured: Any) -> bool:
    """Return whether a channel contains integers or floats; type codes differ between versions of MDF."""
    kind = int(channel.data_type)
    return kind <= 5 if str(measured.version) >= "4" else kind not in (7, 8)


def _unit(channel: Any) -> str:
    text = getattr(channel, "unit", "") or getattr(getattr(channel, "conversion", None), "unit", "") or ""
    return text.decode("latin-1") if isinstance(text, bytes) else str(text)
