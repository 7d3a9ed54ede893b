"""Values that the formats' own libraries write are read back, with times, units and frames."""

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest

from hovercontrol.app.commands.options import pairs
from hovercontrol.base.errors import InputError
from hovercontrol.logs import read_log
from hovercontrol.logs.source import format_of

TIME = 0.02 * np.arange(150)
X, PSI = 0.5 * TIME, 0.4 * TIME - 0.3
START = 1_764_300_000


def check(path: Path, kind: str, columns: str, **expected: np.ndarray) -> None:
    plain = path.with_name("without_suffix")
    plain.write_bytes(path.read_bytes())
    for file in (path, plain):  # a file is known by its content
        assert format_of(file).name == kind
        log = read_log(file, pairs(columns))
        assert log.time - log.time[0] == pytest.approx(TIME[: len(log)], abs=2e-6)
        for name, values in expected.items():
            assert log[name] == pytest.approx(values[: len(log)], abs=2e-6, rel=2e-6, nan_ok=True), name


@pytest.mark.parametrize("version", [1, 2])
def test_mavlink(tmp_path: Path, version: int) -> None:
    pytest.importorskip("pymavlink")
    from pymavlink.dialects.v10 import ardupilotmega as v1
    from pymavlink.dialects.v20 import ardupilotmega as v2

    m = v1 if version == 1 else v2
    late = 1000 * np.random.default_rng(0).integers(0, 80, TIME.size)  # delays of the radio
    late[7] = 0
    sender, out = m.MAVLink(io.BytesIO(), srcSystem=1), bytearray()
    for k, t in enumerate(TIME):
        boot = 5000 + round(1000 * t)
        for message in (
            m.MAVLink_attitude_message(boot, 0.0, 0.0, PSI[k], 0.0, 0.0, 0.4),
            m.MAVLink_local_position_ned_message(boot, X[k], 0.0, 0.0, 0.5, 0.0, 0.0),
            m.MAVLink_global_position_int_message(
                boot, 540000000 + k, 100000000, 0, 0, 50, 0, 0, 65535 if k < 9 else 9000
            ),
        ):
            out += struct.pack(">Q", START * 10**6 + 1000 * boot + int(late[k])) + message.pack(sender)
    (tmp_path / "a.tlog").write_bytes(out)
    unknown = np.where(np.arange(150) < 9, np.nan, np.pi / 2)
    columns = "x=LOCAL_POSITION_NED/x,psi=ATTITUDE/yaw,r=ATTITUDE/yawspeed,hdg=GLOBAL_POSITION_INT/hdg"
    check(tmp_path / "a.tlog", "MAVLink telemetry", columns + ",u=LOCAL_POSITION_NED/vx",
          x=X, psi=PSI, r=0.4 + 0 * X, u=0.5 + 0 * X)  # fmt: skip
    log = read_log(tmp_path / "a.tlog", {"hdg": "GLOBAL_POSITION_INT/hdg"})
    assert log["hdg"] == pytest.approx(unknown, nan_ok=True)
    place = read_log(tmp_path / "a.tlog", pairs("x=GLOBAL_POSITION_INT/lat,GLOBAL_POSITION_INT/lon:north"))
    assert place["x"][-1] == pytest.approx(149e-7 * 111_298, rel=1e-3)
    broken = bytearray(out)
    broken[1000:1010] = b"damage...."
    (tmp_path / "a.tlog").write_bytes(broken[:-5])
    log = read_log(tmp_path / "a.tlog", pairs("x=LOCAL_POSITION_NED/x,psi=ATTITUDE/yaw"))
    assert len(log) >= 146 and log["psi"] == pytest.approx(
        0.4 * (log.time - log.time[0]) + log["psi"][0], abs=1e-3
    )


def test_ardupilot_as_text(tmp_path: Path) -> None:
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns", "FMT, 1, 20, ATT, Qcc, TimeUS,Roll,Yaw",
        "FMT, 2, 20, IMU, QBf, TimeUS,I,GyrZ", "FMT, 3, 20, UNIT, QbZ, TimeUS,Id,Label",
        "FMT, 4, 20, FMTU, QBNN, TimeUS,FmtType,UnitIds,MultIds",
        *(f"UNIT, 0, {ord(k)}, {unit}" for k, unit in (("d", "deg"), ("h", "degheading"), ("E", "rad/s"))),
        "FMTU, 0, 1, sdh, F00", "FMTU, 0, 2, s#E, F-0",
    ]  # fmt: skip
    for t, psi in zip(TIME, PSI, strict=True):
        lines.append(f"ATT, {round(1e6 * t)}, 0.0, {np.degrees(psi):.6f}")
        lines += [f"IMU, {round(1e6 * t)}, {k}, {0.4 + k}" for k in (0, 1)]
    (tmp_path / "a.log").write_text("\n".join(lines))
    check(tmp_path / "a.log", "ArduPilot log as text", "psi=ATT/Yaw,r=IMU[1]/GyrZ", psi=PSI, r=1.4 + 0 * X)


def test_hdf5(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/time"], file["run/pos"] = TIME, 1000 * np.column_stack([X, 0 * X, 0 * X])
        file["run/pos"].attrs["units"] = "mm"
        file["run/yaw"] = PSI.astype(">f4")
        file["note"] = "a run"
    check(tmp_path / "a.h5", "HDF5", "x=run/pos[0],psi=yaw", x=X, psi=PSI)


@pytest.mark.parametrize("by", ["increment", "channel"])
def test_tdms(tmp_path: Path, by: str) -> None:
    nptdms = pytest.importorskip("nptdms")
    about = {"wf_increment": 0.02, "wf_start_offset": 3.0} if by == "increment" else {}
    parts = [("x", 1000 * X, "mm"), ("yaw", np.degrees(PSI), "deg")] + [("Time", TIME, "s")] * (not about)
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as file:
        channels = [nptdms.ChannelObject("run", n, v, {**about, "unit_string": u}) for n, v, u in parts]
        file.write_segment(channels)
    check(tmp_path / "a.tdms", "TDMS", "x=x,psi=yaw", x=X, psi=PSI)


def test_lvm(tmp_path: Path) -> None:
    pytest.importorskip("lvm_read")
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
        "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nDate\t2026/05/01\nTime\t10:00:00\n"
        "***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t150\t150\nDate\t2026/05/01\t2026/05/01\n"
        "Time\t10:00:00\t10:00:00\nY_Unit_Label\tm\trad\nX_Dimension\tTime\tTime\nX0\t0.0\t0.0\nDelta_X\t0.02\t0.02\n"
        "***End_of_Header***\t\t\nX_Value\tx\tpsi\tComment\n"
    )
    rows = [f"{t:.6f}\t{x:.6f}\t{p:.6f}" for t, x, p in zip(TIME, X, PSI, strict=True)]
    (tmp_path / "a.lvm").write_text(head + "\n".join(rows) + "\n")
    check(tmp_path / "a.lvm", "LVM", "x=x,psi=psi", x=X, psi=PSI)


DBC = """VERSION ""
BU_: ECU
BO_ 100 Motion: 8 ECU
 SG_ Speed : 0|16@1+ (0.001,0) [0|65] "m/s" ECU
 SG_ Rate : 23|16@0- (0.0001,0) [-3|3] "rad/s" ECU
 SG_ Rudder : 32|12@1- (0.05,0) [-90|90] "deg" ECU
 SG_ Thrust : 44|12@1+ (0.1,0) [0|400] "N" ECU
BO_ 2147483849 Mux: 3 ECU
 SG_ Which M : 0|8@1+ (1,0) [0|1] "" ECU
 SG_ A m0 : 8|16@1+ (1,0) [0|0] "" ECU
 SG_ B m1 : 8|16@1+ (1,0) [0|0] "" ECU
VAL_ 100 Thrust 0 "Off" 4095 "SNA" ;
"""


@pytest.mark.slow("mf4")
@pytest.mark.parametrize("suffix", ["blf", "asc", "trc", "log", "mf4"])
def test_can_frames_are_decoded_by_a_database_beside_them(tmp_path: Path, suffix: str) -> None:
    can, tools = pytest.importorskip("can"), pytest.importorskip("cantools")
    if suffix == "mf4":
        pytest.importorskip("asammdf")
    (tmp_path / "boat.dbc").write_text(DBC)
    base = tools.database.load_string(DBC, "dbc")
    thrust = np.where(TIME < 1.0, 0.0, np.where(TIME < 2.0, 12.3, np.nan))
    speed, rate = np.round(1.0 + X, 3), np.round(np.cos(TIME), 4)
    file = tmp_path / f"a.{suffix}"
    with can.Logger(str(file)) as out:
        for k, t in enumerate(TIME):
            named = {0.0: "Off", 12.3: 12.3}.get(thrust[k], "SNA")
            values = {"Speed": speed[k], "Rate": rate[k], "Rudder": -10.0, "Thrust": named}
            mux = {"Which": k % 2, "AB"[k % 2]: k}
            for name, own in (("Motion", values), ("Mux", mux)):
                message = base.get_message_by_name(name)
                out(can.Message(START + t, message.frame_id, data=message.encode(own),
                                is_extended_id=message.is_extended_frame, channel=0))  # fmt: skip
    log = read_log(file, pairs("u=Motion/Speed,r=Motion/Rate,rudder=Motion/Rudder,thrust=Motion/Thrust"))
    assert log.time - log.time[0] == pytest.approx(TIME, abs=1e-4)
    assert log["u"] == pytest.approx(speed) and log["r"] == pytest.approx(rate)
    assert log["rudder"] == pytest.approx(np.radians(-10.0) + 0 * X)
    assert log["thrust"] == pytest.approx(thrust, nan_ok=True)
    assert any("'SNA' is missing" in note for note in log.notes)
    one = read_log(file, {"a": "Mux/A"})["a"]
    assert one == pytest.approx(np.where(np.arange(150) % 2, np.nan, np.arange(150)), nan_ok=True)


J1939 = """VERSION ""
BU_: ECU
BO_ 2364540158 EEC1: 8 ECU
 SG_ EngineSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" ECU
 SG_ Counter : 56|8@1+ (1,0) [0|255] "" ECU
BO_ 2348810494 Torque: 8 ECU
 SG_ Limit : 16|8@1+ (1,-125) [-125|125] "" ECU
BO_ 2566844928 Own: 8 ECU
 SG_ Raw : 0|8@1+ (1,0) [0|0] "" ECU
"""


@pytest.mark.slow("mf4")
@pytest.mark.parametrize("suffix", ["blf", "mf4"])
def test_messages_of_j1939_are_known_by_their_group(tmp_path: Path, suffix: str) -> None:
    can, tools = pytest.importorskip("can"), pytest.importorskip("cantools")
    if suffix == "mf4":
        pytest.importorskip("asammdf")
    file = tmp_path / f"a.{suffix}"
    (tmp_path / "boat.dbc").write_text(J1939)
    base = tools.database.load_string(J1939, "dbc")
    speed = np.where(np.arange(150) % 10 == 3, 0xFFFF * 0.125, 800.0 + np.round(X))
    with can.Logger(str(file)) as out:
        for k, t in enumerate(TIME):

            def send(name: str, number: int, late: float = 0.0, t: float = t, **values: float) -> None:
                data = base.get_message_by_name(name).encode(values, strict=False, padding=True)
                out(can.Message(START + t + late, number, data=data, is_extended_id=True, channel=0))

            send("EEC1", 0x0CF00400, EngineSpeed=speed[k], Counter=k + 100)
            send("EEC1", 0x08F00403, 0.001, EngineSpeed=600.0, Counter=0)  # another engine and priority
            send("Torque", 0x0C00210B, Limit=k - 100)  # PDU 1: 0x21 is the destination, not the group
            send("Own", 0x18FEF200, Raw=255)  # the id of the database, that of no group
    log = read_log(file, pairs("n=EEC1[0x00]/EngineSpeed,c=EEC1[0x00]/Counter,m=Torque/Limit"))
    lost = np.arange(150) % 10 == 3
    assert np.array_equal(np.isnan(log["n"]), lost)
    assert log["n"][~lost] == pytest.approx((800.0 + np.round(X[~lost])) * 2 * np.pi / 60)
    assert np.array_equal(log["c"], 100.0 + np.arange(150))  # its range is stated as 0 to 255
    assert np.nanmax(log["m"]) == 49.0
    assert any("'not available (J1939)' is missing in 15 rows" in note for note in log.notes)
    assert read_log(file, {"w": "Own/Raw"})["w"].tolist() == [255.0] * 150
    other = read_log(file, {"n": "EEC1[0x03]/EngineSpeed"})
    assert other["n"] == pytest.approx(600.0 * 2 * np.pi / 60 + np.zeros(150))


@pytest.mark.slow("mf4")
@pytest.mark.parametrize("suffix", ["blf", "mf4"])
def test_a_signal_beyond_the_end_of_a_short_frame_is_missing(tmp_path: Path, suffix: str) -> None:
    can = pytest.importorskip("can")
    pytest.importorskip("cantools"), pytest.importorskip("asammdf")
    (tmp_path / "boat.dbc").write_text(DBC)
    with can.Logger(str(tmp_path / f"a.{suffix}")) as out:
        for k, t in enumerate(TIME):
            data = bytes([k, 0, 0, 0, 100, 0, 0, 0])[: 4 if k % 3 else 8]
            out(can.Message(START + t, 100, data=data, is_extended_id=False, channel=0))
    log = read_log(tmp_path / f"a.{suffix}", pairs("u=Motion/Speed,rudder=Motion/Rudder"))
    assert log["u"] == pytest.approx(0.001 * np.arange(150))
    assert np.array_equal(np.isnan(log["rudder"]), np.arange(150) % 3 > 0)


def test_one_of_several_databases_is_not_guessed(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    for name in ("boat.dbc", "other.dbc"):
        (tmp_path / name).write_text(DBC)
    (tmp_path / "a.log").write_text("(1.0) can0 064#0000000000000000\n")
    with pytest.raises(InputError, match=r"database beside the file, a\.dbc, found boat\.dbc, other\.dbc"):
        read_log(tmp_path / "a.log", {"u": "Motion/Speed"})


def test_nmea(tmp_path: Path) -> None:
    pynmea2, pymap3d = pytest.importorskip("pynmea2"), pytest.importorskip("pymap3d")
    lat, lon = 54.0 - 1e-5 * np.arange(90), -10.0 + 2e-5 * np.arange(90)
    lines = []
    for k in range(90):  # over midnight
        clock = f"{23 if k < 30 else 0:02d}{59 if k < 30 else (k - 30) // 60:02d}{(k + 30) % 60:02d}.00"
        day = "300426" if k < 30 else "010526"
        place = (f"54{60 * (lat[k] - 54):010.7f}" if lat[k] >= 54 else f"53{60 * (lat[k] - 53):010.7f}", "N",
                 f"009{60 * (-9 - lon[k]):010.7f}" if lon[k] > -10 else "01000.0000000", "W")  # fmt: skip
        rmc = pynmea2.RMC("GP", "RMC", (clock, "V" if k == 5 else "A", *place, "2.0", "90.0", day, "", ""))
        lines += [str(rmc), str(pynmea2.HDT("HE", "HDT", (f"{300 + k:.1f}", "T")))]
    lines[20] = lines[20][:-2] + "00"  # a wrong checksum
    lines.append("$GPZDA,000100.x,01,05,2026")  # a damaged time, without a checksum
    (tmp_path / "a.nmea").write_text("\r\n".join(lines))
    assert format_of(tmp_path / "a.nmea").name == "NMEA 0183"
    log = read_log(tmp_path / "a.nmea", pairs("x=RMC/lat,RMC/lon:east,y=RMC/lat,RMC/lon:north,u=RMC/speed"))
    east, north, _ = pymap3d.geodetic2enu(lat, lon, 0.0, lat[0], lon[0], 0.0)
    seen = np.delete(np.arange(90), 10)
    assert log.time == pytest.approx(seen)
    known = seen != 5
    assert log["x"][known] == pytest.approx(east[seen][known], abs=2e-3) and np.isnan(log["x"][5])
    assert log["y"][known] == pytest.approx(north[seen][known], abs=2e-3)
    assert log["u"][known] == pytest.approx(2 * 1852 / 3600)
    heading = read_log(tmp_path / "a.nmea", {"psi": "HDT/heading"})["psi"]
    assert heading[:5] == pytest.approx(np.radians(300.0 + np.arange(5)))


def test_gpx(tmp_path: Path) -> None:
    gpxpy = pytest.importorskip("gpxpy")
    from datetime import UTC, datetime, timedelta

    track = gpxpy.gpx.GPX()
    track.tracks.append(gpxpy.gpx.GPXTrack())
    track.tracks[0].segments.append(gpxpy.gpx.GPXTrackSegment())
    begin = datetime(2026, 5, 1, 10, tzinfo=UTC)
    for k, t in enumerate(TIME):
        time = begin + timedelta(seconds=float(t))
        track.tracks[0].segments[0].points.append(
            gpxpy.gpx.GPXTrackPoint(54 + 1e-5 * k, 10.0, 3.0, time=time)
        )
    (tmp_path / "a.gpx").write_text(track.to_xml())
    check(tmp_path / "a.gpx", "GPX", "x=lat,lon:north,y=lat,lon:east", y=0 * X)
    assert read_log(tmp_path / "a.gpx", pairs("x=lat,lon:north"))["x"][-1] == pytest.approx(
        149e-5 * 111_298, rel=1e-3
    )


def test_fit(tmp_path: Path) -> None:
    fit = pytest.importorskip("fit_tool")
    pytest.importorskip("fitdecode")
    from fit_tool.profile.messages.file_id_message import FileIdMessage
    from fit_tool.profile.messages.gps_metadata_message import GpsMetadataMessage
    from fit_tool.profile.messages.record_message import RecordMessage

    def made(message: object, **values: object) -> object:
        for name, value in values.items():
            setattr(message, name, value)
        return message

    out = fit.FitFileBuilder(auto_define=True)
    out.add(made(FileIdMessage(), time_created=1000 * START))
    for k in range(90):
        now = 1000 * (START + k)
        seen = {} if k == 7 else {"position_lat": -54.0 + 1e-5 * k, "position_long": 10.0 - 2e-5 * k}
        out.add(made(RecordMessage(), timestamp=now, enhanced_speed=2.5, temperature=20, **seen))
        at = {"timestamp": now, "timestamp_ms": 250, "heading": 270.0, "velocity": [-2.0, 1.0, 0.0]}
        out.add(made(GpsMetadataMessage(), **at))
    out.build().to_file(str(tmp_path / "a.fit"))
    (tmp_path / "plain").write_bytes((tmp_path / "a.fit").read_bytes())
    assert format_of(tmp_path / "plain").name == "FIT"
    place = ",".join(f"record/position_{axis}" for axis in ("lat", "long"))
    log = read_log(tmp_path / "plain", pairs(f"x={place}:north,y={place}:east,v=record/enhanced_speed"))
    lost = np.arange(90) == 7
    assert log.origin == START * 10**9 and np.array_equal(log.time, np.arange(90.0))
    assert log["v"] == pytest.approx(2.5 + np.zeros(90)) and np.array_equal(np.isnan(log["x"]), lost)
    metres = np.array([1e-5 * 111_286, -2e-5 * 65_566]) * 89  # of a degree at 54 deg south, WGS 84
    assert [log["x"][-1], log["y"][-1]] == pytest.approx(metres, rel=1e-3)
    course = read_log(tmp_path / "a.fit", pairs("c=gps_metadata/course,e=gps_metadata/velocity[0]"))
    assert course.origin == START * 10**9 + 250_000_000
    assert course["c"][5] == pytest.approx(1.5 * np.pi, rel=1e-4) and course["e"][5] == -2.0
    cut = (tmp_path / "a.fit").read_bytes()[:-1000]
    (tmp_path / "a.fit").write_bytes(cut)
    log = read_log(tmp_path / "a.fit", {"v": "record/enhanced_speed"})
    assert 40 < len(log) < 90 and any("up to a break" in note for note in log.notes)


def test_positions_in_other_units_of_latitude_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,lat,lon\n0,540000000,100000000\n1,540000010,100000000\n")
    with pytest.raises(InputError, match=r"column 'lat': expected degrees up to 90, found 5\.4e"):
        read_log(tmp_path / "a.csv", pairs("x=lat,lon:north,y=lat,lon:east"))


def test_c3d(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50]
    file["parameters"]["POINT"]["LABELS"]["value"] = ("bow", "stern")
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["ANALOG"]["RATE"]["value"] = [100]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = ("force",)
    points = np.zeros((3, 2, 150))
    points[0, 0], points[1, 1] = 1000 * X, 1000 * PSI
    points[:, 0, 5] = np.nan
    file["data"]["points"] = points
    file["data"]["analogs"] = np.arange(300.0).reshape(1, 1, 300)
    file.write(str(tmp_path / "a.c3d"))
    lost = np.arange(150) == 5
    check(tmp_path / "a.c3d", "C3D", "x=bow.x,y=stern.y", x=np.where(lost, np.nan, X), y=PSI)
    force = read_log(tmp_path / "a.c3d", {"force": "force"})
    assert np.diff(force.time) == pytest.approx(0.01 + np.zeros(299)) and force["force"][-1] == 299.0


def test_trc(tmp_path: Path) -> None:
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigNumFrames",
        "50\t50\t150\t2\tmm\t50\t150", "Frame#\tTime\tbow\t\t\tstern\t\t", "\t\tX1\tY1\tZ1\tX2\tY2\tZ2", "",
    ]  # fmt: skip
    rows = zip(TIME, X, PSI, strict=True)
    lines += [
        f"{k + 1}\t{t:.4f}\t{1000 * x:.6f}\t0\t0\t\t{1000 * p:.6f}\t0" for k, (t, x, p) in enumerate(rows)
    ]
    (tmp_path / "a.trc").write_text("\n".join(lines))
    check(tmp_path / "a.trc", "TRC (motion capture)", "x=bow.x,y=stern.y", x=X, y=PSI)
    assert np.isnan(read_log(tmp_path / "a.trc", {"x": "bow.x"})["stern.x"]).all()


@pytest.mark.parametrize("encoding", ["json", "protobuf"])
def test_mcap_with_json_and_protobuf(tmp_path: Path, encoding: str) -> None:
    pytest.importorskip("rosbags")
    writer = pytest.importorskip("mcap.writer")
    with (tmp_path / "a.mcap").open("wb") as stream:
        if encoding == "json":
            out = writer.Writer(stream, compression=writer.CompressionType.NONE)
            out.start()
            schema = out.register_schema("Pose", "jsonschema", b"{}")
            channel = out.register_channel("/pose", "json", schema)
            for t, x in zip(TIME, X, strict=True):
                now = START * 10**9 + round(1e9 * t)
                stamp = {"sec": now // 10**9, "nsec": now % 10**9}
                text = json.dumps({"timestamp": stamp, "position": {"x": x, "y": 0}, "q": [0.1, x]}).encode()
                out.add_message(channel, now + 5000, text, now)
            out.finish()
        else:
            protobuf = pytest.importorskip("mcap_protobuf.writer")
            kind = _pose()
            with protobuf.Writer(stream, compression=writer.CompressionType.NONE) as out:
                for t, x in zip(TIME, X, strict=True):
                    now = START * 10**9 + round(1e9 * t)
                    message = kind(q=[0.1, x])
                    message.timestamp.FromNanoseconds(now)
                    message.position.x = x
                    out.write_message("/pose", message, log_time=now + 5000, publish_time=now)
    check(
        tmp_path / "a.mcap",
        "ROS bag, MCAP",
        "x=/pose/position.x,y=/pose/position.y,q=/pose/q[1]",
        x=X,
        y=0 * X,
        q=X,
    )
    assert read_log(tmp_path / "a.mcap", {"x": "/pose/position.x"}).origin == START * 10**9


def _pose() -> type:
    """Return a Protobuf message with a time, a position and a list."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

    file = descriptor_pb2.FileDescriptorProto(name="pose.proto", package="test", syntax="proto3")
    file.dependency.append(timestamp_pb2.DESCRIPTOR.name)
    point = file.message_type.add(name="Point")
    for k, name in enumerate("xy", 1):
        point.field.add(name=name, number=k, type=1, label=1)
    pose = file.message_type.add(name="Pose")
    pose.field.add(name="timestamp", number=1, type=11, label=1, type_name=".google.protobuf.Timestamp")
    pose.field.add(name="position", number=2, type=11, label=1, type_name=".test.Point")
    pose.field.add(name="q", number=3, type=1, label=3)
    pool = descriptor_pool.Default()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("test.Pose"))
