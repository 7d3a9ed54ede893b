"""A fleet of simulated craft with known faults: what is found, how often intervals cover, cost of a log.

Statistics on drawn estimates first (seconds), then logs end to end. ``HOVERCONTROL_FLEET=FOLDER:DAYS`` keeps
the logs and results of 40 craft on so many days there, so that a run goes on where another one stopped;
25 days are 1,000 logs and take 7 minutes of two processors. Without it there are 10 craft on 6 days.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import hovercontrol as hc
from benchmarks import real_craft, real_logs
from benchmarks.fleet_logs import CART, DAILY, NOMINAL, Craft, write, write_carts
from benchmarks.fleet_logs import fleet as drawn
from hovercontrol.identification.fleet import Fleet
from hovercontrol.identification.fleet.findings import coefficients
from hovercontrol.identification.fleet.run import _each, executor
from hovercontrol.logs import BenchTable, Condition
from hovercontrol.logs.reader import Reader

Row = tuple[str, str, str, bool | None]
FLEETS, DAY = 40, 86400.0


def estimates(craft: list[Craft], days: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Return drawn results of logs: normal estimates with standard errors of 0.2 to 2 %."""
    found = []
    for one in craft:
        for day in range(days):
            rows = []
            for name, value in one.on(day).items():
                std = NOMINAL[name] * rng.uniform(0.002, 0.02)
                seen = value * (1.0 + DAILY * rng.normal()) + std * rng.normal()
                rows.append({"name": name, "unit": "1", "value": seen, "std": std, "noise_std": std})
            found.append({"craft": one.name, "time": 1.78e9 + DAY * day, "coefficients": rows})
    return found


def off(found: Any) -> set[tuple[str, str]]:
    """Return which coefficients of which craft are said to be off, or to change."""
    return {(craft, c.name) for c in found for craft in (*c.off, *c.trends)}


def covered(found: Any, craft: Mapping[str, Craft], last: float) -> list[bool]:
    """Return for each craft and coefficient whether its interval of 95 % has the value of the last day."""
    inside = []
    for c in found:
        for k, name in enumerate(c.craft):
            truth = {**craft[name].on(last), "rudder_lag_seconds": craft[name].lag}.get(c.name)
            if truth is not None:
                inside.append(bool(abs(c.of.value[k] - truth) < 1.96 * c.of.std[k]))
    return inside


def statistics() -> Iterator[Row]:
    """Yield what is found in drawn estimates of fleets of 40 craft on 25 days."""
    inside: list[bool] = []
    right = wrong = 0
    begin = time.process_time()
    for k in range(FLEETS):
        rng = np.random.default_rng([1, k])
        craft = drawn(40, rng)
        found = coefficients(estimates(craft, 25, rng))
        wanted = {(c.name, c.fault) for c in craft if c.fault in NOMINAL}
        right += len(off(found) & wanted)
        wrong += len(off(found) - wanted)
        inside += covered(found, {c.name: c for c in craft}, 24)
    spent = (time.process_time() - begin) / FLEETS
    what = f"{FLEETS} fleets of 40 craft, 25 logs each, drawn estimates"
    yield f"{what}: faults and drifts found", f"{right} of {2 * FLEETS}", ">= 95 %", right >= 1.9 * FLEETS
    yield "... other coefficients of 200 called off", f"{wrong / FLEETS:.2f} a fleet", "<= 1", wrong <= FLEETS
    cover = float(np.mean(inside))
    yield "... intervals that cover", f"{100 * cover:.1f} %", "93 to 97 %", 0.93 <= cover <= 0.97
    yield "... comparison of 1,000 logs", f"{spent:.2f} s", "", None


def logs() -> Iterator[Row]:
    """Yield what is found in simulated logs."""
    folder, _, days = os.environ.get("HOVERCONTROL_FLEET", "").partition(":")
    if folder:
        yield from _logs(Path(folder), 40, int(days or 25), 2)
        return
    with tempfile.TemporaryDirectory() as made:
        yield from _logs(Path(made), 10, 6, 1)


def _logs(folder: Path, count: int, days: int, processes: int) -> Iterator[Row]:
    craft = drawn(count, np.random.default_rng(7))
    write(folder / "logs", craft, days)
    begin = time.perf_counter()
    found = _fleet(folder, "out", processes)
    wall = time.perf_counter() - begin
    used = len(found.results) - len(found.refused)
    yield f"{count} craft, {len(found.results)} logs of 12 s at 20 Hz: used", str(used), "", None
    lacks = ", ".join(f"{c.name} in {c.craft} craft, takes {100 * c.taken:.0f} %" for c in found.common)
    yield (
        "... the model lacks (truth: rudder_lag)",
        lacks,
        "",
        [c.name for c in found.common] == ["rudder_lag"],
    )
    faults = {(c.name, c.fault) for c in craft if c.fault}
    seen = {(n, e["name"]) for n, f in found.faults.items() for e in f.get("effects", ())} | off(
        found.coefficients
    )
    told = ", ".join(f"{n} {what}" for n, what in sorted(seen & faults))
    yield (
        "... faults and drift found",
        f"{len(seen & faults)} of {len(faults)}: {told}",
        "all",
        faults <= seen,
    )
    others = sorted({n for n, _ in seen} - {n for n, _ in faults})
    yield "... other craft called off", f"{len(others)} {', '.join(others)}", "<= 1", len(others) <= 1
    inside = covered(found.coefficients, {c.name: c for c in craft}, days - 1)
    cover = float(np.mean(inside))
    yield (
        "... intervals that cover",
        f"{100 * cover:.1f} % of {len(inside)}",
        "93 to 97 %",
        0.93 <= cover <= 0.97,
    )
    yield "... processor time a log, all steps", f"{found.seconds / used:.2f} s", "", None
    said = f"{wall:.0f} s, {found.seconds / wall:.2f} of processor time"
    yield f"... on the clock, {processes} processes, if nothing was there before", said, "", None


def workers() -> Iterator[Row]:
    """Yield the time of two processes over one, and whether their files are the same."""
    with tempfile.TemporaryDirectory() as made:
        folder, spent = Path(made), {}
        write(folder / "logs", drawn(6, np.random.default_rng(2)), 4)
        for count in (1, 2):
            begin = time.perf_counter()
            _fleet(folder, f"out{count}", count).save(folder / f"out{count}")
            spent[count] = time.perf_counter() - begin
        ratio = spent[1] / spent[2]
        yield (
            "24 logs, two processes over one, start included",
            f"{ratio:.2f} times",
            ">= 1.8 times",
            ratio >= 1.8,
        )
        names = ("fleet.parquet", "craft.parquet", "fleet.json", "report.html")
        same = all((folder / "out1" / n).read_bytes() == (folder / "out2" / n).read_bytes() for n in names)
        yield "... all files identical", str(same), "True", same
    with executor("", 2) as given:
        list(_each(given, len, {str(k): "" for k in range(100)}))
        begin = time.process_time()
        list(_each(given, len, {str(k): "" for k in range(1000)}))
        spent_ = time.process_time() - begin
        yield "processor time of client and scheduler a task", f"{spent_:.1f} ms", "", None


def real() -> Iterator[Row]:
    """Yield what differs between real craft: six fans in October and in March, four fans in four runs."""
    if not real_craft.DATA.exists():
        yield "real logs", f"not at {real_craft.DATA}", "", None
        return
    with tempfile.TemporaryDirectory() as made:
        for name, folder in (("h1", "october"), ("h1_blue", "march")):
            log = real_craft.holohover(name)
            Path(made, folder).mkdir()
            for begin in (0.0, 20.0, 40.0):
                log.between(begin, begin + 10.0).save(Path(made, folder, f"from_{begin:.0f}_s.csv"))
        found = hc.fleet(real_craft.fan_craft(0.1412), [made], out=Path(made, "out"))
    yield from (("six fans, three pieces of 10 s each", line, "", None) for line in found.text().splitlines())
    read = Reader(
        hc.vehicle("four_fan"),
        bench=BenchTable.from_csv(real_logs.DATA / "thrust_bench.csv", fans=2),
        only_while=Condition.parse("pwm_lift>1000"),
        settle=1.0,
    )
    runs = [f"{real_logs.DATA}/run_{r}_pose.csv+{real_logs.DATA}/run_{r}_command.csv" for r in "abcd"]
    with tempfile.TemporaryDirectory() as made:
        found = hc.fleet(hc.vehicle("four_fan"), runs, by=r"run_(\w)_pose", read=read, out=made)
    yield from (("four fans, each run as a craft", line, "", None) for line in found.text().splitlines())


def kills(times: int = 20) -> Iterator[Row]:
    """Yield what is left after a worker and the client are killed by turns, each with SIGKILL."""
    with tempfile.TemporaryDirectory() as made:
        rates = {f"cart{k:02d}": 0.8 + 0.02 * k for k in range(12)}
        for name in ("whole", "killed"):
            write_carts(Path(made, name, "logs"), np.random.default_rng(1), rates, 25)
        start(Path(made, "whole"), 1).wait()
        folder = Path(made, "killed")
        lost = again = done = 0
        known: dict[str, int] = {}
        client = start(folder, 2)
        while done < times and client.poll() is None:
            before = len(results(folder))
            while len(results(folder)) < before + 6 and client.poll() is None:
                time.sleep(0.05)
            if client.poll() is not None:
                break
            if done % 2:
                client.kill()
                client.wait()
                now = results(folder)
                lost, again = (
                    lost + len(known.keys() - now),
                    again + sum(now.get(n) != t for n, t in known.items()),
                )
                known = now
                client = start(folder, 2)
            else:
                os.kill(workers_of(client.pid)[0], signal.SIGKILL)
            done += 1
        client.wait()
        now = results(folder)
        lost, again = lost + len(known.keys() - now), again + sum(now.get(n) != t for n, t in known.items())
        yield "300 logs, workers and clients killed by turns", f"{done} times", f"{times}", done == times
        yield "... results lost, results written twice", f"{lost}, {again}", "0, 0", not (lost or again)
        files = ("fleet.parquet", "craft.parquet", "fleet.json", "report.html")
        same = all(
            Path(made, "whole/out", n).read_bytes() == (folder / "out" / n).read_bytes() for n in files
        )
        yield "... all files as without a kill", str(same), "True", same


def results(folder: Path) -> dict[str, int]:
    """Return the results that are kept, with the time at which each was written [ns]."""
    return {f.name: f.stat().st_mtime_ns for f in (folder / "out" / "done").glob("*/*.json")}


def start(folder: Path, count: int) -> subprocess.Popen[str]:
    """Start the command on carts, with so many processes."""
    (folder / "cart.py").write_text(CART)
    words = ("logs", "--model", "cart.py:CART", "--out", "out", "--workers", str(count))
    return subprocess.Popen(
        [sys.executable, "-m", "hovercontrol", "fleet", *words],
        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def workers_of(client: int) -> list[int]:
    """Return the worker processes below a client."""
    shown = subprocess.run(
        ["ps", "-eo", "pid=,ppid=,args="], capture_output=True, text=True, check=True
    ).stdout
    rows = [line.split(None, 2) for line in shown.splitlines()]
    below, found = [str(client)], []
    while below:
        own = [(pid, args) for pid, parent, args in rows if parent == below[0]]
        below = [*below[1:], *(pid for pid, _ in own)]
        found += [int(pid) for pid, args in own if "multiprocessing.spawn" in args]
    return found


def _fleet(folder: Path, out: str, count: int) -> Fleet:
    model = hc.load_model(folder / "logs" / "craft.toml")
    return hc.fleet(model, [str(folder / "logs")], out=folder / out, workers=count)


def rows() -> Iterator[Row]:
    yield from statistics()
    yield from workers()
    yield from kills()
    yield from real()
    yield from logs()
