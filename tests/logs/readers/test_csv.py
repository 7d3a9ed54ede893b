"""Text tables are read as people write them: separators, decimal commas, comments, units, lines above."""

from pathlib import Path

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs import read_log

#: The same two rows, t = 0.5, 0.6 s, u = 1.5, 1.5 m/s, v = 2, 2 m/s, r = 3, -3 rad/s; and what is said of each.  # noqa: E501
FORMS = {
    "plain": ("time,u,v,r\n0.5,1.5,2,3\n0.6,1.5,2,-3\n", ""),
    "semicolons": ("time;u;v;r\n0.5;1.5;2;3\n0.6;1.5;2;-3\n", "semicolons"),
    "decimal commas": ("time;u;v;r\n0,5;1,5;2;3\n0,6;1,5;2;-3\n", "semicolons between values, decimal commas"),  # noqa: E501
    "quoted decimal commas": ('time,u,v,r\n"0,5","1,5",2,3\n"0,6","1,5",2,-3\n', "decimal commas"),
    "tabs": ("time\tu\tv\tr\n0.5\t1.5\t2\t3\n0.6\t1.5\t2\t-3\n", "tabs"),
    "blanks": (" time   u v  r\n 0.5 1.5  2 3\n 0.6\t1.5 2 -3 \n", "blanks"),
    "blanks, decimal commas": ("time u v r\n0,5 1,5 2 3\n0,6 1,5 2 -3\n", "blanks between values, decimal commas"),  # noqa: E501
    "a commented header": ("# time u v r\n0.5 1.5 2 3\n0.6 1.5 2 -3\n", "blanks"),
    "rostopic": ("%time,u,v,r\n0.5,1.5,2,3\n0.6,1.5,2,-3\n", ""),
    "comments": ("# by a tool, 2, 3, 4\ntime,u,v,r\n0.5,1.5,2,3\n// pause, 1, 2, 3\n0.6,1.5,2,-3\n",
                 "header in line 2, comment lines"),
    "lines above the header": ("Logger 2\nDate;2026-01-31\nRate;50\n\ntime;u;v;r\n0.5;1.5;2;3\n0.6;1.5;2;-3\n",  # noqa: E501
                               "header in line 5"),
    "units": ("time,u,v,r\n[ms],[mm/s],[cm/s],\n500,1500,200,3\n600,1500,200,-3\n", "units below the header"),
    "units without brackets": ("time,u,v,r\nms,mm/s,cm/s,rad/s\n500,1500,200,3\n600,1500,200,-3\n", "units"),
    "a last separator": ("time,u,v,r\n0.5,1.5,2,3,\n0.6,1.5,2,-3,\n", ""),
    "carriage returns": ("time u v r\r\n0.5 1.5 2 3\r\n0.6 1.5 2 -3\r\n", "blanks"),
}  # fmt: skip


def check(file: Path, said: str) -> None:
    log = read_log(file)
    assert log.time.tolist() == [0.5, 0.6]
    assert np.allclose(log.stack("u", "v", "r"), [[1.5, 2.0, 3.0], [1.5, 2.0, -3.0]], rtol=1e-12)
    assert len(log.notes) == (FORMS["plain"][1] != said)
    assert all(said in note for note in log.notes)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be"])
def test_a_dialect_is_recognised(tmp_path: Path, form: str, encoding: str) -> None:
    text, said = FORMS[form]
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    check(tmp_path / "a.csv", "UTF-16" if encoding.startswith("utf-16") else said)


def test_a_comment_in_a_file_that_seems_plain_is_no_row(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    rows = [f"{k},1,2,3" for k in range(20_000)]
    file.write_text("\n".join(["time,u,v,r", *rows[:15_000], "# a pause", *rows[15_000:]]))
    assert len(read_log(file)) == 20_000
    file.write_text(file.read_text() + "\n20000,1,x,3\n")
    with pytest.raises(InputError, match="line 20003, column 'v': expected a number, found 'x'"):
        read_log(file)


def test_a_header_in_another_alphabet_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes("time;x;y;psi\ns;m;m;°\n0;1;2;90\n1;1;2;90\n".encode("cp1252"))
    log = read_log(tmp_path / "a.csv")
    assert log["psi"] == pytest.approx([np.pi / 2] * 2)
    assert "semicolons" in log.notes[0] and "units" in log.notes[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time;u;v;r\n0;1;2;3\n1;oops;2;3\n", "line 3, column 'u': expected a number, found 'oops'"),
        ("a\nb\n\ntime u v r\n0 1 2 3\n# x\n1 2 3\n", "line 7: expected 4 values as in the header, found 3"),
        ("time;u;v;r\ns;m;m/s;rad/s\n0;1;2;3\n1;1;2;3\n",
         "column 'u', read as 'm': expected a unit like 'm/s', found 'm'; another unit: --columns u=u:UNIT"),
        ("0;1;2;3\n1;1;2;3\n", "line 1: expected a header of column names, found '0;1;2;3'"),
    ],
)  # fmt: skip
def test_a_fault_in_a_dialect_is_named_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError) as caught:
        read_log(tmp_path / "a.csv")
    assert said in str(caught.value)


def test_units_in_the_names_of_columns_are_used(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(
        "Zeit [ms];x (mm);psi[°];thrust [N];xyz[1];y [m];y [mm]\r\n"
        "0;1,5;9;2;7;1;1000\r\n20;3;18;3;8;2;2000\r\n".encode()
    )
    for time in ("Zeit", "Zeit [ms]", "Zeit:ms", "Zeit [ms]:ms"):
        log = read_log(tmp_path / "a.csv", {"time": time})
        assert np.allclose(log.time, [0.0, 0.02])
    assert np.allclose(log["x"], [0.0015, 0.003]) and np.allclose(log["psi"], [np.pi / 20, np.pi / 10])
    assert log["thrust"].tolist() == [2.0, 3.0] and log["xyz[1]"].tolist() == [7.0, 8.0]
    assert log["y [m]"].tolist() == [1.0, 2.0] and log["y [mm]"].tolist() == [1000.0, 2000.0]
    assert any("units taken from column names" in note for note in log.notes)
    (tmp_path / "b.csv").write_text("t [\u03bcs],x\n0,1\n100,2\n", encoding="utf-8")  # Greek mu
    assert np.allclose(read_log(tmp_path / "b.csv", {"time": "t"}).time, [0.0, 1e-4])
    assert np.allclose(read_log(tmp_path / "a.csv", {"time": "Zeit", "x": "x:cm"})["x"], [0.015, 0.03])
    with pytest.raises(InputError, match=r"column 'thrust', read as 'N': .*--columns thrust=thrust:UNIT"):
        read_log(tmp_path / "a.csv", {"time": "Zeit"}, {"thrust": "A"})


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["0 sec", "0.01 sec", "0.02 sec"], [0.0, 0.01, 0.02]),  # MATLAB's writetimetable
        (["0 min", "0.5 min", "1 min"], [0.0, 30.0, 60.0]),
        (["0 days 23:59:59.500000", "1 days 00:00:00", "1 days 00:00:00.5"], [0.0, 0.5, 1.0]),  # pandas
        (["00:00:01", "00:00:01.5", "00:00:02"], [0.0, 0.5, 1.0]),
    ],
)
def test_durations_are_read_as_seconds(tmp_path: Path, cells, values) -> None:
    (tmp_path / "a.csv").write_text("\n".join(["time,x", *(f"{cell},1" for cell in cells)]))
    assert read_log(tmp_path / "a.csv").time == pytest.approx(values)


def test_truth_values_and_units_in_cells_are_numbers(tmp_path: Path) -> None:
    rows = ["0,False,12 mm,a", "1,True,15.5 mm,b", "2,True,,c"]
    (tmp_path / "a.csv").write_text("\n".join(["time,on,gap,mode", *rows]))
    log = read_log(tmp_path / "a.csv", {"x": "gap"})
    assert log["on"].tolist() == [0.0, 1.0, 1.0] and "mode" not in log.columns
    assert log["x"] == pytest.approx([0.012, 0.0155, np.nan], nan_ok=True)
    (tmp_path / "a.csv").write_text("\n".join(["time,on,gap", "0,True,12 mm", "1,True,3 cm"]))
    with pytest.raises(InputError, match="line 3, column 'gap': expected a number and 'mm', found '3 cm'"):
        read_log(tmp_path / "a.csv", {"x": "gap"})


def test_columns_of_parquet_may_be_truth_values_and_durations(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow.parquet import write_table

    time = pa.array([0, 10_000_000, 20_000_000], pa.duration("ns"))
    write_table(pa.table({"time": time, "on": [False, None, True]}), tmp_path / "a.parquet")
    log = read_log(tmp_path / "a.parquet", {"on": "on"})
    assert log.time == pytest.approx([0.0, 0.01, 0.02])
    assert log["on"] == pytest.approx([0.0, np.nan, 1.0], nan_ok=True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.5,1\n0.6,2\n", "no header, columns named 1 to 2"),
        ("0,5;1\n0,6;2\n", "semicolons between values, decimal commas, no header, columns named 1 to 2"),
        ("  0.5\t 1\n 6e-1  2\n", "blanks between values, no header, columns named 1 to 2"),
        ("0.5\t1\n\n0.6\t2\n", "tabs between values, no header, columns named 1 to 2"),
        ("% saved by me\n0.5 1\n# then\n0.6 2\n", "no header, columns named 1 to 2, comment lines"),
        ("0.5,1,\n0.6,2,\n", "no header, columns named 1 to 2"),
        ("0.5,1\n0.6,2\n0.7", "an incomplete last line left out"),
    ],
)
def test_columns_without_a_header_are_named_by_number(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    log = read_log(tmp_path / "a.csv", {"time": "1", "x": "2:-mm"})
    assert log.time.tolist() == [0.5, 0.6] and log["x"] == pytest.approx([-0.001, -0.002])
    assert said in log.notes[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.5,1\n0.6,2\n", "no column 'time'; known: 1, 2 (there is no header: --columns time=NUMBER"),
        ("0,1\n0.5,1\n0.6,2\n", "line 1: expected a header of column names, found '0,1'; if that is a row"),
        ("0.5,1\n0.6\n0.7,1\n", "line 2: expected 2 values as in line 1, found 1"),
        ("0.5,1\n0.6,2\n0.7,a\n", "line 3, column '2': expected a number, found 'a'"),
        ("0.5,1\n0.6,2\n0.55,3\n", "line 3, column '1': time runs backwards"),
    ],
)
def test_a_fault_without_a_header_is_named_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    """A first row 0,1 may be a header (pandas writes it) or a row: neither is assumed."""
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError) as caught:
        read_log(tmp_path / "a.csv", {"x": "2", "time": "1"} if "time'" not in said else {})
    assert said in str(caught.value)
