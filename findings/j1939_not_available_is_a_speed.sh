#!/bin/sh
# package: cantools 45.1.0
# guess: A message that cantools knows to be of J1939 (`message.protocol` is 'j1939') is found for any source address, and raw values that J1939 reserves ("not available", 0xFF...) are no measurements.
# happens: `decode_message` of the id with a real source address is a KeyError: only the null address of the database is known. All bits set decode to an engine speed of 8191.875 rpm, which `encode_message` refuses as above the signal's maximum.
# why: A controller that has no speed yet says so with 0xFFFF; in the table it is an engine at 8192 rpm. Match by `cantools.j1939.pgn_from_frame_id`, and compare decoded values with `signal.maximum`.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check cantools==45.1.0
cd "$folder"
venv/bin/python - <<'END'
import sys
from importlib.metadata import version

import cantools

DBC = """VERSION ""
BU_: ECU
BO_ 2364540158 EEC1: 8 ECU
 SG_ EngineSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" ECU
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
"""
base = cantools.database.load_string(DBC, "dbc")
(message,) = base.messages
print(f"cantools {version('cantools')}: {message.name}, protocol {message.protocol}, maximum {message.signals[0].maximum} rpm")
value = message.decode(bytes([0xFF] * 8))["EngineSpeed"]
print(f"  all bits set (not available): {value} rpm")
try:
    base.decode_message(0x0CF00400, bytes(8))  # from address 0; the database has 0xFE
    found = True
except KeyError as error:
    found = False
    print(f"  the same group from source address 0: KeyError {error}")
try:
    base.encode_message("EEC1", {"EngineSpeed": value})
    refused = False
except cantools.database.errors.EncodeError as error:
    refused = True
    print(f"  encoded again: {error}")
sys.exit(not (message.protocol == "j1939" and value == 8191.875 and not found and refused))
END
