#!/bin/sh
# package: python-can 4.6.1
# guess: An ASC log whose header says `timestamps relative` (each time counts from the event before) is read with times that increase, or is refused.
# happens: The word is parsed and not used: ten frames at 50 Hz are all at 0.02 s. The same frames with `timestamps absolute` are at 0.02, 0.04 and so on.
# why: CANalyzer and CANoe write either, by one option. Rates, delays and plots over time are meaningless for the other, without a warning. Export absolute times, or sum them before decoding.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check python-can==4.6.1
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version
from pathlib import Path

import can

found = {}
for kind in ("absolute", "relative"):
    times = [0.02 * k if kind == "absolute" else 0.02 for k in range(1, 11)]
    lines = ["date Fri May 1 10:00:00.000 am 2026", f"base hex  timestamps {kind}", "internal events logged",
             "Begin Triggerblock Fri May 1 10:00:00.000 am 2026", "   0.000000 Start of measurement"]
    lines += [f"   {t:.6f} 1  64             Rx   d 2 10 00" for t in times] + ["End TriggerBlock", ""]
    Path(f"{kind}.asc").write_text("\n".join(lines))
    found[kind] = [round(message.timestamp, 6) for message in can.ASCReader(f"{kind}.asc")]
print(f"python-can {version('python-can')}: ten frames, one every 20 ms")
for kind, times in found.items():
    print(f"  timestamps {kind}: {times}")
sys.exit(not (found["relative"] == [0.02] * 10 and found["absolute"] == [round(0.02 * k, 6) for k in range(1, 11)]))
END
