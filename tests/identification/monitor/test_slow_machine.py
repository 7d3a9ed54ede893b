"""A machine whose period is seconds: a large change is found as a small one is."""

import numpy as np
import pytest

import hovercontrol as hc

G, C, NOISE, ROWS = 2.0, 50.0, 0.05, 600


def heated_plate(period):
    """T' = (P - G T)/C; with a period, in steps of Euler."""
    T, P = hc.Signal("T", "K"), hc.Signal("P", "W")
    c, g = hc.Signal("C", "J/K", start=C), hc.Signal("G", "W/K", start=G)
    rate = (P.symbol - g.symbol * T.symbol) / c.symbol
    if not period:
        return hc.Block("plate", [T], [P], [T], [c, g], {"T": rate})
    h = hc.Signal("h", "s", start=period)
    return hc.Block("plate", [T], [P], [T], [c, g, h], {"T": T.symbol + h.symbol * rate}, period=period)


def measured(period, *, sampled, change):
    """Return a log of the plate whose G grows by `change` at the middle."""
    rng, T, rows = np.random.default_rng(1), 0.0, []
    power = np.repeat(rng.uniform(0.0, 40.0, ROWS // 20), 20)
    for k, P in enumerate(power):
        rows.append(T + NOISE * rng.normal())
        g = G + (change if k >= ROWS // 2 else 0.0)
        kept = 1.0 - period * g / C if sampled else np.exp(-period * g / C)
        T = P / g + kept * (T - P / g)
    return hc.Log("plate", period * np.arange(ROWS), {"T": np.array(rows), "P": power})


@pytest.mark.slow
@pytest.mark.parametrize(("period", "sampled"), [(1.0, False), (2.0, True)])
@pytest.mark.parametrize("change", [0.2, G])
def test_a_change_is_found_however_large(period, sampled, change):
    watch = hc.monitor(
        heated_plate(period if sampled else None), ["G"], false_alarms_per_hour=0.1, period=period,
        measured=["T"], process_noise={"T": 0.02}, measurement_noise={"T": NOISE},
    )  # fmt: skip
    run = measured(period, sampled=sampled, change=change)
    alarm = hc.replay(watch, run, hold=50 * period).alarms[0]
    middle = period * ROWS / 2
    assert middle <= alarm.time <= middle + 30 * period
    assert alarm.change == pytest.approx(change, abs=3.0 * alarm.std)
