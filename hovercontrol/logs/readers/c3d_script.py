"""The contents of a C3D file, read by ezc3d; run by :mod:`.apart`."""

from __future__ import annotations

from typing import Any

import numpy as np


def contents(file: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return names, units, rates [Hz] and the number of the first frame; points and analog channels."""
    import ezc3d

    found = ezc3d.c3d(file)
    about, header = found["parameters"], found["header"]

    def texts(group: str, name: str) -> list[str]:
        return [str(text).strip() for text in about[group].get(name, {}).get("value", [])]

    return {
        "labels": texts("POINT", "LABELS"),
        "units": texts("POINT", "UNITS"),
        "analog_labels": texts("ANALOG", "LABELS"),
        "analog_units": texts("ANALOG", "UNITS"),
        "rate": float(header["points"]["frame_rate"]),
        "analog_rate": float(header["analogs"]["frame_rate"]),
        "first": int(header["points"]["first_frame"]),
    }, {"points": np.asarray(found["data"]["points"])[:3], "analogs": np.asarray(found["data"]["analogs"])}
