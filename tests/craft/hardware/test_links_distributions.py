"""Distributions of delays: the four numbers that table 5.1 prints of each hold exactly."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import kstest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.hardware.links import TABLE_5_1, BoundedDelays, bluetooth_delays

SHARE = sp.Symbol("share", real=True)


def quantiles(delays):
    return sp.lambdify(SHARE, delays.quantile(SHARE))


@pytest.mark.parametrize("name", TABLE_5_1)
def test_each_row_has_its_printed_mean_deviation_and_bounds(name):
    mean, sd, least, most = (value / 1000 for value in TABLE_5_1[name])
    q = quantiles(bluetooth_delays(name))
    first, second = (quad(lambda share, n=n: q(share) ** n, 0, 1, epsabs=1e-12)[0] for n in (1, 2))
    assert first == pytest.approx(mean, abs=1e-7)
    assert np.sqrt(second - first**2) == pytest.approx(sd, abs=1e-6)
    assert (q(0.0), q(1.0)) == pytest.approx((least, most))


def test_facts_prints_the_rows_of_the_autopilots_link():
    assert TABLE_5_1["linksys_22.0_uplink"] == (40.81, 10.61, 22, 90)
    assert TABLE_5_1["linksys_22.0_downlink"] == (34.32, 8.18, 19, 67)
    assert TABLE_5_1["linksys_22.0_round_trip"] == (77.54, 14.44, 46, 110)


def test_a_round_trip_is_up_and_down():
    trips = [name.removesuffix("_round_trip") for name in TABLE_5_1 if name.endswith("_round_trip")]
    assert len(trips) == 5 and len(TABLE_5_1) == 15
    for trip in trips:
        up, down, both = (
            np.array(TABLE_5_1[f"{trip}_{way}"]) for way in ("uplink", "downlink", "round_trip")
        )
        assert both[0] == pytest.approx(up[0] + down[0], rel=0.07)  # means: measured in separate runs
        assert up[2] + down[2] <= both[2] and both[3] <= up[3] + down[3]  # a sum's bounds


@settings(max_examples=10, deadline=None)
@given(
    st.floats(0, 0.2),
    st.floats(0.001, 0.3),
    st.floats(0.03, 0.97),
    st.floats(0.02, 0.9),
    st.floats(0, 1),
    st.floats(0, 1),
)
def test_delays_stay_between_their_bounds_and_quantiles_rise(least, width, place, spread, share, other):
    mean, most = least + place * width, least + width
    assume(least < mean < most)
    try:
        delays = BoundedDelays(mean, spread * np.sqrt((mean - least) * (most - mean)), least, most)
    except InputError as error:
        assert "no distribution found" in str(error)
        return
    q = quantiles(delays)
    low, high = sorted((share, other))
    assert least - 1e-12 <= q(low) <= q(high) <= most + 1e-12


def test_drawn_delays_have_kumaraswamys_distribution():
    delays = bluetooth_delays("linksys_22.0_downlink")
    a, b = delays.shapes
    drawn = quantiles(delays)(np.random.default_rng(0).uniform(size=5000))
    z = (drawn - 0.019) / (0.067 - 0.019)
    assert kstest(z, lambda z: 1 - (1 - z**a) ** b).pvalue > 1e-3


@pytest.mark.parametrize(
    ("mean", "sd", "least", "most", "line"),
    [
        (0.04, 0.01, 0.09, 0.022, "least < most"),
        (0.04, 0.01, -0.01, 0.09, "0 <= least"),
        (0.1, 0.01, 0.022, 0.09, "mean 0.1 s must be between"),
        (0.04, 0.0, 0.022, 0.09, "sd must be positive"),
        (0.04, 0.5, 0.022, 0.09, "must be below 0.03 s"),
        ("x", 0.5, 0.022, 0.09, "mean: expected a number"),
    ],
)
def test_numbers_that_no_delays_have_are_refused(mean, sd, least, most, line):
    with pytest.raises(InputError, match=line):
        BoundedDelays(mean, sd, least, most)


def test_an_unknown_row_names_the_nearest():
    with pytest.raises(InputError, match=r"did you mean 'linksys_22\.0_uplink'"):
        bluetooth_delays("linksys_22_uplink")
