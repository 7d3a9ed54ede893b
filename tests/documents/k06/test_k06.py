"""K06 is complete: every numbered item has its place in the code or a reason; its items measure."""

import numpy as np
import pytest

from hovercontrol.documents import Outcome, all_items, numbered_items, places
from hovercontrol.documents.index import index_content
from hovercontrol.documents.k06 import gyro, hardware, trials

NUMBERED = numbered_items("k06")
BY_NAME = {item.name: item for item in all_items("k06")}


def test_each_numbered_item_has_a_place_or_a_reason_and_not_both():
    found = places()
    assert [n.key for n in NUMBERED if n.key not in found and not n.without_code] == []
    assert [n.key for n in NUMBERED if n.key in found and n.without_code] == []


def test_every_table_is_rebuilt_and_every_figure_unless_it_has_a_reason_or_is_the_code_itself():
    rebuilt = {(i.document, i.kind, i.number) for i in all_items("k06")}
    missing = [n for n in NUMBERED if n.kind in ("table", "fig") and n.key not in rebuilt]
    assert all(n.kind == "fig" for n in missing)
    diagrams = {"2.1", "3.2", "5.1", "5.6", "6.1", "6.2", "6.3", "6.4", "6.5", "6.6", "B.1"}
    assert {n.number for n in missing if not n.without_code} == diagrams
    code = index_content([Outcome(BY_NAME["table 4.1"], failure="not run")])["code"]
    assert {e["item"].split()[1] for e in code if e["places"] and not e["drawn"]} == diagrams


def test_the_nearest_of_the_seeds_is_inside_a_range_if_any_is():
    values = np.array([0.1, 0.45, 0.9])
    assert trials.nearest(values, 0.4, 0.5) == 0.45
    assert trials.nearest(values, 0.55, 0.6) == 0.45
    assert trials.nearest(values, 0.2, 0.3) == 0.1


def test_every_end_of_an_axis_in_the_table_is_read_by_loop_signal_and_end():
    told = [
        p for n in NUMBERED for p in n.printed if p.text.startswith("the axis ends at") and "tick" in p.text
    ]
    read = [end for n in NUMBERED if n.kind == "fig" for end in trials.ends(n.number)]
    assert [axis for axis, *_ in read] == told and len(told) == 42
    assert {signal for _, _, signal, _ in read} == set(trials.UNIT)
    assert all(axis.low < axis.high and axis.unit == trials.UNIT[signal] for axis, _, signal, _ in read)


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("table 4.1", "differs"),  # the erratum of the mass
        ("table 4.2", "agrees"),
        ("table 5.1", "agrees"),
        ("table 5.2", "agrees"),
        ("table 6.1", "agrees"),
        ("table 6.5", "agrees"),
        ("fig 4.3", "agrees"),
        ("fig 5.7", "agrees"),
        ("fig 6.16", "agrees"),
    ],
)
def test_quick_items_are_rebuilt(tmp_path, name, verdict):
    item = BY_NAME[name]
    assert Outcome(item, dict(item.measure(tmp_path))).verdict == verdict


def test_table_4_2_and_5_2_hold_what_k06_prints():
    for rudder, angle, force, side, rate, inertia in hardware.TABLE_4_2:
        assert angle == pytest.approx((rudder - 0.566) / -1.40, abs=0.1)
        assert -0.32 * side / rate == pytest.approx(inertia, abs=1e-4)
        assert abs(side) <= force
    _, true, measured, ratio = hardware.TABLE_5_2.T
    assert true / measured == pytest.approx(ratio, abs=1e-5)


def test_the_gyros_pure_delay_turns_the_phase_by_two_samples():
    frequency = np.array([10.0])
    turned = np.angle(gyro.gyro_response(frequency) / gyro.gyro_transfer(frequency)[0])
    assert turned == pytest.approx(-2 * np.pi * 10.0 * 2 * 0.0065536)
