"""The page in a browser: flown by keyboard and pointer, recorded, looked at again."""

import asyncio
import os
from contextlib import asynccontextmanager

import pytest
from aiohttp.test_utils import TestServer

from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.pacer import Pacer
from hovercontrol.app.cockpit.server import Console
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.identification.identify import identify
from hovercontrol.logs import read_log
from tests.browser import CHROMIUM, browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Let a browser on a busy machine be slow; its silence has its own tests."""
    monkeypatch.setattr("hovercontrol.app.cockpit.pacer.SILENCE", 20.0)


@asynccontextmanager
async def page_of(folder, craft="hoverdemon", replay=None, **size):
    pacer = Pacer(Loop(vehicle(craft)))
    async with TestServer(Console(pacer, folder, replay).application()) as server, browser() as page:
        await page.open(
            str(server.make_url("/")), ready="globalThis.cockpit && cockpit.seen().state !== null", **size
        )
        yield page
        assert page.complaints == []


def flown(test):
    def run(tmp_path):
        async def fly():
            async with page_of(tmp_path) as page:
                await test(page, tmp_path)

        asyncio.run(fly())

    run.__name__ = test.__name__
    return run


def law(key):
    return f"document.querySelector('#laws button[value={key}]').click()"


def signal(name):
    return f"cockpit.seen().state.signals.{name}"


@flown
async def test_the_keyboard_flies_the_craft_and_the_stick_springs_back(page, folder):
    await page.key("ArrowUp", True)
    await page.until(f"{signal('thrust')} > 1.9")  # full stick is 2 N
    await page.key("ArrowLeft", True)
    await page.until(f"{signal('rudder')} < -0.5")
    await page.until(f"{signal('r')} > 0.2")  # left is counter-clockwise
    await page.key("ArrowUp", False)
    await page.key("ArrowLeft", False)
    await page.until(f"{signal('thrust')} === 0 && {signal('rudder')} === 0")


@pytest.mark.slow
@flown
async def test_thirty_frames_and_more_are_drawn_in_a_second(page, folder):
    counts = []
    for _ in range(10):  # a machine with other work may miss some
        before = await page.value("cockpit.seen()")
        await asyncio.sleep(1.0)
        after = await page.value("cockpit.seen()")
        passed = after["state"]["signals"]["time"] - before["state"]["signals"]["time"]
        counts.append([(after[what] - before[what]) / passed for what in ("frames", "drawn")])
        if min(counts[-1]) >= 30:
            return
    raise AssertionError(f"received and drawn in a second: {counts}")


@flown
async def test_laws_are_switched_by_clicks_and_their_references_set_in_degrees(page, folder):
    await page.value(law("turn"))
    await page.until("cockpit.seen().state.law === 'turn'")
    await page.until("document.querySelectorAll('#references input[type=number]').length === 1")
    field = "document.querySelector('#references input[type=number]')"
    await page.value(f"({field}.value = 90, {field}.dispatchEvent(new Event('change')))")
    await page.until("Math.abs(cockpit.seen().state.references.yaw_rate_ref - Math.PI / 2) < 1e-6")
    await page.value(f"({field}.value = 9000, {field}.dispatchEvent(new Event('change')))")
    line = await page.until(
        "!document.querySelector('#message').hidden && document.querySelector('#message').textContent"
    )
    assert "yaw rate: expected a number from −229.18 to 229.18 °/s, found 9000" in line
    assert float(await page.value(f"{field}.value")) == 90
    await page.key("ArrowUp", True)
    assert "Turn flies" in await page.until(
        "document.querySelector('#message').textContent.includes('stick is off') && "
        "document.querySelector('#message').textContent"
    )
    await page.key("ArrowUp", False)


@pytest.mark.slow
@flown
async def test_a_click_on_the_map_is_the_goal(page, folder):
    await page.value(law("goal"))
    await page.until("document.querySelector('#map').classList.contains('goal')")
    box = await page.value(
        "(({x, y, width, height}) => ({x, y, width, height}))"
        "(document.querySelector('#map').getBoundingClientRect())"
    )
    place = {"x": box["x"] + box["width"] / 2 + 90, "y": box["y"] + box["height"] / 2 - 60}
    for kind in ("mousePressed", "mouseReleased"):
        await page.call("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **place)
    goal = await page.until("cockpit.seen().state.references.goal_y_ref && cockpit.seen().state.references")
    assert goal["goal_x_ref"] > 0.5 and goal["goal_x_ref"] / goal["goal_y_ref"] == pytest.approx(1.5, rel=0.1)


@pytest.mark.slow
@flown
async def test_the_pad_is_a_stick_for_mouse_and_touch(page, folder):
    pad = await page.value(
        "(({x, y, width, height}) => ({x, y, width, height}))"
        "(document.querySelector('#pad').getBoundingClientRect())"
    )
    place = {"x": pad["x"] + pad["width"] * 0.9, "y": pad["y"] + pad["height"] * 0.1}
    await page.call("Input.dispatchMouseEvent", type="mousePressed", button="left", clickCount=1, **place)
    await page.until(f"{signal('thrust')} > 1.9 && {signal('rudder')} > 0.6")
    await page.call("Input.dispatchMouseEvent", type="mouseReleased", button="left", clickCount=1, **place)
    await page.until(f"{signal('thrust')} === 0")


@pytest.mark.slow
@flown
async def test_a_gamepad_is_a_stick(page, folder):
    await page.value(
        "(navigator.getGamepads = () => [null, {connected: true, axes: [-0.5, -1, 0, 0]}], true)"
    )
    await page.until(f"{signal('thrust')} > 1.9 && {signal('rudder')} < -0.2")


@pytest.mark.slow
@flown
async def test_a_flight_is_recorded_and_identify_accepts_it(page, folder):
    await page.value("document.querySelector('#record').click()")
    for turn in ("ArrowLeft", "ArrowRight", "ArrowLeft"):
        for code in ("ArrowUp", turn):
            await page.key(code, True)
        await asyncio.sleep(0.6)
        for code in ("ArrowUp", turn):
            await page.key(code, False)
        await asyncio.sleep(0.3)
    await page.value("document.querySelector('#record').click()")
    await page.until("document.querySelector('#logs').value === 'pilot-001.csv'")
    log = read_log(folder / "pilot-001.csv", inputs=["thrust", "rudder"])
    wrong = vehicle("hoverdemon").with_coefficients({"thrust": 0.2, "rudder_torque": 1.0})
    found = identify(wrong, [log])
    assert found["thrust"].value == pytest.approx(1 / 2.6, rel=0.01)
    assert found["rudder_torque"].value == pytest.approx(0.32 / 0.096, rel=0.01)

    await page.value("document.querySelector('#replay').click()")
    await page.until("document.body.dataset.mode === 'replay'")
    end = log.time[-1]
    await page.value(
        f"(s => (s.value = {end}, s.dispatchEvent(new Event('input'))))(document.querySelector('#seek'))"
    )
    await page.until(f"document.querySelector('#time').textContent === '{end:.1f}'")
    shown = await page.value("document.querySelector('#gauges output').textContent")
    assert float(shown.replace("−", "-")) == pytest.approx(log["u"][-1], abs=0.006)
    await page.value("document.querySelector('#live').click()")
    await page.until("document.body.dataset.mode === 'live'")


OVERLAPS = """(() => {
  const seen = [...document.querySelectorAll('button, input, select, a.button, label > .name')]
    .filter((e) => e.offsetParent).map((e) => [e, e.getBoundingClientRect()]);
  const found = [];
  for (const [e, a] of seen) for (const [f, b] of seen) {
    const beside = a.right <= b.left + 1 || b.right <= a.left + 1;
    const apart = beside || a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
    if (e !== f && !apart) found.push([e.id, f.id, e.outerHTML, f.outerHTML]);
  }
  return found;
})()"""


@pytest.mark.slow("1280")
@pytest.mark.parametrize(("width", "height"), [(1280, 900), (390, 844)])
def test_controls_of_a_replay_do_not_overlap(tmp_path, width, height):
    from hovercontrol.documents.samples import sample_path

    async def look():
        async with page_of(tmp_path, replay=sample_path(), width=width, height=height) as page:
            await page.until("document.body.dataset.mode === 'replay'")
            assert await page.value(OVERLAPS) == []
            assert await page.value("document.querySelector('#seek').clientWidth") > 120
            if "COCKPIT_PICTURES" in os.environ:
                await page.picture(f"{os.environ['COCKPIT_PICTURES']}/replay-{width}.png")

    asyncio.run(look())


@pytest.mark.slow("four_fan", "c17", "1280")
@pytest.mark.parametrize("craft", ["hoverdemon", "c17_experiment", "four_fan"])
@pytest.mark.parametrize(("width", "height"), [(1280, 900), (390, 844)])
def test_nothing_is_clipped_and_every_control_has_a_name(tmp_path, craft, width, height):
    async def look():
        async with page_of(tmp_path, craft, width=width, height=height) as page:
            await page.value(
                "document.querySelectorAll('#disturbances input[type=checkbox]')"
                ".forEach((box) => box.click())"
            )
            await page.until("document.querySelectorAll('.knobs:not([hidden])').length > 5")
            assert await page.value("document.documentElement.scrollWidth") <= width
            parts = "button, .gauge .top span, .gauge .value, .slider span, h1, h2, p"
            clipped = f"""[...document.querySelectorAll('{parts}')]
                .filter((e) => e.offsetParent && e.scrollWidth > e.clientWidth + 1 && e.clientWidth)
                .map((e) => e.id + e.className + ': ' + e.textContent)"""
            assert await page.value(clipped) == []
            assert await page.value(OVERLAPS) == []
            nameless = """[...document.querySelectorAll('button, input, select, canvas, a')]
                .filter((e) => !(e.textContent.trim() || e.getAttribute('aria-label') || e.labels?.length))
                .map((e) => e.outerHTML)"""
            assert await page.value(nameless) == []
            if "COCKPIT_PICTURES" in os.environ:
                await page.picture(f"{os.environ['COCKPIT_PICTURES']}/{craft}-{width}.png", whole=True)

    asyncio.run(look())


def test_a_log_is_shown_first_where_one_is_given(tmp_path):
    from hovercontrol.documents.samples import sample_path

    async def look():
        async with page_of(tmp_path, replay=sample_path()) as page:
            await page.until("document.body.dataset.mode === 'replay'")
            await page.until("Number(document.querySelector('#time').textContent) > 0.2")

    asyncio.run(look())
