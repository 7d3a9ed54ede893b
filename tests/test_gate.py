"""Hostile and clumsy input is one line with status 2, quickly, and leaves nothing behind."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.units import dimension
from hovercontrol.craft.models.modelfile import load_model
from hovercontrol.documents.samples import sample_path
from hovercontrol.logs import Log, read_log

SCENARIO = """[scenario]
step = 0.01
[plant]
vehicle = "c17_simulation"
[reference]
kind = "circle"
radius = 2.0
[controller]
control_point = 0.2
[[phase]]
until = 0.1
"""


@pytest.fixture
def refuses(call, tmp_path):
    """Return a function that runs a command and returns the one line in which it is refused."""

    def run(*words):
        before = sorted(tmp_path.rglob("*"))
        done = call(*words, "--out", "out", cwd=tmp_path)
        assert done.returncode == 2, done.stderr
        assert done.stdout == "" and done.stderr.count("\n") == 1 and len(done.stderr) < 1100, done.stderr[
            :3000
        ]
        assert sorted(tmp_path.rglob("*")) == before
        return done.stderr

    return run


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('yaw_coulomb = {value = 1.0, unit = "1/s*9**9**9"}', "effects.yaw_coulomb: unit must be like"),
        ('yaw_coulomb = {value = 1.0, unit = "("}', "effects.yaw_coulomb: unit must be like"),
        ('yaw_coulomb = {value = 1.0, name = "x"}', "unknown key in effects.yaw_coulomb 'name'"),
        ("yaw_coulomb = {value = 1.0, self = 2.0}", "unknown key in effects.yaw_coulomb 'self'"),
        ("yaw_coulomb = " + "9" * 4000, "must be a number, found a number of 4000 digits"),
        ("yaw_coulomb = " + "9" * 100_000, "not readable as TOML: Exceeds the limit"),
        ("yaw_coulomb = 0x" + "f" * 100_000, "must be a number, found a number of 120412 digits"),
        ("yaw_coulomb = " + "[" * 100_000, "nested too deeply"),
        ("yaw_coulomb = 1e309", "must be a finite number, found inf"),
        ("[fans]\nleft = {x = 0, y = 0, direction = inf}", "fan left: direction must be a finite number"),
        ("[fans]\nleft = {x = 1" + "0" * 400 + ", y = 0, direction = 0}", "fans.left.x must be a number"),
        ('[inputs]\nthrust = {unit = "m^(1/0)"}', "unknown unit"),
    ],
)
def test_a_model_file(refuses, tmp_path, line, said):
    (tmp_path / "m.toml").write_text(f"[effects]\nthrust = 1.0\n{line}\n")
    assert said in refuses("identify", "--sample", "--model", "m.toml")


@pytest.mark.parametrize(
    "unit", ["1/s*9**9**9", "m**-1**-1", "(" * 500, "m^(9^9)", "m" * 200, "9^9", "m^100", "\0"]
)
def test_a_unit_is_written_as_units_are(unit):
    with pytest.raises(InputError, match="unknown unit"):
        dimension(unit)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("step = 0.01", "step = 1e-300", "rows in 0.1 s, expected at most"),
        ("step = 0.01", "step = " + "9" * 4000, "scenario.step must be a number"),
        ("until = 0.1", "until = " + "9" * 400, "until must be a number"),
        ("until = 0.1", "until = 1e300", "rows in 1e+300 s, expected at most"),
        ("radius = 2.0", "radius = " + "9" * 400, "radius: expected a number"),
        ('vehicle = "c17_simulation"', 'model = "a\\u0000b"', "expected a TOML file: embedded null byte"),
        ('vehicle = "c17_simulation"', f'model = "{"x" * 300}"', "File name too long"),
        ("[reference]", "coefficients = {yaw_linear_drag = 1e308}\n[reference]", "s.toml: "),
        ("[reference]", "start = {u = 1e308}\n[reference]", "s.toml: "),
        ("[reference]", "start = {psi = 1e300, r = 1e200}\n[reference]", "s.toml: "),
    ],
)
def test_a_scenario(refuses, tmp_path, old, new, said):
    (tmp_path / "s.toml").write_text(SCENARIO.replace(old, new, 1))
    assert said in refuses("simulate", "s.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x=1:2:99999999999", "--vary x: expected 1000000 points at most, found 1e+11"),
        ("plant.u=-1e308:1e308:5", "expected a range within 1e+100"),
        ("plant.u=1:2:9" + "9" * 5000, "expected KEY=FROM:TO:POINTS"),
        ("plant.u=nan:2:3", "must be a number"),
    ],
)
def test_a_range(refuses, text, said):
    assert said in refuses("sweep", "table1", "--vary", text)


def sample(change):
    rows = [row.split(",") for row in sample_path().read_text().splitlines()[:400]]
    names = [name.strip('"') for name in rows[0]]
    for row in rows[1:]:
        for name, value in change.items():
            row[names.index(name)] = value
    return "\n".join(",".join(row) for row in rows) + "\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (sample({"x": "1e300"}), "line 2, column 'x': expected a number up to 1e+20, found '1e300' (399"),
        (sample({"thrust": "1e308"}), "line 2, column 'thrust': expected a number up to 1e+20"),
        (sample({}) + "x" * 140_000 + ",1\n", "line 401"),
        (sample({}) + '"' + "x\n" * 140_000, "not readable as CSV: field larger than field limit"),
        ('"' + "x" * 140_000, "line 1: not readable as CSV"),
    ],
)
def test_a_log(refuses, tmp_path, text, said):
    (tmp_path / "a.csv").write_text(text)
    assert said in refuses("identify", "a.csv", "--vehicle", "c17_experiment")


@pytest.mark.parametrize(
    "still", [("thrust", "rudder"), ("x", "y", "psi"), ("x", "y", "psi", "thrust", "rudder")]
)
def test_a_log_in_which_nothing_happens_is_a_finding_or_a_line(call, tmp_path, still):
    """Least squares without information once raised LinAlgError."""
    (tmp_path / "a.csv").write_text(sample(dict.fromkeys(still, "0")))
    done = call("identify", "a.csv", "--vehicle", "c17_experiment", "--out", "out", cwd=tmp_path)
    assert done.returncode in (1, 2), done.stderr
    assert "unexpected" not in done.stderr


def test_a_damaged_parquet_file(tmp_path):
    file = tmp_path / "a.parquet"
    log = Log("a", np.arange(5000) / 50, {name: np.arange(5000) / 5e3 for name in ("x", "y", "psi")})
    pyarrow.parquet.write_table(pa.table({"time": log.time, **log.columns}), file)
    sound = file.read_bytes()
    for at in range(4, len(sound) - 8, len(sound) // 40):
        file.write_bytes(sound[:at] + b"\xff" * 8 + sound[at + 8 :])
        try:
            read_log(file)
        except InputError as error:
            assert "\n" not in str(error) and "a.parquet" in str(error)


def test_a_circle_of_links(refuses, tmp_path):
    (tmp_path / "a.csv").symlink_to("b.csv")
    (tmp_path / "b.csv").symlink_to("a.csv")
    assert "Too many levels of symbolic links" in refuses("identify", "a.csv", "--vehicle", "c17_experiment")


def test_a_large_toml_file_is_not_read(tmp_path):
    (tmp_path / "m.toml").write_text("#" * 5_000_000)
    with pytest.raises(InputError, match="4 MiB at most"):
        load_model(tmp_path / "m.toml")
