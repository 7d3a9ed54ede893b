"""The trials: each makes one input from random numbers and returns the status that it ended in."""

from __future__ import annotations

import contextlib
import io
import os
import resource
import signal
import time
import zipfile
from functools import cache
from importlib import resources
from pathlib import Path
from random import Random

import numpy as np
import pandas  # noqa: F401  a time limit that ends its first import within a trial breaks every later one
import pyarrow as pa
import pyarrow.parquet

from hovercontrol.app.commands.options import pairs
from hovercontrol.blocks.units import dimension
from hovercontrol.craft.models.modelfile import load_model, model_text
from hovercontrol.craft.models.vehicles import VEHICLES, vehicle
from hovercontrol.documents.samples import sample_path
from hovercontrol.documents.scenarios import load_scenario, scenario_names
from hovercontrol.logs import read_log
from tests.fuzz import mutate
from tests.fuzz.judge import Broken, call, command, forked
from tests.fuzz.live import live_rows
from tests.logs.readers import written

# ---- logs ----------------------------------------------------------------------------------------------


@cache
def _rows() -> list[str]:
    return sample_path().read_text().splitlines()


def _log(rng: Random, file: Path) -> Path:
    rows = _rows()
    first, count = rng.randrange(1, 1000), rng.choice((0, 1, 3, 30, 200, 200, 500))
    table = [rows[0], *rows[first : first + count]]
    if rng.random() < 0.3 and count:  # a whole column
        columns, kind = rng.sample(range(6), rng.choice((1, 1, 2, 3))), rng.randrange(5)
        cells = [row.split(",") for row in table]
        word, scale = rng.choice(mutate.NUMBERS), 10.0 ** rng.randint(-300, 300)
        for row in cells[1:]:
            for k in columns:
                value = float(row[k])
                row[k] = [word, repr(-value), repr(57.3 * value), "0", repr(value * scale)][kind]
        table = [",".join(row) for row in cells]
    content = mutate.text(rng, "\n".join(table) + "\n") if rng.random() < 0.8 else "\n".join(table) + "\n"
    if rng.random() < 0.02:
        content += '"' + "x" * 200_000
    raw = content.encode(errors="surrogatepass")
    file.write_bytes(mutate.data(rng, raw) if rng.random() < 0.2 else raw)
    return file


def a_log_is_read(rng: Random, folder: Path) -> int:
    file = _log(rng, folder / "a.csv")
    return call(lambda: read_log(file, None, ["thrust", "rudder"]))


@cache
def _parquet() -> bytes:
    columns = {name: np.linspace(0.0, 1.0, 500) for name in ("time", "x", "y", "psi", "thrust", "rudder")}
    out = io.BytesIO()
    pyarrow.parquet.write_table(pa.table(columns), out, compression="snappy", row_group_size=100)
    return out.getvalue()


def a_parquet_log_is_read(rng: Random, folder: Path) -> int:
    (folder / "a.parquet").write_bytes(mutate.data(rng, _parquet()))
    return call(lambda: read_log(folder / "a.parquet", None, ["thrust", "rudder"]))


#: Another format: what writes it, the suffix of a file of it, and --columns. MDF is not tried: damaged files
#: have crashed its library, in machine code, and with it this process.
_FORMATS = {
    "ros1": (lambda path: written.ros(path, "ros1"), "bag", "x=/odom/pose.pose.position.x,r=/cmd/angular.z"),
    "ulog": (
        written.ulog,
        "ulg",
        "x=vehicle_local_position/x,psi=vehicle_attitude/q[0],thrust=actuator_motors/control[0]",
    ),
    "ardupilot": (written.ardupilot, "bin", "x=POS/PN,psi=ATT/Yaw,thrust=RCOU/C1"),
    "matlab": (written.matlab, "mat", "x=pose.pos[0],psi=pose.yaw,thrust=cmd.thrust"),
    "motive": (written.motive, "csv", "x=Craft.x,psi=Craft.qx,Craft.qy,Craft.qz,Craft.qw:y-up"),
    "vicon": (written.vicon, "csv", "x=Craft.x,psi=Craft.rx,Craft.ry,Craft.rz"),
}


@cache
def _sound(kind: str) -> bytes:
    import tempfile

    write, suffix, _ = _FORMATS[kind]
    with tempfile.TemporaryDirectory() as folder:
        return write(Path(folder) / f"a.{suffix}").read_bytes()


def a_log_of_another_format_is_read(rng: Random, folder: Path) -> int:
    kind = rng.choice(list(_FORMATS))
    _, suffix, columns = _FORMATS[kind]
    file = folder / f"a.{suffix if rng.random() < 0.9 else rng.choice(['csv', 'bag', 'ulg', 'mat'])}"
    raw = _sound(kind)
    text = suffix == "csv" and rng.random() < 0.5
    damaged = mutate.text(rng, raw.decode()).encode(errors="replace") if text else mutate.data(rng, raw)
    file.write_bytes(damaged)
    return call(lambda: read_log(file, pairs(columns), motion=False))


def a_dialect_is_read(rng: Random, folder: Path) -> int:
    separator, decimal = rng.choice([",", ";", "\t", " ", "|"]), rng.choice([".", ","])
    lines = [",".join(row.split(",")[:4]) for row in _rows()[:200]]
    lines = [line.replace(",", "\0").replace(".", decimal).replace("\0", separator) for line in lines]
    lines[0] = (
        rng.choice(["", "# a\n", "Run 7\n\n", "% "])
        + lines[0]
        + rng.choice(["", "\n" + separator.join(["s"] * 4)])
    )
    lines = lines[rng.random() < 0.2 :]  # without a header
    period = rng.choice([None, 0.02])
    content = mutate.text(rng, "\n".join(lines)) if rng.random() < 0.7 else "\n".join(lines)
    (folder / "a.csv").write_bytes(
        content.encode(rng.choice(["utf-8", "utf-16", "cp1252"]), errors="replace")
    )
    return call(lambda: read_log(folder / "a.csv", motion=False, period=period))


def a_log_is_identified(rng: Random, folder: Path) -> int:
    _log(rng, folder / "a.csv")
    words, option = ["identify", "a.csv", "--out", "out"], ""
    if rng.random() < 0.3:
        option = rng.choice(
            [
                "--columns",
                "--period",
                "--coefficients",
                "--while",
                "--model",
                "--vehicle",
                "--bench",
                "--settle",
            ]
        )
        words += [option, rng.choice([*mutate.TEXTS[1:], *mutate.NUMBERS]).replace("\0", "")]
    words += [] if option in ("--model", "--vehicle") else ["--vehicle", "c17_experiment"]
    return command(words, folder)


# ---- TOML ----------------------------------------------------------------------------------------------

_MODEL = """[plant]
name = "mine"
[inputs]
thrust = {unit = "A", lower = 0.0, upper = 6.1}
[effects]
surge_coulomb = {value = 1.35, width = 0.02}
yaw_linear_drag = {value = 27.5, unit = "deg/s^2/(rad/s)"}
thrust = 0.83
input_delay = {seconds = 0.08}
[fans]
left = {x = -0.05, y = -0.04, direction = 0.0, gain = 1.1}
front = {x = 0.05, y = 0.0, direction = 3.1, curve = [0.027, 1.05, -0.43]}
rear = {x = -0.05, y = 0.0, direction = 0.0, curve = {signal = [0.0, 0.5, 1.0], force = [0.0, 0.1, 0.4]}}
"""


@cache
def _models() -> list[str]:
    return [_MODEL, *(model_text(vehicle(name)) for name in VEHICLES)]


def _toml(rng: Random, base: str) -> bytes:
    if rng.random() < 0.02:
        return base.encode() + b"\nz = " + b"[" * 100_000
    if rng.random() < 0.02:
        return base.encode() + b"\nz = 0x" + b"f" * 100_000
    words = [
        *mutate.NUMBERS,
        *(f'"{t}"' for t in mutate.TEXTS),
        *mutate.TEXTS,
        '"\\u0000"',
        "[]",
        "{}",
        "[1, 2]",
    ]
    return mutate.text(rng, base, words).encode(errors="replace")


def a_model_file_is_read(rng: Random, folder: Path) -> int:
    (folder / "m.toml").write_bytes(_toml(rng, rng.choice(_models())))
    return call(lambda: load_model(folder / "m.toml").plant())


@cache
def _scenarios() -> list[str]:
    place = resources.files("hovercontrol.documents.scenarios")
    return [(place / f"{name}.toml").read_text() for name in scenario_names()]


def a_scenario_is_read(rng: Random, folder: Path) -> int:
    (folder / "s.toml").write_bytes(_toml(rng, rng.choice(_scenarios())))
    return call(lambda: load_scenario(folder / "s.toml"))


_SHORT = """[scenario]
step = 0.01
[plant]
vehicle = "c17_simulation"
start = {u = 0.1}
coefficients = {thrust = 1.0, yaw_coulomb = 0.2}
[reference]
kind = "circle"
radius = 2.0
[controller]
control_point = 0.2
k1 = 1.0
[[phase]]
until = 0.2
[[metric]]
name = "error"
of = "tracking_error"
from = 0.0
to = 0.1
"""


def a_scenario_is_run(rng: Random, folder: Path) -> int:
    (folder / "s.toml").write_bytes(_toml(rng, _SHORT))
    return command(["simulate", "s.toml", "--out", "out"], folder)


def a_unit_is_read(rng: Random, folder: Path) -> int:
    parts = [
        "m",
        "s",
        "kg",
        "/",
        "*",
        "^",
        "**",
        "2",
        "-1",
        "(",
        ")",
        "1",
        "deg",
        "9",
        " ",
        ".",
        "99",
        "rad",
        "Y",
        "e",
    ]
    return call(lambda: dimension("".join(rng.choice(parts) for _ in range(rng.randrange(1, 14)))))


# ---- archives ------------------------------------------------------------------------------------------


@cache
def _fmu() -> bytes:
    import tempfile

    from hovercontrol.fmi.exporter.export import export_fmu

    with tempfile.TemporaryDirectory() as folder:
        path = export_fmu(vehicle("c17_simulation").plant(), Path(folder) / "a.fmu")
        return Path(path).read_bytes()


def an_archive_is_read(rng: Random, folder: Path) -> int:
    from hovercontrol.fmi.importer.unpacked import open_source

    raw = _fmu()
    if rng.random() < 0.6:  # another model description in a sound archive
        out = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(raw)) as old, zipfile.ZipFile(out, "w") as new:
            for info in old.infolist():
                content = old.read(info)
                if info.filename == "modelDescription.xml":
                    content = mutate.text(rng, content.decode()).encode(errors="replace")
                if rng.random() > 0.01:
                    new.writestr(
                        info.filename if rng.random() > 0.01 else rng.choice(mutate.TEXTS[3:]), content
                    )
        raw = out.getvalue()
    else:
        raw = mutate.data(rng, raw)
    (folder / "a.fmu").write_bytes(raw)
    return call(lambda: open_source(folder / "a.fmu"))


# ---- words of the command line -------------------------------------------------------------------------


def words_are_given(rng: Random, folder: Path) -> int:
    known = [
        ["simulate", "tabel1"],
        ["sweep", "k06-turn", "--vary", "controller.k2=0.5:6:3"],
        ["identify", "--sample"],
        ["diagnose", "a.csv", "--model", "m.toml"],
        ["export", "table1:plant", "-o", "x.fmu"],
        ["analyze", "budget"],
        ["export", "imu", "--step", "1"],
        ["diagnose", "a.csv", "--vehicle", "c17_experiment", "--holdout", "b.csv"],
    ]
    words = list(rng.choice(known))
    words[rng.randrange(1 if len(words) > 1 else 0, len(words))] = rng.choice(
        [
            *mutate.TEXTS,
            *mutate.NUMBERS,
            "x=1:2:99999999999",
            "x=-1e308:1e308:5",
            "x=1:2:3:4",
            "plant.u=nan:1:3",
            "a.py:B",
        ]
    ).replace("\0", "")
    if words[0] not in ("export", "analyze"):
        words += ["--out", "out"]
    if words[:2] == ["identify", "--sample"] or words[0] in ("analyze",):  # seconds of work, tried elsewhere
        words = [words[0], "x", *words[2:]]
    return command(words, folder)


# ---- the cockpit ---------------------------------------------------------------------------------------


def a_message_comes_to_the_cockpit(rng: Random, folder: Path) -> int:
    from tests.fuzz.cockpit import message

    return message(rng, folder)


def a_request_comes_to_the_server(rng: Random, folder: Path) -> int:
    from tests.fuzz.cockpit import request

    return request(rng, folder)


# ---- public functions ----------------------------------------------------------------------------------


def a_function_is_called(rng: Random, folder: Path) -> int:
    from tests.fuzz.calls import some_call

    return call(some_call(rng))


def anything_public_is_called_wrongly(rng: Random, folder: Path) -> int:
    from tests.fuzz.calls import some_wrong_call

    probe = some_wrong_call(rng)
    with contextlib.chdir(folder):
        try:
            return call(probe, AT_WORK)
        except Broken as fault:
            if str(fault).startswith("hangs"):  # right after all, and long: the walk waits for these
                return 0
            raise


AT_WORK = 2.0
"""Seconds after which a call is left alone."""


# ---- faults --------------------------------------------------------------------------------------------


def _work(rng: Random) -> list[str]:
    return rng.choice([["simulate", "sample"], ["sweep", "table1", "--vary", "controller.k1=1:2:2"]])


def a_run_is_interrupted(rng: Random, folder: Path) -> int:
    def fault(child: int) -> None:
        time.sleep(rng.choice((0.0, 0.3, 1.0)) * rng.random())
        os.kill(child, rng.choice((signal.SIGINT, signal.SIGINT, signal.SIGINT)))

    return forked(["simulate", "sample", "--out", "out"], folder, fault, lambda: None)


def the_disk_is_full(rng: Random, folder: Path) -> int:
    def full() -> None:
        hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(10 ** rng.uniform(2.0, 6.0)), hard))

    return forked(["simulate", "sample", "--out", "out"], folder, lambda child: None, full)


def the_reader_leaves(rng: Random, folder: Path) -> int:
    def closed() -> None:
        read, write = os.pipe()
        os.close(read)
        os.dup2(write, 1)

    words = rng.choice([["simulate", "--list"], ["--help"], ["export", "--list"], ["analyze", "--list"]])
    return forked(words, folder, lambda child: None, closed)


#: Each trial and how often it comes: those that take long come seldom.
TRIALS = {
    a_log_is_read: 24,
    a_parquet_log_is_read: 10,
    a_log_of_another_format_is_read: 10,
    a_dialect_is_read: 10,
    a_log_is_identified: 6,
    a_model_file_is_read: 20,
    a_scenario_is_read: 12,
    a_scenario_is_run: 4,
    a_unit_is_read: 10,
    an_archive_is_read: 8,
    words_are_given: 8,
    a_message_comes_to_the_cockpit: 10,
    a_request_comes_to_the_server: 5,
    live_rows: 10,
    a_function_is_called: 20,
    anything_public_is_called_wrongly: 20,
    a_run_is_interrupted: 0.4,
    the_disk_is_full: 0.4,
    the_reader_leaves: 0.4,
}
