"""Values are read as their writers mean them: labels, invalid samples, Euler angles, clocks, names."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.logs import read_log
from hovercontrol.logs.overview import overview
from hovercontrol.logs.readers import apart
from hovercontrol.logs.required_columns import RequiredColumns
from tests.logs.readers import written_ros

TIME = 0.02 * np.arange(200)


def mdf_of(path: Path, *signals: object) -> Path:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append(list(signals), common_timebase=True)
        file.save(path, overwrite=True)
    return path


def can_signal(name: str, raw: np.ndarray, labels: dict[int, str], scale: float, unit: str = "") -> object:
    """Return a scaled signal with labels, as asammdf writes one that it decoded from CAN."""
    from asammdf import Signal

    conversion: dict[str, object] = {f"val_{k}": v for k, v in enumerate(labels)}
    conversion |= {f"text_{k}": text.encode() for k, text in enumerate(labels.values())}
    own = {"a": scale, "b": 0.0} if scale != 1.0 else b""
    return Signal(
        raw.astype("u2"), TIME, name=name, unit=unit, conversion={**conversion, "default_addr": own}
    )


@pytest.mark.slow("Standstill", "Idle", "verf", "Sensor_Error", "Init")
@pytest.mark.parametrize(
    ("label", "raw", "value"),
    [
        ("Off", 0, 0.0),
        ("Standstill", 0, 0.0),
        ("Idle", 12, 1.2),
        ("SNA", 65535, np.nan),
        ("Signal nicht verfügbar", 500, np.nan),
        ("Sensor_Error", 501, np.nan),
        ("Init", 65534, np.nan),  # the top of the range is no measurement (SAE J1939-71)
    ],
)
def test_a_label_of_a_scaled_signal_is_a_number_or_missing(tmp_path, label, raw, value) -> None:
    pytest.importorskip("asammdf")
    rows = np.where(TIME < 1.0, raw, 50)
    file = mdf_of(tmp_path / "a.mf4", can_signal("u", rows, {raw: label, 65535: "SNA"}, 0.1, "m/s"))
    log = read_log(file, {"u": "u"})
    assert log["u"] == pytest.approx(np.where(TIME < 1.0, value, 5.0), nan_ok=True)
    assert any(repr(label) in note for note in log.notes)


def test_a_signal_that_is_never_available_is_empty(tmp_path) -> None:
    pytest.importorskip("asammdf")
    file = mdf_of(tmp_path / "a.mf4", can_signal("u", 65535 + 0 * TIME, {65535: "SNA"}, 0.01, "m/s"))
    with pytest.raises(InputError, match=r"column 'u' is empty: .*labels of u: 'SNA' is missing in 200 rows"):
        read_log(file, {"u": "u"})


def test_a_list_of_states_keeps_its_raw_values_and_numbers_in_labels(tmp_path) -> None:
    pytest.importorskip("asammdf")
    states = np.arange(200) % 3
    file = mdf_of(tmp_path / "a.mf4", can_signal("gear", states, {0: "N", 1: "FWD", 2: "SNA"}, 1.0),
                  can_signal("u", states, {0: "0", 1: "12.5", 2: "25"}, 1.0))  # fmt: skip
    log = read_log(file, {"gear": "gear", "u": "u"})
    assert log["gear"][:3] == pytest.approx([0.0, 1.0, np.nan], nan_ok=True)
    assert log["u"][:3].tolist() == [0.0, 12.5, 25.0]


def test_samples_with_an_invalidation_bit_are_missing(tmp_path, monkeypatch) -> None:
    asammdf = pytest.importorskip("asammdf")
    ended: list[object] = []
    monkeypatch.setattr(apart, "_end", ended.append)  # the process of a file ends when it has been read
    bad = (TIME > 1.0) & (TIME < 2.0)
    x = asammdf.Signal(np.where(bad, 77.0, TIME), TIME, name="x", unit="m", invalidation_bits=bad)
    log = read_log(mdf_of(tmp_path / "a.mf4", x, asammdf.Signal(TIME, TIME, name="y", unit="m")))
    assert np.array_equal(np.isnan(log["x"]), bad) and np.array_equal(log["y"], TIME)
    (process,) = ended
    process.communicate()


@pytest.mark.slow("way", "count")
@pytest.mark.parametrize(("kind", "name", "unit"), [(2, "crank", "deg"), (3, "way", "m"), (4, "count", "")])
def test_a_master_that_is_no_time_is_no_clock(tmp_path, kind, name, unit) -> None:
    asammdf = pytest.importorskip("asammdf")
    x = asammdf.Signal(TIME, 2.0 * np.arange(200), name="x", unit="m", master_metadata=(name, kind))
    file = mdf_of(tmp_path / "a.mf4", x)
    with pytest.raises(InputError, match=f"no column of time is known .*{name}.*--columns time=NAME"):
        read_log(file)


@pytest.mark.parametrize("order", ["XYZ", "ZYX", "YXZ"])
def test_euler_angles_of_motive_have_the_order_of_the_header(tmp_path, order) -> None:
    yaw, pitch = 1.2 * TIME, 0.2 * np.sin(TIME)
    turned = Rotation.from_euler("YXZ", np.column_stack([yaw, pitch, 0.1 * np.cos(TIME)]))
    angles = turned.as_euler(order, degrees=True)[:, [order.index(axis) for axis in "XYZ"]]
    lines = [
        f"Format Version,1.24,Rotation Type,{order},Length Units,Meters", "", ",Type" + ",Rigid Body" * 6,
        ",Name" + ",Craft" * 6, ",ID" + ",1" * 6, "," + ",Rotation" * 3 + ",Position" * 3,
        "Frame,Time (Seconds),X,Y,Z,X,Y,Z",
    ]  # fmt: skip
    rows = np.column_stack([angles, TIME, 0.1 + 0 * TIME, -TIME])
    lines += [
        f"{k},{t:.6f}," + ",".join(f"{v:.8f}" for v in row)
        for k, (t, row) in enumerate(zip(TIME, rows, strict=True))
    ]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    log = read_log(tmp_path / "a.csv", {"psi": "Craft.rx,Craft.ry,Craft.rz:y-up", "x": "Craft.x"})
    axis = turned.apply([1.0, 0.0, 0.0])  # the bow: its heading on the floor, from x to -z
    assert log["psi"] == pytest.approx(np.unwrap(np.arctan2(-axis[:, 2], axis[:, 0])), abs=1e-6)
    assert not any("tilts" in note for note in log.notes)


@pytest.mark.parametrize("up", [0, 2])
def test_a_quaternion_read_in_a_wrong_order_or_about_a_wrong_axis_is_said(tmp_path, up) -> None:
    angle = 0.9 * TIME
    columns = np.zeros((200, 4))
    columns[:, 0], columns[:, 1 + up] = np.cos(angle / 2), np.sin(angle / 2)
    rows = [f"{t},{','.join(map(str, q))}" for t, q in zip(TIME, columns, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["time,w,i,j,k", *rows]))
    axis = "xyz"[up]
    right = read_log(tmp_path / "a.csv", {"psi": f"i,j,k,w:{axis}-up"})
    assert right["psi"] == pytest.approx(angle, abs=1e-9) and not right.notes
    wrong = read_log(tmp_path / "a.csv", {"psi": f"w,i,j,k:{axis}-up"})
    (note,) = (note for note in wrong.notes if "tilts" in note)
    said = note.partition("--columns psi=")[2]
    assert read_log(tmp_path / "a.csv", {"psi": said})["psi"] == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize(
    ("said", "factor"), [("inDegrees=yes", np.pi / 180), ("inDegrees=no", 1.0), ("", 1.0)]
)
def test_angles_of_opensim_are_in_degrees_where_the_header_says_so(tmp_path, said, factor) -> None:
    rows = [f"{t:.2f}\t{2 * t}\t{30 * t}\t{0.1}" for t in TIME]
    head = ["run", "version=1", *([said] if said else []), "endheader", "time\tx\tpsi\tr"]
    (tmp_path / "a.mot").write_text("\n".join([*head, *rows]))
    log = read_log(tmp_path / "a.mot")
    assert log["psi"] == pytest.approx(30 * TIME * factor) and log["r"] == pytest.approx(0.1 * factor)
    assert log["x"] == pytest.approx(2 * TIME)


def test_elements_of_messages_are_read_by_their_names(tmp_path) -> None:
    file = written_ros.joints(tmp_path / "a")
    log = read_log(
        file, {"x": "/joint_states/position[sail]", "rudder": "/joint_states/position[rudder]"}, ["rudder"]
    )
    assert np.allclose(log["rudder"][np.isfinite(log["x"])], 0.1)
    assert np.allclose(log["x"][np.isfinite(log["x"])], 1.0)
    by_index = read_log(file, {"x": "/joint_states/position[1]"})
    assert np.allclose(by_index["x"], 1.0) and by_index.time[1] == pytest.approx(0.02)
    prop = read_log(file, {"x": "/joint_states/position[prop]"})
    assert np.allclose(prop["x"], 50.0) and len(prop) == 100


def test_transforms_are_a_table_for_each_frame(tmp_path) -> None:
    file = written_ros.transforms(tmp_path / "a")
    craft = read_log(file, {"x": "/tf[base_link]/transform.translation.x"})
    assert craft["x"] == pytest.approx(0.01 * np.arange(100)) and np.allclose(np.diff(craft.time), 0.02)
    frame = read_log(file, {"x": "/tf[odom]/transform.translation.x"})
    assert np.allclose(frame["x"], 10.0)


def test_transforms_are_composed_through_a_frame_that_moves(tmp_path) -> None:
    """The frame odom drifts and turns in map; the craft is on a known path in map."""
    file = written_ros.drifting(tmp_path / "a")
    turn = ",".join(f"/tf[base_link in map]/transform.rotation.{k}" for k in "xyzw")
    at = {k: f"/tf[base_link in map]/transform.translation.{k}" for k in "xy"}
    log = read_log(file, {**at, "psi": turn})
    known = np.isfinite(log["x"])
    assert np.array_equal(known, np.arange(100) <= 90)  # map -> odom ends at 1.8 s
    for name, values in written_ros.drifting_path(0.02 * np.arange(91)).items():
        assert log[name][known] == pytest.approx(values, abs=1e-9), name
    assert any("base_link <- odom <- map" in note for note in log.notes)
    listed = overview(file, RequiredColumns(motion=True))
    assert "--columns 'x=/tf[base_link]/" in listed
    assert "\n/tf[base_link in map] has the same body" in listed
    in_world = read_log(file, {k: f"/tf[base_link in world]/transform.translation.{k}" for k in "xy"})
    assert in_world["x"][known] == pytest.approx(log["x"][known] + 100.0)


@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_a_simulation_of_another_speed_is_read_on_its_own_clock(tmp_path, speed) -> None:
    file = written_ros.simulated(tmp_path / "a", speed)
    log = read_log(file, {"x": "/odom/pose.pose.position.x", "thrust": "/cmd_vel/linear.x"}, ["thrust"])
    moving = np.isfinite(log["x"])
    assert log["x"][moving] == pytest.approx(0.5 * log.time[moving] - 50.0, abs=1e-6)
    steps = log.time[1:][np.diff(log["thrust"]) != 0]
    assert np.diff(steps) == pytest.approx(np.full(steps.size - 1, 0.5), abs=1e-3)
    assert any(f"stamps run at {speed:.3g} of the speed" in note for note in log.notes)


def test_messages_without_a_stamp_and_empty_arrays_do_not_hide_a_topic(tmp_path) -> None:
    file = written_ros.odd(tmp_path / "a")
    log = read_log(file, {"x": "/odom/pose.pose.position.x"})
    assert len(log) == 98 and log["x"] == pytest.approx(0.5 * (log.time + 0.02))
    assert any("2 messages without a stamp left out" in note for note in log.notes)
    array = read_log(file, {"x": "/actuators/data[1]"})
    assert np.isnan(array["x"][0]) and np.allclose(array["x"][1:], 0.2)


@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_an_mcap_file_that_lost_its_end_is_read_to_the_break(tmp_path, compression) -> None:
    file = written_ros.cut(tmp_path, compression)
    log = read_log(file, {"x": "/odom/pose.pose.position.x"})
    assert 500 < len(log) < 700 and log["x"] == pytest.approx(0.5 * log.time)
    assert any("mcap recover" in note for note in log.notes)
    assert len(read_log(file.parent, {"x": "/odom/pose.pose.position.x"})) == len(log)  # no metadata.yaml


def test_an_unknown_element_is_refused_with_the_names_that_there_are(tmp_path) -> None:
    file = written_ros.joints(tmp_path / "a")
    with pytest.raises(ArgumentError, match=r"no column '/joint_states/position\[keel\]'"):
        read_log(file, {"x": "/joint_states/position[keel]"})
