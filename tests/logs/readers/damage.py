"""Damage log files of every format: ``python -m tests.logs.readers.damage --mutations 2000``.

Each damaged file is read in a process of its own; what is neither rows nor one line is printed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import multiprocessing.connection
import os
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers import apart
from hovercontrol.logs.readers.tables import Tables
from hovercontrol.logs.source import open_log
from tests.logs.readers import test_matlab, written, written_ros
from tests.logs.readers import test_more_formats as more
from tests.logs.readers import test_other_writers as other

#: What writes each file, and its name.
FILES: dict[str, tuple[Callable[[Path], object], str]] = {
    "ROS bag 1": (lambda p: written.ros(p / "a.bag", "ros1"), "a.bag"),
    "ROS bag 2, SQLite": (lambda p: written.ros(p / "bag", "sqlite3"), "bag/bag.db3"),
    "MCAP, CDR": (lambda p: written.ros(p / "bag", "mcap"), "bag/bag.mcap"),
    "MCAP, names": (lambda p: written_ros.joints(p / "bag"), "bag/bag.mcap"),
    "MCAP, frames": (lambda p: written_ros.transforms(p / "bag"), "bag/bag.mcap"),
    "MCAP, JSON": (lambda p: more.test_mcap_with_json_and_protobuf(p, "json"), "a.mcap"),
    "MCAP, Protobuf": (lambda p: more.test_mcap_with_json_and_protobuf(p, "protobuf"), "a.mcap"),
    "PX4 ULog": (lambda p: written.ulog(p / "a.ulg"), "a.ulg"),
    "ArduPilot BIN": (lambda p: written.ardupilot(p / "a.bin"), "a.bin"),
    "ArduPilot text": (more.test_ardupilot_as_text, "a.log"),
    "MAVLink": (lambda p: more.test_mavlink(p, 2), "a.tlog"),
    "MATLAB 5": (lambda p: written.matlab(p / "a.mat"), "a.mat"),
    "MATLAB 7.3": (lambda p: test_matlab.test_a_timetable_is_read_with_its_times(p, "v7.3"), "a.mat"),
    "HDF5": (more.test_hdf5, "a.h5"),
    "MDF 3": (lambda p: written.mdf(p / "a.mdf", "3.30"), "a.mdf"),
    "MDF 4": (lambda p: written.mdf(p / "a.mf4"), "a.mf4"),
    "TDMS": (lambda p: more.test_tdms(p, "increment"), "a.tdms"),
    "LVM": (more.test_lvm, "a.lvm"),
    **{
        f"CAN, {name}": (
            lambda p, name=name: more.test_can_frames_are_decoded_by_a_database_beside_them(p, name),
            f"a.{name}",
        )
        for name in ("blf", "asc", "trc", "log", "mf4")
    },
    "NMEA": (more.test_nmea, "a.nmea"),
    "GPX": (more.test_gpx, "a.gpx"),
    "FIT": (more.test_fit, "plain"),
    "C3D": (more.test_c3d, "a.c3d"),
    "TRC": (more.test_trc, "a.trc"),
    "Qualisys 6D": (other.test_qualisys_exports_are_in_mm_and_degrees, "6d.tsv"),
    "Qualisys 3D": (other.test_qualisys_exports_are_in_mm_and_degrees, "3d.tsv"),
    "Motive": (lambda p: written.motive(p / "a.csv"), "a.csv"),
    "Vicon": (lambda p: written.vicon(p / "a.csv"), "a.csv"),
}  # fmt: skip
LIMIT = 20.0
"""Processor time a damaged file of some kB may take [s]; its process is ended then."""


def damaged(sound: bytes, k: int) -> bytes:
    """Return mutation `k`: cut off, random bytes, a flipped bit, or a count that is too large."""
    rng, mutant = np.random.default_rng(k), bytearray(sound)
    at = int(rng.integers(0, len(sound)))
    if k % 4 == 0:
        del mutant[at:]
    elif k % 4 == 1:
        mutant[at : at + 8] = rng.bytes(len(mutant[at : at + 8]))
    elif k % 4 == 2:
        mutant[at] ^= 1 << int(rng.integers(8))
    else:
        mutant[at : at + 4] = b"\xff" * len(mutant[at : at + 4])
    return bytes(mutant)


def read_all(file: Path) -> str:
    """Return ``rows`` or ``one line``; raise anything else."""
    try:
        opened = open_log(file)
        for table in opened.tables if isinstance(opened, Tables) else [opened]:
            numbers = [column for column in table.header if column in table.numeric()]
            if any(len(batch) > 10**6 for batch in table.batches(numbers)):
                raise MemoryError("more rows than the file has bytes")
    except InputError as error:
        if "\n" in str(error) or str(file.parent) not in str(error):
            raise AssertionError(f"not one line that names the file: {error}") from None
        return "one line"
    return "rows"


@contextmanager
def one_process() -> Iterator[None]:
    """Keep a library's own process from file to file until it ends: its imports take a second."""
    running: dict[str, subprocess.Popen[bytes]] = {}

    def start(command: list[str], **options: object) -> subprocess.Popen[bytes]:
        script = command[-1]
        if script not in running or running[script].stdin.closed or running[script].poll() is not None:
            running[script] = subprocess.Popen(command, **options)
        return running[script]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(apart, "subprocess", SimpleNamespace(**{**vars(subprocess), "Popen": start}))
        patch.setattr(apart, "weakref", SimpleNamespace(finalize=lambda *ended: None))
        try:
            yield
        finally:
            for process in running.values():
                process.kill()
                process.communicate()


def mutate(name: str, folder: Path, which: range) -> Iterator[tuple[int, str]]:
    """Yield each mutation's number and what came of it."""
    write, file = FILES[name]
    write(folder)
    sound = (folder / file).read_bytes()
    assert read_all(folder / file) == "rows"
    for k in which:
        (folder / file).write_bytes(damaged(sound, k))
        try:
            yield k, read_all(folder / file)
        except Exception as fault:
            yield k, f"{type(fault).__name__}: {str(fault)[:200]}"


def _child(name: str, which: range, send: multiprocessing.connection.Connection) -> None:
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory(prefix="hc-damage-") as folder:
        try:
            for found in mutate(name, Path(folder), which):
                send.send(found)
                signal.setitimer(signal.ITIMER_PROF, LIMIT)
        except pytest.skip.Exception as missing:
            send.send((which.stop, f"skipped: {missing}"))
    send.send(None)


def outcomes(name: str, count: int) -> Iterator[tuple[int, str]]:
    """Yield what came of each mutation of a format, also where the process ended or hung."""
    begin = 0
    while begin < count:
        receive, send = multiprocessing.Pipe(duplex=False)
        child = multiprocessing.Process(target=_child, args=(name, range(begin, count), send))
        child.start()
        send.close()
        try:
            while (found := receive.recv()) is not None:
                yield found
                begin = found[0] + 1
            begin = count
        except EOFError:
            child.join()
            took = child.exitcode == -signal.SIGPROF
            yield begin, f"no end in {LIMIT:g} s" if took else f"the process ended with {child.exitcode}"
            begin += 1
        child.join()


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mutations", type=int, default=200, help="of each format (default: 200)")
    parser.add_argument("--only", default="", help="formats whose name has this in it")
    given = parser.parse_args()
    names = [name for name in FILES if given.only.lower() in name.lower()]
    if not names or given.mutations < 1:
        parser.error(f"expected a part of a format's name ({', '.join(FILES)}) and at least one mutation")
    os.environ["PYTHONWARNINGS"] = "ignore"
    broken = 0
    for name in names:
        start, counts = time.monotonic(), Counter[str]()
        for k, what in outcomes(name, given.mutations):
            kind = what if what in ("rows", "one line") else what.split(":")[0] if "skip" in what else "BROKE"
            counts[kind] += 1
            if kind == "BROKE":
                broken += 1
                print(f"  {name}, mutation {k}: {what}", flush=True)
        spent = time.monotonic() - start
        print(
            f"{name:20} {spent:6.1f} s   {', '.join(f'{k}: {n}' for k, n in sorted(counts.items()))}",
            flush=True,
        )
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
