"""A fleet from its logs to its findings: the same from any number of workers, resumed after any death."""

import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

import hovercontrol as hc
from benchmarks.fleet import CART as CARTS
from benchmarks.fleet import start, workers_of
from benchmarks.fleet_logs import fleet as drawn
from benchmarks.fleet_logs import write, write_carts
from hovercontrol.identification.fleet import fleet
from hovercontrol.identification.fleet.worker import Work, estimated
from hovercontrol.logs.reader import Reader

V, K, F = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0), hc.Signal("f", "m/s^2")
CART = hc.Block("cart", [V], [F], [V], [K], {"v": F.symbol - K.symbol * V.symbol})


@pytest.fixture(scope="module")
def carts(tmp_path_factory):
    """Six carts of two logs: one decays twice as fast; one log without a column, one copied from another."""
    folder = tmp_path_factory.mktemp("carts")
    rates = {f"cart{k}": 0.8 + 0.01 * k for k in range(5)} | {"cart5": 1.6}
    write_carts(folder, np.random.default_rng(3), rates, 2)
    (folder / "cart0" / "2026-11-09.csv").write_text("time,v\n0,1\n1,2\n")
    (folder / "cart1" / "2026-11-09.csv").write_bytes((folder / "cart1" / "2026-11-01.csv").read_bytes())
    return folder


@pytest.fixture(scope="module")
def found(carts, tmp_path_factory):
    return fleet(CART, [str(carts)], out=tmp_path_factory.mktemp("out"))


def test_the_cart_that_is_not_as_the_others_is_named_and_no_other(found):
    (k,) = [c for c in found.coefficients if c.name == "k"]
    assert k.off == ("cart5",)
    assert dict(zip(k.craft, k.of.value, strict=True)) == pytest.approx(
        {f"cart{i}": 0.8 + 0.01 * i for i in range(5)} | {"cart5": 1.6}, rel=0.03
    )
    assert "cart5 differs from the others: k 1.5" in found.text()
    assert not replace(k, q_differ=0.0).differs  # many craft always differ a little


def test_a_log_that_cannot_be_used_is_a_row_with_its_reason(found, tmp_path):
    whys = {Path(log).parent.name: why for log, why in found.refused.items()}
    assert "no column 'f'" in whys["cart0"] and whys["cart1"].startswith("the same bytes as ")
    files = {f.name for f in found.save(tmp_path)}
    assert {"fleet.parquet", "craft.parquet", "fleet.json", "report.html", "parameters.toml"} <= files
    rows = pyarrow.parquet.read_table(tmp_path / "fleet.parquet").to_pylist()
    assert sum(r["coefficient"] == "k" for r in rows) == 12
    assert sorted(r["refused"] is not None for r in rows)[-3:] == [False, True, True]
    days = {r["time"].day for r in rows if r["time"]}
    assert days == {1, 2}
    page = (tmp_path / "report.html").read_text()
    assert "1 of 6 craft to look at" in page and "no column &#x27;f&#x27;" in page and "http" not in page


def test_what_is_done_is_not_done_again_and_a_damaged_result_is(carts, tmp_path, monkeypatch):
    from hovercontrol.identification.fleet import run

    asked = []
    real = run.done
    monkeypatch.setattr(run, "done", lambda work: asked.append(work.logs[0]) or real(work))
    names = [str(carts / "cart2"), str(carts / "cart3")]
    first = fleet(CART, names[:1], out=tmp_path)
    assert len(asked) == 2
    both = fleet(CART, names, out=tmp_path)
    assert len(asked) == 4 and {n: both.results[n] for n in first.results} == first.results
    damaged = next((tmp_path / "done").glob("*/*.json"))
    damaged.write_bytes(damaged.read_bytes().replace(b"1", b"2", 1))
    assert fleet(CART, names, out=tmp_path).text() == both.text() and len(asked) == 5


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"logs": []}, "expected logs"),
        ({"by": r"hull(\d)"}, r"none of 2 logs can be used; .*: no craft: --by hull"),
        ({"by": "hull"}, "no column 'hull', by which logs belong to craft; found time, v, f"),
        ({"on": "nowhere://1"}, "cluster 'nowhere://1'"),
        ({"fixed": ["kk"]}, "no coefficient 'kk'; did you mean 'k'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(carts, tmp_path, options, line):
    given = {"logs": [str(carts / "cart2")], "out": tmp_path} | options
    if "on" in options:
        pytest.importorskip("distributed")
    with pytest.raises(hc.InputError, match=line):
        fleet(CART, given.pop("logs"), **given)


def test_the_numbers_of_an_added_effect_are_estimated_and_its_smoothing_is_not():
    """The time constant `tau` of a rate limit is a number of the simulation."""
    limit = hc.effect("thrust_rate_limit", limit=0.15)
    model = hc.vehicle("c17_simulation").with_effects([limit])
    work = Work("identify", ("a.csv",), model, Reader(), added=("thrust_rate_limit",), fixed=("thrust",))
    names = estimated(work)
    assert "thrust_rate_limit_limit" in names and "thrust_rate_limit_tau" not in names
    assert "rudder_torque" in names and "thrust" not in names


# ---- processes ------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the processes of Linux")
def test_killed_workers_and_a_killed_client_lose_nothing_and_change_no_byte(call, tmp_path):
    pytest.importorskip("distributed")
    rates = {f"cart{k}": 0.8 + 0.02 * k for k in range(6)}
    for name in ("one", "two"):
        write_carts(tmp_path / name / "logs", np.random.default_rng(1), rates, 4)
        (tmp_path / name / "cart.py").write_text(CARTS)
    words = ("logs", "--model", "cart.py:CART", "--out", "out", "--workers", "1")
    assert call("fleet", *words, cwd=tmp_path / "one").returncode == 0
    done = tmp_path / "two" / "out" / "done"

    def results():
        return {f.name: f.stat().st_mtime_ns for f in done.glob("*/*.json")}

    two = start(tmp_path / "two", 2)
    while len(results()) < 5:
        time.sleep(0.1)
    os.kill(workers_of(two.pid)[0], signal.SIGKILL)
    while len(results()) < 10:
        time.sleep(0.1)
    two.kill()
    two.wait()
    before = results()
    assert call("fleet", *words, cwd=tmp_path / "two").returncode == 0
    after = results()
    assert len(after) == 24 and before.items() <= after.items()
    for name in ("fleet.parquet", "craft.parquet", "fleet.json", "report.html"):
        assert (tmp_path / "one/out" / name).read_bytes() == (tmp_path / "two/out" / name).read_bytes(), name


# ---- craft ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_all_craft_lack_is_the_models_and_what_one_lacks_is_its_own(tmp_path):
    craft = [c for k, c in enumerate(drawn(10, np.random.default_rng(0))) if k in (0, 1, 2, 3)]
    write(tmp_path / "logs", craft, 2)
    model = hc.load_model(tmp_path / "logs" / "craft.toml")
    found = fleet(model, [str(tmp_path / "logs")], out=tmp_path / "out")
    (lag,) = found.common
    assert lag.name == "rudder_lag" and lag.craft == 4 and lag.taken > 0.7
    assert list(found.faults) == ["craft03"]
    assert [e["name"] for e in found.faults["craft03"]["effects"]] == ["rudder_offset"]
    assert (tmp_path / "out" / "reports" / "craft03.html").is_file()
    (finding,) = [f for f in found.to_json()["findings"] if f.startswith("craft03 lacks")]
    value = float(finding.partition("rudder_offset (")[2].split()[0])
    assert value == pytest.approx(0.03, abs=1e-3)


@pytest.mark.slow
def test_logs_in_a_bucket_are_read_as_those_of_a_folder(carts, tmp_path, monkeypatch):
    s3fs, server = pytest.importorskip("s3fs"), pytest.importorskip("moto.server")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "none")
    s3 = server.ThreadedMotoServer(port=0)
    s3.start()
    url = f"http://127.0.0.1:{s3.get_host_and_port()[1]}"
    monkeypatch.setenv("AWS_ENDPOINT_URL", url)
    s3fs.S3FileSystem(endpoint_url=url).put(str(carts / "cart2"), "fleet/cart2", recursive=True)
    there = fleet(CART, ["s3://fleet/cart2"], out=tmp_path / "there")
    here = fleet(CART, [str(carts / "cart2")], out=tmp_path / "here")
    s3.stop()
    values = [[r["coefficients"] for r in found.results.values()] for found in (there, here)]
    assert values[0] == values[1] and len(values[0]) == 2 and there.craft == ["cart2"]


def test_logs_of_one_folder_are_one_craft_and_their_differences_are_told(tmp_path):
    """Four files of four carts: what differs is told, and how each file is taken as a craft."""
    rates = {f"cart{k}": rate for k, rate in enumerate((0.8, 0.8, 0.8, 1.6))}
    write_carts(tmp_path, np.random.default_rng(3), rates, 1)
    logs = []
    for k, file in enumerate(sorted(tmp_path.glob("cart*/*.csv"))):
        logs.append(str(file.rename(tmp_path / f"cart{k}.csv")))
    together = fleet(CART, logs, out=tmp_path / "out")
    said = together.text()
    assert together.negative and not fleet(CART, logs[:3], out=tmp_path / "alike").negative
    assert f"{tmp_path.name}: k differs between its {len(logs)} logs: 0." in said and " to 1." in said
    assert f"all logs count as one craft, {tmp_path.name}; --by '([^/]+)[.]'" in said
    apart = fleet(CART, logs, by="([^/]+)[.]", out=tmp_path / "apart")
    assert list(apart.craft) == [f"cart{k}" for k in range(len(logs))]
    assert "k differs between craft" in apart.text() and apart.negative
