"""A bad log is refused in one line that names the file, the line or column, and the cause."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import hovercontrol as hc
from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.logs import Log, read_log

GOOD = "time,u,v,r\n0.0,1,2,3\n0.1,1.5,2,3\n0.2,2,2,3\n"

BAD = {
    "no time": ("stamp,u,v,r\n0,1,2,3\n", ["no column 'time'", "--columns time=NAME"]),
    "time nearly": ("tmie,u,v,r\n0,1,2,3\n", ["no column 'time'", "did you mean 'tmie'"]),
    "half a pose": ("time,x,y\n0,1,2\n", ["all of x, y, psi or all of u, v, r", "'psi'"]),
    "no rows": ("time,u,v,r\n", ["no rows"]),
    "no line end": ("time,u,v,r", ["expected samples below the header", "no rows"]),
    "empty": ("", ["the file is empty", "expected a header"]),
    "no header": ("0,1,2,3\n1,1,2,3\n", ["line 1", "expected a header"]),
    "twice": ("time,u,v,r,u\n0,1,2,3,4\n", ["column 'u' appears twice"]),
    "text": (GOOD + "0.3,oops,2,3\n", ["line 5", "column 'u'", "expected a number", "'oops'"]),
    "text at once": ("time,u,v,r\n0,a,2,3\n", ["line 2", "column 'u'", "'a'"]),
    "no time in two rows": (GOOD + ",1,2,3\nnan,1,2,3\n",
                            ["line 5", "column 'time'", "finite", "''", "2 such rows"]),
    "infinite": (GOOD + "0.3,1,2,inf\n", ["line 5", "column 'r'", "'inf'"]),
    "after a blank line": (GOOD + "\n0.3,1,2,inf\n", ["line 6", "column 'r'"]),
    "never a number": ("time,u,v,r\n0,1,nan,3\n1,1,nan,3\n", ["column 'v' is empty: NaN in all 2"]),
    "short line": (GOOD + "0.3,1,2\n", ["line 5", "expected 4 values", "found 3"]),
    "time repeats": (GOOD + "0.2,1,2,3\n0.3,1,2,3\n0.4,1,2,3\n",
                     ["line 5", "column 'time'", "repeats", "more than 0.2, found 0.2", "keep one"]),
    "time in whole seconds": ("time,u,v,r\n" + "".join(f"{i // 5},{i},2,3\n" for i in range(20)),
                              ["line 3", "time repeats", "coarser than the rows", "--columns time=NAME"]),
    "time falls": (GOOD + "0.15,1,2,3\n", ["line 5", "backwards", "more than 0.2, found 0.15"]),
    "degrees": ("time,x,y,psi\n" + "".join(f"{i},0,0,{i * 20 % 360}\n" for i in range(40)),
                ["column 'psi'", "heading in rad", "degrees", "pi/180"]),
    "degrees beside r": ("time,u,v,r,x,y,psi\n"
                         + "".join(f"{i / 50},0,0,1,0,0,{i * 1.146}\n" for i in range(50)),
                         ["column 'psi'", "degrees"]),
}  # fmt: skip


def error_of(path: Path, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        read_log(path, **options)
    text = str(caught.value)
    assert "\n" not in text
    assert str(path) in text
    return text


@pytest.mark.parametrize("case", BAD)
def test_bad_csv_is_named_in_one_line(tmp_path: Path, case: str) -> None:
    content, fragments = BAD[case]
    path = tmp_path / "run.csv"
    path.write_text(content)
    text = error_of(path, motion=True)
    for fragment in fragments:
        assert fragment in text


def test_a_log_needs_the_columns_of_its_model(tmp_path: Path) -> None:
    v, k, throttle = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0), hc.Signal("throttle", "m/s^2")
    cart = hc.Block("cart", [v], [throttle], [v], [k], {"v": throttle.symbol - k.symbol * v.symbol})
    path = tmp_path / "run.csv"
    path.write_text("time,v,throttle\n0,1,2\n1,3,4\n")
    for model in (None, cart, hc.BlockModel(cart)):
        assert sorted(read_log(path, model=model).columns) == ["throttle", "v"]
    assert "no column 'thrust'" in error_of(path, model=hc.vehicle("c17_simulation"))
    found = error_of(path, model=cart.named("cart"), columns={"speed": "v"})
    assert "expected one of the columns v" in found and "no column 'v'" not in found
    kmh = read_log(path, columns={"v": "v:km/h"}, model=cart)
    assert kmh["v"] == pytest.approx([1 / 3.6, 3 / 3.6])
    with pytest.raises(ArgumentError, match="kg"):
        read_log(path, columns={"v": "v:kg"}, model=cart)
    path.write_text("time,v,throttle\n0,1,2\n1,lost,4\n2,1,2\n")
    assert "line 3, column 'v'" in error_of(path, model=cart), "text in an output is not left out silently"


@pytest.mark.slow
def test_text_far_down_a_long_file_is_found(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    lines = ["time,u,v,r"] + [f"{i},0,0,0" for i in range(200_000)]
    lines[150_000] = "149999,0,lost,0"
    path.write_text("\n".join(lines))
    assert "line 150001, column 'v': expected a number, found 'lost'" in error_of(path)


def test_a_file_that_is_not_there_or_not_a_table(tmp_path: Path) -> None:
    assert "there is no such file" in error_of(tmp_path / "none.csv")
    assert "found a folder" in error_of(tmp_path)
    (tmp_path / "x.csv").write_bytes(b"PK\0\0binary")
    assert "not a CSV file" in error_of(tmp_path / "x.csv")
    (tmp_path / "x.parquet").write_text(GOOD)
    assert "not readable as Parquet" in error_of(tmp_path / "x.parquet")


def test_parquet_rows_count_from_one(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    data = {
        "time": [0.0, 1.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        "u": [1, 2, 3, 4, 5, 6, 7],
        "v": [0.0] * 7,
        "r": [0.0] * 7,
    }
    pyarrow.parquet.write_table(pa.table(data), path)
    assert "row 3, column 'time': time repeats" in error_of(path)
    pyarrow.parquet.write_table(pa.table(data | {"u": list("abcdefg")}), path)
    assert "column 'u': expected a number, found string 'a'" in error_of(path)


@pytest.mark.parametrize(
    ("header", "option"),
    [
        ("t_ms;east;north;heading_deg;thrust_A;rudder_deg",
         "time=t_ms:ms,thrust=thrust_A,rudder=rudder_deg:deg,x=NAME,y=NAME,psi=heading_deg:deg"),
        ("Zeit [ms];Pos X [mm];Pos Y [mm];Kurs;Thrust;Ruder [deg]",
         "'time=Zeit,thrust=Thrust,rudder=Ruder,x=Pos X,y=Pos Y,psi=NAME'"),
        ("stamp_s;u;v;r;motor;servo_deg;yaw_deg", "time=stamp_s,thrust=NAME,rudder=NAME"),
    ],
)  # fmt: skip
def test_all_columns_that_lack_are_proposed_at_once(tmp_path: Path, header: str, option: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(
        f"{header}\n" + "".join(f"{k};0;0;0;1;0;0"[: 2 * header.count(";") + 1] + "\n" for k in range(9))
    )
    assert f"--columns {option};" in error_of(path, model=hc.vehicle("c17_experiment"))


def test_names_are_mapped_and_missing_inputs_are_named(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("\ufeffstamp, pose.x ,y,psi,Thrust,mode\n0,1,2,3,4,idle\n1,1,2,3,4,run\n")
    log = read_log(path, {"time": "stamp", "x": "pose.x", "thrust": "Thrust"}, ["thrust"])
    assert log.name == "run.csv"
    assert sorted(log.columns) == ["psi", "thrust", "x", "y"]  # text is left out
    renamed = {"time": "stamp", "x": "pose.x"}
    assert "no column 'thrust'; did you mean 'Thrust'?" in error_of(path, columns=renamed, inputs=["thrust"])
    assert "no column 'pose.z' to read 'x' from; did you mean 'pose.x'?" in error_of(
        path, columns={"x": "pose.z"}
    )
    assert "line 2, column 'mode': expected a number, found 'idle'" in error_of(
        path, columns=renamed, inputs=["mode"]
    )


def test_columns_in_other_units_become_si(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("ms,x,y,yaw:deg,motor,rudder_deg\n0,1000,0,0,5,90\n20,1020,10,1.8,5,-45\n")
    given = {"time": "ms:ms", "x": "x:mm", "y": "y:mm", "psi": "yaw:deg:deg", "rudder": "rudder_deg:deg"}
    log = read_log(path, given | {"thrust": "motor"}, ["thrust", "rudder"])
    assert log.time.tolist() == [0.0, 0.02]
    assert log["x"].tolist() == [1.0, pytest.approx(1.02)]
    assert log["psi"] == pytest.approx([0.0, np.pi / 100])
    assert log["rudder"] == pytest.approx([np.pi / 2, -np.pi / 4])
    assert log["thrust"].tolist() == [5.0, 5.0]


def test_a_name_with_a_colon_is_a_name_where_the_file_has_it(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,imu:x,y,psi\n0,1,0,0\n1,2,0,0\n")
    assert read_log(path, {"x": "imu:x"})["x"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"time": "time:deg"}, "column 'time', read as 'deg': expected a unit like 's', found 'deg'"),
        ({"x": "x:furlogs"}, "column 'x', read as 'furlogs': .*furlogs"),
        ({"x": "x:-s"}, "column 'x', read as '-s': expected a unit like 'm', found 's'"),
        ({"x": "z:mm"}, "no column 'z' to read 'x' from"),
    ],
)
def test_a_unit_that_cannot_be_is_told(tmp_path: Path, given: dict[str, str], said: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,x,y,psi\n0,1,0,0\n1,2,0,0\n")
    with pytest.raises(InputError, match=said):
        read_log(path, given)


def test_commands_come_in_the_unit_of_the_model_and_a_minus_turns_a_sign(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,x,y,psi,motor,servo\n0,1,0,0,1500,10\n1,2,0,0,-500,-20\n")
    columns = {"thrust": "motor:mN", "rudder": "servo:-deg", "y": "y:-"}
    log = read_log(path, columns, {"thrust": "N", "rudder": "rad"})
    assert log["thrust"].tolist() == [1.5, -0.5] and log["y"].tolist() == [0.0, 0.0]
    assert log["rudder"] == pytest.approx(np.radians([-10.0, 20.0]))
    with pytest.raises(
        InputError, match="column 'thrust', read as 'mN': expected a unit like 'A', found 'mN'"
    ):
        read_log(path, columns, {"thrust": "A", "rudder": "rad"})


def test_a_minus_alone_turns_the_sign_of_the_unit_that_the_file_states(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,x [mm],z [mm],yaw [deg]\n0,1000,500,90\n1,2000,-500,90\n")
    log = read_log(path, {"y": "z:-", "psi": "yaw:-"})
    assert log["x"].tolist() == [1.0, 2.0] and log["y"].tolist() == [-0.5, 0.5]
    assert log["psi"] == pytest.approx(-np.pi / 2)


def test_copies_of_the_row_before_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    trial = [f"0.{k},{k},,3" for k in range(1, 10)]
    path.write_text(
        "\n".join([*GOOD.split(), *trial[2:], *trial[-1:], *trial[-1:], "0.95,7,8,9", "0,1,2,3", *trial])
    )
    log = read_log(path)
    assert len(log) == 21 and [part.first for part in log.trials] == [0, 11]
    assert log["u"].tolist() == [1, 1.5, 2, *range(3, 10), 7, 1, *range(1, 10)]
    assert any("2 copies of the row before: left out" in note for note in log.notes)
    path.write_text("time,u,v,r\n0,,2,3\n0,,2,3\n1,4,2,3\n0.5,4,2,3\n")
    assert "line 5, column 'time': time runs backwards" in error_of(path)  # lines are counted in the file


def test_a_unit_in_a_name_that_is_not_the_one_read_is_told(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(
        "t_us,yaw_deg,x_m,r_dps,pos_mm [m],n\n" + "".join(f"{k * 1000},{k},1,2,3,4\n" for k in range(9))
    )
    columns = {"time": "t_us:us", "psi": "yaw_deg", "x": "x_m", "r": "r_dps:deg/s", "y": "pos_mm", "n": "n"}
    hints = [note for note in read_log(path, columns).notes if "is read in" in note]
    assert hints == [f"{path}: column 'yaw_deg' is read in rad; if it is in deg: --columns psi=yaw_deg:deg"]
    assert "--columns time=t_us:us" in read_log(path, {"time": "t_us"}).notes[-1]
    assert not [
        note for note in read_log(path, columns | {"psi": "yaw_deg:deg"}).notes if "is read in" in note
    ]


def test_a_line_that_a_logger_did_not_finish_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes((GOOD + "0.3,1,").replace("\n", "\r\n").encode())
    log = read_log(path)
    assert log.time.tolist() == [0.0, 0.1, 0.2]
    assert any("an incomplete last line left out" in note for note in log.notes)
    path.write_text(GOOD + "0.3,1\n0.4,1,2,3\n0.5,1")
    assert "line 5: expected 4 values as in the header, found 2" in error_of(path)
    path.write_bytes(GOOD.encode() + b"0.3,1,\xd9 \n0.5,1")
    assert "line 5" in error_of(path)


@pytest.mark.parametrize("jump", [-3600.0, 3600.0])
def test_a_clock_set_by_an_hour_does_not_turn_the_heading_into_degrees(tmp_path: Path, jump: float) -> None:
    t = 0.1 * np.arange(400)
    psi = 0.5 * np.sin(t)
    stamps = np.where(t < 20.0, t, t + jump) + 7200.0
    rows = [f"{a:.1f},0,0,{b}" for a, b in zip(stamps, psi, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["time,x,y,psi", *rows]))
    log = read_log(tmp_path / "run.csv")
    assert len(log.trials) == 2 and np.array_equal(log["psi"], psi)


def test_only_the_wanted_columns_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,u,v,r,battery\n0,1,2,3,\n1,1,2,3,7.4\n")
    assert np.isnan(read_log(path)["battery"][0])
    assert sorted(read_log(path, usecols=["u", "v", "r"]).columns) == ["r", "u", "v"]
    path.write_text("time,u,v,r,battery\n0,1,2,3,\n1,1,2,3,\n")
    assert sorted(read_log(path).columns) == ["battery", "r", "u", "v"]  # not needed, so not checked
    assert "column 'battery' is empty: NaN in all 2 rows" in error_of(path, inputs=["battery"])


def test_blank_cells_are_missing_samples(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,x,y,psi,thrust\n0,1,2,3,4\n1,,,,4\n2,1,NaN,3,\n")
    log = read_log(path, inputs=["thrust"])
    assert [log.missing(name) for name in ("x", "y", "psi", "thrust")] == [1, 2, 1, 1]
    assert np.isnan(log["x"]).tolist() == [False, True, False]


def test_heading_that_was_unwrapped_over_many_turns_is_no_degrees(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("time,x,y,psi\n" + "".join(f"{i / 50},0,0,{-i * 0.32}\n" for i in range(1000)))
    assert read_log(path)["psi"][-1] == pytest.approx(-319.68)


@settings(max_examples=10, deadline=None)
@given(
    values=arrays(float, st.integers(1, 20), elements=st.floats(-1e12, 1e12)),
    suffix=st.sampled_from([".csv", ".parquet"]),
)
def test_what_is_saved_is_read_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, values: np.ndarray, suffix: str
) -> None:
    path = tmp_path_factory.mktemp("round") / f"log{suffix}"
    time = 0.1 * np.arange(values.size)
    Log("log", time, {"u": values, "v": -values, "r": 0 * values}).save(path)
    back = read_log(path)
    assert np.array_equal(back.time, time)
    assert np.array_equal(back["u"], values)
    assert np.array_equal(back["v"], -values)


def test_saving_leaves_the_old_file_whole_if_it_fails(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "log.csv"
    path.write_text("precious")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pyarrow.csv, "write_csv", full)
    with pytest.raises(InputError, match=r"log\.csv: cannot be written: No space left"):
        Log("log", np.arange(2.0), {}).save(path)
    assert path.read_text() == "precious"
    assert [file.name for file in tmp_path.iterdir()] == ["log.csv"]
    with pytest.raises(InputError, match="cannot be written"):
        Log("log", np.arange(2.0), {}).save(tmp_path / "nowhere" / "log.csv")


READ_AND_WEIGH = """
import re, resource, sys
from hovercontrol.logs import read_log
log = read_log(sys.argv[1])
try:  # Linux: of this program alone; ru_maxrss begins at what the process that started it had
    peak = int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
except OSError:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(len(log), len(log.columns), peak / 2**20)
"""


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "rows"), [(".parquet", 10_000_000), (".csv", 2_000_000)])
def test_ten_million_rows_stay_below_two_gibibytes(tmp_path: Path, suffix: str, rows: int) -> None:
    path = tmp_path / f"long{suffix}"
    value = pa.array(np.arange(rows) % 1000 / 1000)
    table = pa.table({"time": pa.array(1e-3 * np.arange(rows)), **dict.fromkeys("uvrabcdef", value)})
    if suffix == ".csv":
        pyarrow.csv.write_csv(table, path)
    else:
        pyarrow.parquet.write_table(table, path)
    del table, value
    command = [sys.executable, "-c", READ_AND_WEIGH, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    path.unlink()
    read, columns, gibibytes = done.stdout.split()
    assert (int(read), int(columns)) == (rows, 9)
    # what is kept is 8 bytes a number; the rest must not grow with the file
    assert float(gibibytes) < 2.0 * rows / 1e7 + (0.5 if suffix == ".csv" else 0.0)


def test_more_than_a_gibibyte_of_numbers_is_refused_with_the_estimate(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("hovercontrol.logs.read.LARGEST", 2**20)
    path = tmp_path / "long.csv"
    path.write_text("time,u,v,r\n" + "".join(f"{i},1,2,3\n" for i in range(40_000)))
    text = error_of(path)
    assert "found about" in text
    assert "rows of 4 columns" in text


def test_temperatures_in_degrees_celsius_are_read_in_kelvin(tmp_path):
    (tmp_path / "tank.csv").write_text("time,water [°C],inlet [l/min],room\n0,20.5,6,15\n1,-3,12,15\n")
    log = read_log(tmp_path / "tank.csv", {"room": "room:degC"}, {"inlet": "m^3/s"})
    assert list(log["water"]) == pytest.approx([293.65, 270.15])
    assert list(log["room"]) == pytest.approx([288.15, 288.15])
    assert list(log["inlet"]) == pytest.approx([1e-4, 2e-4])
