#!/bin/sh
# package: npTDMS 1.13.0
# guess: `as_dataframe(time_index=True)` of two waveforms, of which one began 50 ms after the other (`wf_start_time`), has them 50 ms apart.
# happens: Both begin at 0 and share their rows. The start is used only with `absolute_time=True`; `time_track()` of a channel leaves it out in the same way.
# why: A command and the answer to it, recorded by two tasks of LabVIEW, are shifted against each other by the time between their starts. An identified delay is wrong by as much. Give `absolute_time=True`.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check npTDMS==1.13.0 numpy==2.3.5 pandas==2.3.3
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter

start = np.datetime64("2026-05-01T10:00:00", "us")
with TdmsWriter("run.tdms") as out:
    out.write_segment([
        ChannelObject("run", name, np.arange(4.0), {"wf_increment": 0.1, "wf_start_offset": 0.0, "wf_start_time": start + late})
        for name, late in (("speed", np.timedelta64(0, "ms")), ("command", np.timedelta64(50, "ms")))
    ])
found = TdmsFile.read("run.tdms")
table, absolute = (found.as_dataframe(time_index=True, absolute_time=kind) for kind in (False, True))
print(f"npTDMS {version('npTDMS')}: the command began 50 ms after the speed")
print(table.to_string())
print(absolute.to_string())
sys.exit(not (len(table) == 4 and not table.isna().any(axis=None) and len(absolute) == 8))
END
