"""A log in millimetres, milliseconds or degrees is said to be so, by whoever reads it first."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.samples import sample_path
from hovercontrol.identification.check import check
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log, read_log
from hovercontrol.logs.scales import scale_faults


@pytest.fixture(scope="module")
def sound():
    log = read_log(sample_path(), inputs=["thrust", "rudder"])
    return log.select(slice(0, 1500))


def scaled(log, **factors):
    columns = {name: factors.get(name, 1.0) * values for name, values in log.columns.items()}
    return Log(log.name, factors.get("time", 1.0) * log.time, columns)


CLUMSY = pytest.mark.parametrize(
    ("factors", "said"),
    [
        ({"x": 1e3, "y": 1e3}, "is it in millimetres or centimetres"),
        ({"x": 1e2, "y": 1e2}, "is it in millimetres or centimetres"),
        ({"time": 1e3}, "rows are 20 s apart: is its time in seconds"),
        ({"time": 1e6}, "rows are 20000 s apart: is its time in seconds"),
        ({"psi": 180 / np.pi}, "the heading turns at .* is it in degrees"),
    ],
)


@CLUMSY
def test_identify_refuses_it_in_one_line(sound, factors, said):
    with pytest.raises(InputError, match=said):
        identify(vehicle("c17_experiment"), [scaled(sound, **factors)])


@CLUMSY
def test_check_says_it(sound, factors, said):
    assert said.partition(".*")[0] in check(None, [scaled(sound, **factors)]).text()


def test_a_sound_log_and_a_heading_that_is_wrapped_pass(sound):
    wrapped = sound.with_columns({"psi": np.angle(np.exp(1j * sound["psi"]))})
    assert scale_faults(sound) == scale_faults(wrapped) == []


@pytest.mark.parametrize("hertz", [500, 2000])
def test_a_noisy_compass_read_fast_passes_and_in_degrees_does_not(hertz):
    t = np.arange(0.0, 10.0, 1 / hertz)
    psi = np.angle(np.exp(1j * (6.0 * t + 0.1 * np.random.default_rng(1).normal(size=t.size))))
    assert np.median(np.abs(np.diff(psi))) * hertz > 30.0  # as fast from row to row as no craft turns
    assert scale_faults(Log("a", t, {"psi": psi})) == []
    assert "is it in degrees" in scale_faults(Log("a", t, {"psi": np.degrees(psi)}))[0]


def test_gaps_and_short_logs_pass(sound):
    holes = sound["x"].copy()
    holes[5:900] = np.nan
    assert scale_faults(sound.with_columns({"x": holes})) == []
    assert scale_faults(sound.select(slice(0, 1))) == [] == scale_faults(sound.select(slice(0, 0)))
