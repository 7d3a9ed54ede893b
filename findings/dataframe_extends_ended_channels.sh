#!/bin/sh
# package: asammdf 8.8.28
# guess: `MDF.to_dataframe` of channels with different times is NaN where a channel has no samples, before its first and after its last, as pandas' own join is.
# happens: The first and the last sample are repeated to both ends of the measurement: a sensor that logged from 2 to 4 s has values from 0 to 9 s. `use_interpolation=False` gives NaN there, and between samples, too.
# why: A sensor that stopped looks as if it had measured a constant, and a fit of a model uses it. Read each channel with `get` and its own timestamps, or cut the table at them.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check asammdf==8.8.28 numpy==2.3.5
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version

import numpy as np
from asammdf import MDF, Signal

measured = MDF(version="4.10")
long, short = np.arange(0.0, 10.0, 1.0), np.arange(2.0, 5.0, 1.0)
measured.append([Signal(long, long, name="position", unit="m")])
measured.append([Signal(10.0 + short, short, name="range", unit="m")])
table = measured.to_dataframe()
print(f"asammdf {version('asammdf')}: range was measured from 2 to 4 s")
print(table.to_string())
sys.exit(table["range"].tolist() != [12.0] * 3 + [13.0] + [14.0] * 6)
END
