"""GPX tracks: ``time``, ``lat``, ``lon``, ``ele``, and the numbers of extensions such as ``speed``."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, faults


def gpx(file: Path) -> Table:
    """Open the points of all tracks, in their order.

    Raises
    ------
    InputError
        If the file is damaged, or has no point with a time.
    """
    rows: list[dict[str, Any]] = []
    said = "GPX track"
    with faults(file, "GPX"):
        try:
            for _, item in ElementTree.iterparse(file, events=("end",)):
                if item.tag.rpartition("}")[2] == "trkpt":
                    rows.append(_point(item))
                    item.clear()
        except ElementTree.ParseError as error:  # the receiver lost its power
            said = f"GPX track up to a break: {error}"
    rows = [row for row in rows if "time" in row]
    if not rows:
        raise InputError(f"{file}: a GPX file: expected points of a track with times, found none")
    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = {
        name: np.array([row.get(name, np.nan) for row in rows], dtype=None if name == "time" else float)
        for name in names
    }
    units = {"time": "ns", "lat": "deg", "lon": "deg", "ele": "m"}
    return Table.of(file, "track", columns, "time", units, said)


def _point(item: Any) -> dict[str, Any]:
    found: dict[str, Any] = {"lat": float(item.get("lat")), "lon": float(item.get("lon"))}
    for inside in item.iter():
        name, text = inside.tag.rpartition("}")[2], (inside.text or "").strip()
        if name == "time" and text:
            found["time"] = int(np.datetime64(text.removesuffix("Z"), "ns").astype(np.int64))
        elif inside is not item and text:
            try:
                found[name] = float(text)
            except ValueError:
                continue
    return found
