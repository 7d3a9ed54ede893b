"""Where logs are, of which craft they are, and when they were recorded."""

from datetime import UTC, datetime
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from hovercontrol import InputError, Log
from hovercontrol.identification.fleet.sources import By, digest, find, local, recorded

OUT = Path("out")
LOG = Log("a.csv", [0.0, 1.0], {"x": [0.0, 1.0]})


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.mark.parametrize(
    ("name", "when"),
    [
        ("boat/2026-11-28.csv", datetime(2026, 11, 28, tzinfo=UTC)),
        ("boat/run_20261128_1405.csv", datetime(2026, 11, 28, 14, 5, tzinfo=UTC)),
        ("boat/2026-11-28T14-05-30.csv", datetime(2026, 11, 28, 14, 5, 30, tzinfo=UTC)),
        ("2026-11-28/boat3.csv", datetime(2026, 11, 28, tzinfo=UTC)),
    ],
)
def test_a_date_in_the_name_is_that_of_the_log(name, when):
    assert recorded(name, LOG) == (when.timestamp(), "name")


@pytest.mark.parametrize("name", ["boat/run7.csv", "boat/1234567890123.csv", "2026-02-30.csv"])
def test_other_numbers_are_no_dates(name):
    assert recorded(name, LOG) == (None, "")


def test_a_clock_from_1970_is_a_date_and_one_from_its_start_is_not():
    when = 1.7e9
    assert recorded("a.csv", Log("a", [1.0, 2.0], {}, origin=int(when * 1e9))) == (
        pytest.approx(when + 1),
        "clock",
    )
    assert recorded("a.csv", Log("a", [1.0, 2.0], {}, origin=10**9)) == (None, "")


def test_a_craft_is_a_folder_a_match_or_a_column(tmp_path):
    assert By("folder").craft("logs/boat7/a.csv", None) == "boat7"
    assert By(r"boat(\d+)").craft("logs/boat7/a.csv", None) == "7"
    (tmp_path / "a.csv").write_text("time,hull\n0,north\n1,north\n")
    (tmp_path / "b.csv").write_text("time,hull\n0,north\n1,south\n")
    assert By("hull").craft("a.csv", str(tmp_path / "a.csv")) == "north"
    with pytest.raises(InputError, match=r"b\.csv: expected one craft in column 'hull', found 2"):
        By("hull").craft("b.csv", str(tmp_path / "b.csv"))
    with pytest.raises(InputError, match=r"no column 'hul'.*hull"):
        By("hul").craft("a.csv", str(tmp_path / "a.csv"))
    with pytest.raises(InputError, match="not a regular expression"):
        By("boat(")


def test_a_folder_gives_its_logs_but_not_the_results_in_it(tmp_path):
    for name in ("b/2.csv", "a/1.csv", "a/notes.md", ".git/x.csv", "out/fleet.parquet"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    expected = [str(tmp_path / "a/1.csv"), str(tmp_path / "b/2.csv")]
    assert find([str(tmp_path)], tmp_path / "out") == expected
    assert find([f"{tmp_path}/*/*.csv"], tmp_path / "out") == expected
    with pytest.raises(InputError, match=r"no log there: expected files ending in .*\.csv"):
        find([str(tmp_path / ".git" / "none*.csv")], tmp_path)
    with pytest.raises(InputError, match="there is no such file"):
        find([str(tmp_path / "c")], tmp_path)


def test_logs_on_another_file_system_are_found_and_read():
    memory = pytest.importorskip("fsspec").filesystem("memory")
    memory.pipe("/fleet/boat1/2026-11-28.csv", b"time,x\n0,1\n")
    (one,) = find(["memory://fleet"], OUT)
    assert By("folder").craft(one, None) == "boat1" and len(digest(one)) == 64
    with local(one) as path:
        assert Path(path).read_text() == "time,x\n0,1\n"
    with pytest.raises(InputError, match="Protocol not known"):
        find(["nowhere://x"], OUT)


def test_logs_of_a_server_are_found_and_read_and_no_server_is_one_line(tmp_path):
    pytest.importorskip("fsspec")
    pytest.importorskip("aiohttp")
    (tmp_path / "boat1").mkdir()
    (tmp_path / "boat1" / "2026-11-28.csv").write_text("time,x\n0,1\n")
    handler = partial(Quiet, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/"
        (one,) = find([address], OUT)
        assert By("folder").craft(one, None) == "boat1"
        assert digest(one) == digest(str(tmp_path / "boat1" / "2026-11-28.csv"))
        with pytest.raises(InputError, match="no log there"):
            find([f"{address}boat2/"], OUT)
        server.shutdown()
    with pytest.raises(InputError, match=r"http://127\.0\.0\.1:\d+/: cannot be reached"):
        find([address], OUT)
