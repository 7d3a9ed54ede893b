"""Units, clocks and names that writers state in their own places: metadata, conventions, headers."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

from hovercontrol.app.commands.options import pairs
from hovercontrol.base.errors import InputError
from hovercontrol.logs import read_log
from hovercontrol.logs.overview import overview
from hovercontrol.logs.required_columns import RequiredColumns
from tests.logs.readers.written_ros import START, Bag

TIME = 0.02 * np.arange(200)
X, Y, PSI = 0.5 * TIME, 0.1 * TIME, 0.4 * TIME - 0.3
NAMES, UNITS = ("time", "x", "y", "psi"), ("s", "mm", "mm", "deg")
COLUMNS = (TIME, 1000 * X, 1000 * Y, np.degrees(PSI))


def right(log, near: float = 1e-6) -> bool:
    """Return whether a log is the motion, also where samples are missing."""
    wanted = {"x": X, "y": Y, "psi": PSI}
    assert log.time - log.time[0] == pytest.approx(TIME[: len(log)], abs=1e-6)
    for name in wanted.keys() & log.columns.keys():
        known = np.isfinite(log[name])
        assert log[name][known] == pytest.approx(wanted[name][: len(log)][known], abs=near), name
    return True


@pytest.mark.parametrize("how", ["pandas", "pyarrow"])
def test_parquet_states_units_in_its_metadata(tmp_path: Path, how: str) -> None:
    table = pa.table(dict(zip(NAMES, COLUMNS, strict=True)))
    if how == "pandas":
        pytest.importorskip("pandas")
        frame = table.to_pandas()
        frame.attrs = {"units": dict(zip(NAMES, UNITS, strict=True)), "run": 7}
        frame.to_parquet(tmp_path / "a.parquet")
    else:
        fields = [pa.field(n, pa.float64(), metadata={"unit": u}) for n, u in zip(NAMES, UNITS, strict=True)]
        pq.write_table(table.cast(pa.schema(fields)), tmp_path / "a.parquet")
    log = read_log(tmp_path / "a.parquet")
    assert right(log) and any("units of the file's metadata" in note for note in log.notes)


def test_netcdf_packs_numbers_and_counts_time_from_a_date(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.nc", "w") as file:
        time = file.create_dataset("time", data=np.round(1e3 * TIME).astype("i8"))
        time.attrs["units"] = "milliseconds since 2026-05-01 10:00:00"
        for name, unit, values in zip(NAMES[1:], ("m", "m", "degrees"), (X, Y, np.degrees(PSI)), strict=True):
            packed = np.round((values - 1.0) / 1e-5).astype("i4")
            packed[7] = -(2**31)
            data = file.create_dataset(name, data=packed)
            data.attrs.update({"units": unit, "scale_factor": 1e-5, "add_offset": 1.0,
                               "_FillValue": np.int32(-(2**31))})  # fmt: skip
    log = read_log(tmp_path / "a.nc", {n: n for n in NAMES[1:]})
    assert right(log, 1e-5) and np.flatnonzero(np.isnan(log["x"])).tolist() == [7]
    assert log.origin == 1_777_629_600 * 10**9


def test_a_table_of_pandas_in_hdf5(tmp_path: Path) -> None:
    """The layout that pandas writes with format="table": a compound with an array of values."""
    h5py = pytest.importorskip("h5py")
    rows = np.zeros(200, dtype=[("index", "i8"), ("values_block_0", "f8", (2,))])
    rows["index"], rows["values_block_0"] = np.round(1e9 * TIME), np.column_stack([X, Y])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["df/table"] = rows
    assert right(
        read_log(
            tmp_path / "a.h5",
            pairs("time=table.index:ns,x=table.values_block_0[0],y=table.values_block_0[1]"),
        )
    )


def text(path: Path, head: str, rows: list[str]) -> Path:
    path.write_text("\n".join([head, *rows]))
    return path


def test_weeks_and_seconds_of_gps_are_one_clock(tmp_path: Path) -> None:
    now = 604_798.0 + TIME  # the week ends after 2 s
    rows = [f"{2416 + int(t >= 604_800)},{t % 604_800:.3f},{x}" for t, x in zip(now, X, strict=True)]
    log = read_log(text(tmp_path / "a.csv", "gps_week,sow,x", rows), {"time": "gps_week+sow"})
    assert right(log) and not log.trials


@pytest.mark.parametrize("noon", [46143.5, 740103.5])
def test_a_serial_date_is_not_seconds(tmp_path: Path, noon: float) -> None:
    rows = [f"{noon + t / 86400:.12f},{x}" for t, x in zip(TIME, X, strict=True)]
    file = text(tmp_path / "a.csv", "t,x", rows)
    with pytest.raises(InputError, match=r"looks like a date in days .*: --columns time=t:day \(in seconds"):
        read_log(file, {"time": "t"})
    log = read_log(file, {"time": "t:day"})
    assert log.time - log.time[0] == pytest.approx(TIME, abs=1e-5)
    assert np.ptp(read_log(file, {"time": "t:s"}).time) < 1e-4


def test_dates_with_dots_are_of_the_day_first(tmp_path: Path) -> None:
    begin = datetime(2026, 5, 1, 23, 59, 58)
    rows = [
        f"{begin + timedelta(seconds=float(t)):%d.%m.%Y %H:%M:%S},{round(1000 * t) % 1000:03d};"
        + f"{1000 * x:.3f}".replace(".", ",")
        for t, x in zip(TIME, X, strict=True)
    ]
    (tmp_path / "a.csv").write_text("\ufeff" + "\r\n".join(["Zeit;x", "-;mm", *rows]), encoding="utf-8")
    log = read_log(tmp_path / "a.csv", {"time": "Zeit"})
    assert right(log) and log.origin == 1_777_679_998 * 10**9


def test_waveforms_of_tdms_begin_at_their_own_times(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    start = np.datetime64("2026-05-01T10:00:00", "us")
    wave = {"wf_increment": 0.02, "wf_start_offset": 0.0, "wf_start_time": start}
    late = {"wf_increment": 0.1, "wf_start_time": start + np.timedelta64(50, "ms")}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as file:
        file.write_segment(
            [
                nptdms.ChannelObject("pose", "x", X, wave),
                nptdms.ChannelObject("cmd", "n", np.arange(40.0), late),
            ]
        )
    log = read_log(tmp_path / "a.tdms", {"x": "x", "n": "n"}, ["n"])
    held = np.floor((X / 0.5 - 0.05) / 0.1 + 1e-6)
    known = np.isfinite(log["x"])
    assert np.array_equal(log["n"][known], held[held >= 0][: known.sum()])


def test_segments_of_lvm_follow_each_other(tmp_path: Path) -> None:
    pytest.importorskip("lvm_read")

    def comma(*values: float) -> str:
        return "\t".join(f"{v:.6f}".replace(".", ",") for v in values)

    lines = [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        "Decimal_Separator\t,", "Multi_Headings\tYes", "X_Columns\tMulti", "Time_Pref\tRelative",
        "***End_of_Header***\t", "\t",
    ]  # fmt: skip
    for k in (0, 100):
        lines += [
            "Channels\t2\t\t\t\t", "Samples\t100\t\t100\t", "Y_Unit_Label\tm\t\trad\t",
            "X_Dimension\tTime\t\tTime\t", f"X0\t{comma(TIME[k])}\t\t{comma(TIME[k])}\t",
            "Delta_X\t0,02\t\t0,02\t", "***End_of_Header***\t\t\t\t\t", "X_Value\tx\tX_Value\tpsi\tComment",
        ]  # fmt: skip
        lines += [comma(TIME[j], X[j], TIME[j], PSI[j]) + "\t" for j in range(k, k + 100)] + [""]
    (tmp_path / "a.lvm").write_text("\n".join(lines))
    log = read_log(tmp_path / "a.lvm", {"x": "x", "psi": "psi"})
    assert len(log) == 200 and right(log)


def test_a_motive_export_without_titles_of_its_rows(tmp_path: Path) -> None:
    head = "Format Version,1.2,Take Name,T,Rotation Type,XYZ,Length Units,Millimeters\n\n"
    for k, row in enumerate(("Rigid Body", "boat", "1", "")):
        cells = ["Rotation"] * 3 + ["Position"] * 3 if k == 3 else [row] * 6
        head += f",,{','.join(cells)}\n"
    rows = [
        f"{k},{t:.6f},0,{np.degrees(p):.6f},0,{1000 * x:.4f},50,{-1000 * y:.4f}"
        for k, (t, x, y, p) in enumerate(zip(TIME, X, Y, PSI, strict=True))
    ]
    file = text(tmp_path / "a.csv", head + "Frame,Time,X,Y,Z,X,Y,Z", rows)
    assert right(read_log(file, pairs("x=boat.x,y=boat.z:-,psi=boat.rx,boat.ry,boat.rz:y-up")))


def test_qualisys_exports_are_in_mm_and_degrees(tmp_path: Path) -> None:
    head = "NO_OF_FRAMES\t200\nFREQUENCY\t50\n" + "TIME_STAMP\t2026-05-01, 10:00:00\n" * 2
    head += "DATA_INCLUDED\t{}\n{}\n"
    turns = Rotation.from_rotvec(np.outer(PSI, [0.0, 0.0, 1.0])).as_matrix()
    bodies, markers = [], []
    for k, (t, x, y, p) in enumerate(zip(TIME, X, Y, PSI, strict=True)):
        place = [1000 * x, 1000 * y, 50.0] if k != 9 else [0.0, 0.0, 0.0]
        body = [*place, 0.0, 0.0, np.degrees(p), 0.3 if k != 9 else -1.0, *turns[k].T.ravel()]
        bodies.append("\t".join(f"{v:.7g}" for v in (k + 1, t, *body)))
        markers.append("\t".join(f"{v:.7g}" for v in (*place, *place)))
    names = "BODY_NAMES\tboat\nBODY_EULER_ANGLES\tRoll\tPitch\tYaw\n"
    names += "Frame\tTime\tboat X\tY\tZ\tRoll\tPitch\tYaw\tResidual" + "".join(
        f"\tRot[{k}]" for k in range(9)
    )
    log = read_log(
        text(tmp_path / "6d.tsv", head.format("6D", names)[:-1], bodies),
        pairs("x=boat.x,y=boat.y,psi=boat.yaw"),
    )
    assert right(log) and np.isnan(log["x"][9]) and np.isnan(log["psi"][9])
    log = read_log(
        text(tmp_path / "3d.tsv", head.format("3D", "MARKER_NAMES\tbow\tstern")[:-1], markers),
        pairs("x=stern.x,y=stern.y"),
    )
    assert right(log) and np.isnan(log["x"][9])


def test_cells_of_matlab_are_numbered(tmp_path: Path) -> None:
    from scipy.io import savemat

    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = {"time": TIME, "x": X}, {"time": TIME, "x": 2 * X}
    savemat(tmp_path / "a.mat", {"logs": cells})
    assert read_log(tmp_path / "a.mat", {"time": "logs(2).time", "x": "logs(2).x"})["x"] == pytest.approx(
        2 * X
    )


@pytest.mark.slow
def test_an_array_of_mdf_is_read_by_its_elements(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    rows = np.zeros(200, dtype=[("pose", "<f8", (3,))])
    rows["pose"] = np.column_stack([X, Y, PSI])
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(TIME, TIME, name="t2"), asammdf.Signal(rows, TIME, name="pose")])
        file.save(tmp_path / "a.mf4", overwrite=True)
    assert right(read_log(tmp_path / "a.mf4", pairs("x=pose[0],y=pose[1],psi=pose[2]")))
    assert "pose[2]" in (overview(tmp_path / "a.mf4", RequiredColumns(motion=True)) or "")


def test_can_frames_timed_from_the_event_before_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("can")
    head = "date Fri May 1 10:00:00.000 am 2026\nbase hex  timestamps relative\ninternal events logged"
    file = text(tmp_path / "a.asc", head, ["   0.020000 1  64             Rx   d 2 10 00"] * 9)
    with pytest.raises(InputError, match="expected absolute timestamps, found those relative"):
        read_log(file)


def test_sentences_of_nmea_after_stamps_and_of_ships_around(tmp_path: Path) -> None:
    pynmea2 = pytest.importorskip("pynmea2")
    lines = []
    for k in range(30):
        given = (
            f"1000{k:02d}.00",
            "A",
            f"54{0.001 * k:010.7f}",
            "N",
            "01000.0000000",
            "E",
            "2.0",
            "0.0",
            "010526",
            "",
            "",
        )
        lines += ["!AIVDM,1,1,,A,13u?etPv2;0n:dDPwUM1U1Cb069D,0*24"]
        lines += [f"[2026-05-01 10:00:{k:02d}] {pynmea2.RMC('GN', 'RMC', given)}"]
    file = text(tmp_path / "boat.log", lines[0], lines[1:])
    log = read_log(file, pairs("x=RMC/lat,RMC/lon:north"))
    assert len(log) == 30 and log["x"][-1] == pytest.approx(0.029 / 60 * 111_298, rel=1e-3)


def test_a_planar_pose_and_its_drive_are_proposed(tmp_path: Path) -> None:
    from rosbags.typesys import get_types_from_msg

    bag = Bag(tmp_path / "a")
    for name, fields in (
        ("geometry_msgs/msg/Pose2D", "x y theta"),
        ("test_msgs/msg/Drive", "steering_angle speed"),
    ):
        own = "\n".join(f"float64 {field}" for field in fields.split())
        bag.store.register({name: get_types_from_msg(own, name)[name]} if name not in bag.store.types else {})
    with bag.writer:
        for k, t in enumerate(TIME):
            ns = START + round(1e9 * t)
            bag.write("/pose", ns, bag.Pose2D(X[k], Y[k], PSI[k]))
            bag.write("/drive", ns, bag.Drive(0.1 * (k // 50), 0.5))
    listed = overview(tmp_path / "a", RequiredColumns(motion=True)) or ""
    assert "--columns 'x=/pose/x,y=/pose/y,psi=/pose/theta,steering_angle=/drive/steering_angle'" in listed


def test_a_heading_without_a_value_is_not_proposed(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in (("time", TIME), ("x", X), ("y", Y), ("heading", np.nan * X), ("yaw", PSI)):
            file[f"run/{name}"] = values
        file["run/x"].attrs["units"] = np.array([b"mm"])  # an array of one text
    listed = overview(tmp_path / "a.h5", RequiredColumns(motion=True)) or ""
    assert "psi=run/yaw" in listed
    assert read_log(tmp_path / "a.h5", {"x": "run/x"})["x"] == pytest.approx(X / 1000)


def test_a_table_of_fixes_with_dates_is_listed(tmp_path: Path) -> None:
    rows = [f"2026-05-01T10:00:{t:06.3f}Z,{54 + 1e-6 * t:.8f},{10 + 1e-6 * t:.8f}" for t in TIME]
    file = text(tmp_path / "a.csv", "utc,latitude,longitude", rows)
    assert "x=latitude,longitude:east" in overview(file, RequiredColumns(motion=True))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"CDF\x01" + bytes(40), "netCDF file of version 3: `nccopy"),
        (b'{"time": 0.0, "x": 1}\n', "JSON: write a CSV"),
    ],
)
def test_a_file_of_another_kind_is_named(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_log(tmp_path / "a.csv")
