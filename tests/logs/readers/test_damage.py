"""Damaged files of the further formats end in rows up to the break, or in one line."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Tables
from hovercontrol.logs.source import open_log
from tests.logs.readers import test_more_formats as more
from tests.logs.readers import written_ros

#: What writes each file, and its name.
FILES: dict[str, tuple[Callable[[Path], object], str]] = {
    "MAVLink": (lambda p: more.test_mavlink(p, 2), "a.tlog"),
    "ArduPilot text": (more.test_ardupilot_as_text, "a.log"),
    "HDF5": (more.test_hdf5, "a.h5"),
    "TDMS": (lambda p: more.test_tdms(p, "increment"), "a.tdms"),
    "LVM": (more.test_lvm, "a.lvm"),
    "CAN, TRC": (lambda p: more.test_can_frames_are_decoded_by_a_database_beside_them(p, "trc"), "a.trc"),
    "CAN, candump": (lambda p: more.test_can_frames_are_decoded_by_a_database_beside_them(p, "log"), "a.log"),
    "NMEA": (more.test_nmea, "a.nmea"),
    "GPX": (more.test_gpx, "a.gpx"),
    "TRC": (more.test_trc, "a.trc"),
    "MCAP, JSON": (lambda p: more.test_mcap_with_json_and_protobuf(p, "json"), "a.mcap"),
    "MCAP, Protobuf": (lambda p: more.test_mcap_with_json_and_protobuf(p, "protobuf"), "a.mcap"),
    "MCAP, names": (lambda p: written_ros.joints(p / "bag"), "bag/bag.mcap"),
    "MCAP, frames": (lambda p: written_ros.transforms(p / "bag"), "bag/bag.mcap"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_damage_ends_in_rows_or_in_one_line(tmp_path: Path, name: str) -> None:
    write, file = FILES[name]
    write(tmp_path)
    sound, rng = (tmp_path / file).read_bytes(), np.random.default_rng(1)
    for k in range(40):
        damaged, at = bytearray(sound), int(rng.integers(0, len(sound)))
        if k % 4 == 0:
            del damaged[at:]
        elif k % 4 == 1:
            damaged[at : at + 8] = rng.bytes(len(damaged[at : at + 8]))
        elif k % 4 == 2:
            damaged[at] ^= 1 << int(rng.integers(8))
        else:
            damaged[at : at + 4] = b"\xff" * len(damaged[at : at + 4])
        (tmp_path / file).write_bytes(damaged)
        try:
            opened = open_log(tmp_path / file)
            for table in opened.tables if isinstance(opened, Tables) else [opened]:
                numbers = [column for column in table.header if column in table.numeric()]
                assert all(len(batch) <= 10**6 for batch in table.batches(numbers))
        except InputError as error:
            assert "\n" not in str(error) and str(tmp_path) in str(error)
