#!/bin/sh
# package: asammdf 8.8.28 (bus logs of python-can 4.6.1, DBC files read by canmatrix 1.2)
# guess: A speed in a CAN log is read in m/s. A label for one of its values (VAL_ ... 0 "Standstill") adds a name and changes no number.
# happens: The samples with a label are NaN; where every sample has one, the signal is text. `raw=True` gives the counts, without factor and offset.
# why: A vehicle that stands has a speed of "missing" instead of 0. Filters and interpolation bridge the gap as if it had driven on. `to_dataframe(ignore_value2text_conversions=True)` gives 0.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check asammdf==8.8.28 python-can==4.6.1 canmatrix==1.2 numpy==2.3.5
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version
from pathlib import Path

import can
import numpy as np
from asammdf import MDF

DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 100 Motion: 2 ECU
 SG_ Speed : 0|16@1+ (0.01,0) [0|655.35] "m/s" ECU
"""


def speed(label, counts):
    Path("craft.dbc").write_text(DBC + label)
    log = can.Logger("raw.mf4")
    for k, count in enumerate(counts):
        data = count.to_bytes(2, "little")
        log(can.Message(timestamp=1e9 + 0.02 * k, arbitration_id=100, data=data, is_extended_id=False, channel=0))
    log.stop()
    return MDF("raw.mf4").extract_bus_logging({"CAN": [("craft.dbc", 0)]}).get("Speed").samples


label = 'VAL_ 100 Speed 0 "Standstill" ;\n'
plain, labelled, still = speed("", [0, 50, 100, 0]), speed(label, [0, 50, 100, 0]), speed(label, [0, 0, 0, 0])
print(f"asammdf {version('asammdf')}: counts 0, 50, 100, 0 of 0.01 m/s")
print(f"  without a label:          {plain}")
print(f"  0 labelled 'Standstill':  {labelled}")
print(f"  the same, standing still: {still}")
same = np.array_equal(plain, [0.0, 0.5, 1.0, 0.0]) and np.array_equal(labelled, [np.nan, 0.5, 1.0, np.nan], equal_nan=True)
sys.exit(not (same and still.dtype.kind == "S"))
END
