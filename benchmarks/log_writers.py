"""Writers of 100 MB of logs for the benchmark `log_formats`, by the formats' own libraries."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np

SIZE = 100_000_000
"""Bytes of each file."""

START = 1_764_300_000 * 10**9


def mavlink(path: Path) -> None:
    from pymavlink.dialects.v20 import ardupilotmega as m

    sender, out = m.MAVLink(io.BytesIO(), srcSystem=1), bytearray()
    k = 0
    while len(out) < SIZE // 20:
        boot = 20 * k
        for message in (
            m.MAVLink_attitude_message(boot, 0.1, 0.1, 0.001 * k, 0.1, 0.1, 0.2),
            m.MAVLink_local_position_ned_message(boot, 0.01 * k, 0.1, 0.1, 0.5, 0.1, 0.1),
        ):
            out += struct.pack(">Q", START // 1000 + 1000 * boot) + message.pack(sender)
        k += 1
    with path.open("wb") as file:
        for _ in range(20):
            file.write(out)


def mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    n = SIZE // 32
    t = 0.005 * np.arange(n)
    with MDF(version="4.10") as file:
        file.append([Signal(np.sin(0.01 * np.arange(n)), t, name=name) for name in ("x", "y", "psi")])
        file.save(path, overwrite=True)


def hdf5(path: Path) -> None:
    import h5py

    n = SIZE // 32
    with h5py.File(path, "w") as file:
        file["time"] = 0.005 * np.arange(n)
        for name in ("x", "y", "psi"):
            file[name] = np.sin(0.01 * np.arange(n))


def tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    n = SIZE // 24
    with TdmsWriter(str(path)) as file:
        about = {"wf_increment": 0.005, "wf_start_offset": 0.0}
        file.write_segment(
            [ChannelObject("run", c, np.sin(0.01 * np.arange(n)), about) for c in ("x", "y", "psi")]
        )


def matlab(path: Path) -> None:
    from scipy.io import savemat

    n = SIZE // 32
    columns = {name: np.sin(0.01 * np.arange(n)) for name in ("x", "y", "psi")}
    savemat(path, {"time": 0.005 * np.arange(n), **columns})


def nmea(path: Path) -> None:
    def line(k: int) -> str:
        s = k % 86_400
        place = f"{s // 3600:02d}{s // 60 % 60:02d}{s % 60:02d}.00,A,5400.{k % 10000:04d},N,01000.0000,E"
        body = f"GPRMC,{place},2.0,45.0,{1 + k // 86_400:02d}0526,,"
        check = 0
        for byte in body.encode():
            check ^= byte
        return f"${body}*{check:02X}\r\n"

    with path.open("w") as file:
        k = 0
        while k % 1000 or file.tell() < SIZE:
            file.write(line(k))
            k += 1


def can_frames(path: Path) -> None:
    import can

    path.with_suffix(".dbc").write_text(
        'VERSION ""\nBU_: E\nBO_ 100 M: 8 E\n SG_ u : 0|16@1+ (0.01,0) [0|0] "m/s" E\n SG_ r : 16|16@1- (0.001,0) [0|0] "rad/s" E\n'  # noqa: E501
    )
    with can.Logger(str(path)) as out:
        for k in range(SIZE // 58):
            data = struct.pack("<Hhi", k % 60_000, k % 3000, 7)
            out(can.Message(START / 1e9 + 0.005 * k, 100, data=data, is_extended_id=False))
