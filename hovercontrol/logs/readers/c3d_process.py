"""Run as a script: write the contents of a C3D file, read by ezc3d, to standard output as a NumPy archive.

ezc3d is C++ that ends Python on some damaged files, or reads for hours; its caller outlives both.
"""

from __future__ import annotations

import io
import sys
from typing import Any

import numpy as np


def contents(file: str) -> dict[str, Any]:
    """Return points, analog channels, their names, units, rates and the number of the first frame."""
    import ezc3d

    found = ezc3d.c3d(file)
    about, header = found["parameters"], found["header"]

    def texts(group: str, name: str) -> Any:
        return np.array(
            [str(text).strip() for text in about[group].get(name, {}).get("value", [])], dtype="U"
        )

    return {
        "points": np.asarray(found["data"]["points"])[:3],
        "analogs": np.asarray(found["data"]["analogs"]),
        "labels": texts("POINT", "LABELS"),
        "units": texts("POINT", "UNITS"),
        "analog_labels": texts("ANALOG", "LABELS"),
        "analog_units": texts("ANALOG", "UNITS"),
        "rate": float(header["points"]["frame_rate"]),
        "analog_rate": float(header["analogs"]["frame_rate"]),
        "first": int(header["points"]["first_frame"]),
    }


if __name__ == "__main__":
    archive = io.BytesIO()
    np.savez(archive, **contents(sys.argv[1]))
    sys.stdout.buffer.write(archive.getvalue())
