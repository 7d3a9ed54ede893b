"""The monitor beside the pilot: a disturbance that is switched on is named, and so is its end."""

import asyncio
import random

import numpy as np
import pytest

from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.loops import Loops
from hovercontrol.app.cockpit.messages import check_message
from hovercontrol.app.cockpit.pacer import Pacer
from hovercontrol.app.cockpit.watch import Watch, one_air_drag, watch_block
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.craft.models.vehicles import vehicle
from tests.browser import CHROMIUM

from .test_page import page_of

CANNED = {
    "begun": 0.0, "evidence": 60.0, "threshold": 30.0, "open": None,
    "alarms": [
        {"time": 20.5, "name": "slope_y", "kind": "change", "change": -0.1, "std": 0.0056, "unit": "m/s^2",
         "since": 20.0, "rivals": ["wind"], "evidence": 60.0, "last": 25.5},
        {"time": 41.3, "name": "rudder_offset", "kind": "change", "change": 0.0873, "std": 0.0035,
         "unit": "rad", "since": 40.7, "rivals": [], "evidence": 60.0, "last": 46.3},
    ],
}  # fmt: skip


class Canned:
    """A monitor that says the same at every instant."""

    def __init__(self, block):
        self.rows, self.restarts = [], 0

    def row(self, signals):
        self.rows.append(signals["time"])

    def restart(self):
        self.restarts += 1

    def state(self):
        return CANNED


@pytest.fixture
def canned(monkeypatch):
    monkeypatch.setattr("hovercontrol.app.cockpit.loops.elsewhere", lambda make, model: Block("watch"))
    monkeypatch.setattr("hovercontrol.app.cockpit.loops.Watch", Canned)


def test_one_coefficient_is_the_drag_in_surge_and_sway():
    plant = Loop(vehicle("hoverdemon")).model.plant()
    one = one_air_drag(plant)
    x, u = np.array([0.3, -0.2, 0.7, 0.9, -0.5, 1.1]), np.array([1.3, -0.4])

    def slopes(block, **drags):
        drags = {f"plant.{key}": value for key, value in drags.items()}
        return block.to_numpy().derivatives(0.0, x, u, drags)

    both = slopes(plant, surge_linear_drag=0.3, sway_linear_drag=0.3)
    assert slopes(one, air_drag=0.3) == pytest.approx(both, rel=1e-12)
    assert one_air_drag(one) is one


def test_a_monitor_sees_every_row_and_begins_anew_at_a_reset(canned):
    pacer = Pacer(Loop(vehicle("hoverdemon")))
    asyncio.run(Loops(pacer).watch())
    watch = pacer._monitor
    pacer._wall -= 0.2
    pacer._paused = False
    pacer._advance()
    assert watch.rows == pytest.approx(0.01 * np.arange(len(watch.rows))) and len(watch.rows) >= 2
    pacer.reset()
    assert watch.restarts == 1 and pacer.state["monitor"] == CANNED
    pacer.fly(Loop(vehicle("hoverdemon")))
    assert pacer.state["monitor"] is None


def test_the_order_is_true_or_false():
    check_message({"monitor": True})
    with pytest.raises(InputError, match="monitor: expected bool"):
        check_message({"monitor": "on"})


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_the_page_says_what_how_large_since_when_and_what_else(tmp_path, canned, monkeypatch):
    monkeypatch.setattr("hovercontrol.app.cockpit.pacer.SILENCE", 20.0)

    async def look():
        async with page_of(tmp_path) as page:
            text = "document.querySelector('#monitor-panel').innerText"
            assert "looks for changes" in await page.value(text)
            await page.value("document.querySelector('#monitor').click()")
            await page.until(f"{text}.includes('slope y')")
            said = await page.value(text)
            assert "20.5 s: slope y changed by −0.1000 ± 0.0056 m/s² since 20.0 s; or it is wind." in said
            assert "41.3 s: rudder offset changed by 5.00 ± 0.20 ° since 40.7 s." in said
            assert "No further change." in said
            await page.value("document.querySelector('#monitor').click()")
            await page.until(f"!{text}.includes('slope y')")

    asyncio.run(look())


@pytest.fixture(scope="module")
def flown():
    loop = Loop(vehicle("hoverdemon"))
    return loop, Watch(watch_block(loop.model))


@pytest.mark.slow
@pytest.mark.parametrize("key", [None, "slope", "yaw_coulomb"])
def test_what_is_switched_on_is_named_with_its_size(flown, key):
    loop, watch = flown
    loop.command(law="manual", disturbances=dict.fromkeys(loop.disturbances))
    loop.reset()
    watch.restart()
    sticks = random.Random(3)
    for k in range(3000):
        if k % 100 == 0:
            slow = sticks.uniform(-0.3, 1.0) - 0.6 * loop.signals()["u"]
            loop.command(stick=(max(-1.0, min(1.0, slow)), sticks.uniform(-0.6, 0.6)))
        if k == 2000 and key:
            loop.command(
                disturbances={key: {s.signal.name: s.signal.start for s in loop.disturbances[key].knobs}}
            )
        watch.row(loop.signals())
        loop.advance(loop.time + 0.01)
    alarms = watch.state()["alarms"]
    if key is None:
        assert alarms == []
        return
    (alarm,) = alarms
    true = {"slope": ("slope_y", -0.1)}
    name, size = true.get(key, (key, 0.8))
    assert name in {alarm["name"], *alarm["rivals"]} and alarm["name"] == name
    assert abs(alarm["change"] - size) < 0.05 * abs(size) + 3 * alarm["std"]
    assert 20.0 < alarm["time"] < 23.0 and abs(alarm["since"] - 20.0) < 1.0


def test_the_monitor_is_of_the_ideal_loop(canned):
    from hovercontrol.app.cockpit.server import Console

    console = Console(Pacer(Loop(vehicle("hoverdemon"))), None)
    console.pacer.loop.kind = "real"
    with pytest.raises(InputError, match="knows the ideal loop only"):
        console._monitor(None, True)
