"""The page and its server with the real loop: the switch, the ground station, and what is refused."""

import asyncio
import os
from contextlib import asynccontextmanager

import pytest
from aiohttp.test_utils import TestClient, TestServer

from hovercontrol.app.cockpit.loops import loop_of
from hovercontrol.app.cockpit.pacer import Pacer
from hovercontrol.app.cockpit.server import Console
from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.identification.identify import identify
from hovercontrol.logs import read_log
from tests.browser import CHROMIUM, browser

from .test_page import OVERLAPS, law, signal
from .test_server import talking, told

pytestmark = pytest.mark.slow  # building the loop takes ten seconds
in_a_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


@pytest.fixture(autouse=True)
def _patient(monkeypatch, request):
    """Let a browser on a busy machine be slow; silence has its own tests."""
    if "silent" not in request.node.name:
        monkeypatch.setattr("hovercontrol.app.cockpit.pacer.SILENCE", 20.0)


@asynccontextmanager
async def client_of(folder, kind="ideal", craft="hoverdemon"):
    console = Console(Pacer(loop_of(kind, vehicle(craft))), folder)
    async with TestClient(TestServer(console.application())) as client:
        yield client


@asynccontextmanager
async def page_of(folder, kind="real", **size):
    console = Console(Pacer(loop_of(kind, vehicle("hoverdemon"))), folder)
    async with TestServer(console.application()) as server, browser() as page:
        await page.open(
            str(server.make_url("/")), ready="globalThis.cockpit && cockpit.seen().drawn > 0", **size
        )
        yield page
        assert page.complaints == []


def run(test, *arguments, **given):
    asyncio.run(test(*arguments, **given))


# ---- the server ----------------------------------------------------------------------------------------


def test_the_loop_is_switched_there_and_back_and_every_page_is_told(tmp_path):
    async def fly():
        async with client_of(tmp_path) as client, talking(client) as (talk, first):
            assert first["about"]["loop"] == "ideal" and first["about"]["real"]
            await talk.send_json({"command": {"law": "turn"}})
            await talk.send_json({"loop": "real"})
            assert "Building" in (await told(talk, lambda m: "news" in m, 300))["news"]
            about = (await told(talk, lambda m: "about" in m, 300))["about"]
            assert about["loop"] == "real" and "packet_loss" in about["disturbances"]
            state = await told(talk, lambda m: m.get("loop") == "real" and not m["paused"])
            assert state["law"] == "turn" and state["switches"]["transmit"] is True
            later = await told(talk, lambda m: m.get("signals", {}).get("time", 0) > 0.5)
            assert later["signals"]["uplink_messages"] > 20
            await talk.send_json({"loop": "ideal"})
            await told(talk, lambda m: m.get("about", {}).get("loop") == "ideal")
            state = await told(talk, lambda m: m.get("loop") == "ideal")
            assert state["switches"] == {} and "uplink_age" not in state["signals"]

    run(fly)


def test_wrong_orders_of_the_real_loop_are_refused_in_one_line_and_the_connection_stays(tmp_path):
    async def fly():
        async with client_of(tmp_path, "real") as client, talking(client) as (talk, _):
            await told(talk, lambda m: "frame" in m)
            for wrong, text in [
                ({"loop": "reel"}, "did you mean 'real'"),
                ({"loop": 3}, "expected str"),
                ({"command": {"switches": []}}, "expected an object"),
                ({"command": {"switches": {"lift": "on"}}}, "expected true or false"),
                ({"command": {"switches": {"transmit": None}}}, "expected true or false"),
                ({"command": {"switches": {"lifft": True}}}, "did you mean 'lift'"),
                ({"command": {"disturbances": {"packet_loss": {"part": -1}}}}, "out of its bounds"),
                ({"command": {"switches": {"x" * 5000: True}}}, "unknown switch"),
            ]:
                await talk.send_json(wrong)
                answer = await told(talk, lambda m: "error" in m)
                assert text in answer["error"] and "\n" not in answer["error"], wrong
                assert len(answer["error"]) <= 300
            assert (await told(talk, lambda m: "frame" in m))["switches"]["lift"] is True

    run(fly)


def test_commands_go_to_zero_where_a_page_falls_silent_and_the_link_brings_it_to_the_craft(tmp_path):
    async def fly():
        async with client_of(tmp_path, "real") as client, talking(client) as (talk, _):
            message = await told(talk, lambda m: m.get("signals", {}).get("thrust", 0) > 0.5)
            since = message["signals"]["time"]
            while "frame" not in message or message["signals"]["thrust"]:  # heard, not answered
                message = await talk.receive_json(timeout=20)
            # 0.4 s of silence, then message, link and servo.
            assert message["signals"]["time"] - since <= 0.4 + 0.15 + 0.1
            assert "No word from the browser" in message["note"]
            assert message["signals"]["failsafe_on"] == 0  # the ground station sends zeros

    run(fly)


def test_a_craft_that_k06s_laws_do_not_fly_has_no_real_loop(tmp_path):
    with pytest.raises(InputError, match="thrust is in newton"):
        loop_of("real", vehicle("four_fan"))

    async def fly():
        async with client_of(tmp_path, craft="four_fan") as client, talking(client) as (talk, first):
            assert not first["about"]["real"]
            await talk.send_json({"loop": "real"})
            assert "thrust is in newton" in (await told(talk, lambda m: "error" in m))["error"]
            assert (await told(talk, lambda m: "frame" in m))["loop"] == "ideal"

    run(fly)


def test_only_the_pilot_switches_the_loop(tmp_path):
    async def fly():
        async with (
            client_of(tmp_path) as client,
            talking(client) as (pilot, _),
            talking(client) as (other, _),
        ):
            await told(pilot, lambda m: m.get("pilot"))
            await other.send_json({"loop": "real"})
            assert "another page controls" in (await told(other, lambda m: "error" in m))["error"]

    run(fly)


# ---- the page ------------------------------------------------------------------------------------------


def value_of(label):
    return (
        "[...document.querySelectorAll('#station dt')]"
        f".find((e) => e.textContent === '{label}').nextSibling.textContent"
    )


@in_a_browser
def test_the_page_switches_to_the_real_loop_and_shows_the_ground_station(tmp_path):
    async def look():
        async with page_of(tmp_path, "ideal") as page:
            assert await page.value("document.querySelector('#station').hidden")
            await page.value("document.querySelector('#loops button[value=real]').click()")
            await page.until("document.body.dataset.loop === 'real'", 300)
            await page.until("!document.querySelector('#station').hidden")
            groups = await page.value(
                "[...document.querySelectorAll('#station h2')].map((e) => e.textContent)"
            )
            assert groups == ["Link", "Craft", "Navigation", "Commands"]
            await page.until(f"{value_of('Power-on time')} === '00:00:02'")
            await page.value("document.querySelector('#loops button[value=ideal]').click()")
            await page.until("document.querySelector('#station').hidden")

    run(look)


@in_a_browser
def test_transmission_lift_and_who_commands_are_switched_on_the_page(tmp_path):
    async def look():
        async with page_of(tmp_path) as page:
            await page.value(law("forward"))
            await page.until(f"{signal('thrust')} > 0.5")
            await page.value("document.querySelector('#switch-transmit').click()")
            await page.until("document.querySelector('#switch-transmit').textContent === 'Transmit off'")
            await page.until(f"{value_of('Hears commands')} === 'no, fans off' && {signal('thrust')} === 0")
            assert "Transmission is off" in await page.value("cockpit.seen().state.note")
            await page.value("document.querySelector('#switch-transmit').click()")
            await page.until(f"{signal('thrust')} > 0.5")
            await page.value("document.querySelector('#switch-user').click()")
            await page.until("cockpit.seen().state.law === 'manual'")
            await page.until(f"{signal('thrust')} === 0")
            await page.key("ArrowUp", True)
            await page.until(f"{signal('thrust')} > 1.9")
            await page.key("ArrowUp", False)
            await page.value("document.querySelector('#switch-computer').click()")
            await page.until("cockpit.seen().state.law === 'forward'")  # the one that flew before
            await page.value("document.querySelector('#switch-lift').click()")
            await page.until(f"Math.abs({signal('u')}) < 0.01 && {signal('thrust')} > 0.3")

    run(look)


@in_a_browser
def test_calibration_on_the_page_stores_the_platforms_tilt(tmp_path):
    async def look():
        async with page_of(tmp_path) as page:
            await page.value(
                "[...document.querySelectorAll('#disturbances label')]"
                ".find((e) => e.textContent.includes('Tilted')).querySelector('input').click()"
            )
            await page.until("cockpit.seen().state.disturbances.platform_tilt")
            await page.value("document.querySelector('#switch-calibrate').click()")
            await page.until("document.querySelector('#switch-calibrate').textContent === 'Calibrating…'")
            await page.until("document.querySelector('#switch-calibrate').textContent === 'Calibrate'")
            pitch = await page.value(value_of("Platform pitch"))
            assert float(pitch.split()[0].replace("−", "-")) == pytest.approx(2.0, abs=0.5)

    run(look)


@in_a_browser
def test_a_real_flight_is_recorded_and_identify_accepts_it(tmp_path):
    async def look():
        async with page_of(tmp_path) as page:
            await page.value("document.querySelector('#record').click()")
            for turn in ("ArrowLeft", "ArrowRight", "ArrowLeft"):
                for down in (True, False):
                    for code in ("ArrowUp", turn):
                        await page.key(code, down)
                    await asyncio.sleep(0.8)
            await page.value("document.querySelector('#record').click()")
            await page.until("document.querySelector('#logs').value === 'pilot-001.csv'")

    run(look)
    log = read_log(tmp_path / "pilot-001.csv", inputs=["thrust", "rudder"])
    assert "true_x" in log.columns
    found = identify(vehicle("hoverdemon").with_coefficients({"thrust": 0.2}), [log])
    assert found["thrust"].value > 0  # how near it comes on a long log: test_real_loop


@in_a_browser
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize(("width", "height"), [(1400, 900), (1000, 800), (390, 844)])
def test_nothing_is_clipped_in_the_real_loop_and_nothing_overlaps(tmp_path, width, height, dark):
    async def look():
        async with page_of(tmp_path, width=width, height=height, dark=dark) as page:
            await page.value(
                "document.querySelectorAll('#disturbances input[type=checkbox]')"
                ".forEach((box) => box.click())"
            )
            await page.value("document.querySelector('#switch-transmit').click()")
            await page.until("document.querySelectorAll('.knobs:not([hidden])').length > 7")
            await page.until(f"{value_of('Hears commands')} !== 'yes'")
            assert await page.value("document.documentElement.scrollWidth") <= width
            parts = "button, .gauge .top span, .gauge .value, .slider span, h1, h2, p, dt, dd"
            clipped = f"""[...document.querySelectorAll('{parts}')]
                .filter((e) => e.offsetParent && e.scrollWidth > e.clientWidth + 1 && e.clientWidth)
                .map((e) => e.id + e.className + ': ' + e.textContent)"""
            assert await page.value(clipped) == []
            assert await page.value(OVERLAPS) == []
            if "COCKPIT_PICTURES" in os.environ:
                name = f"real-{width}{'-dark' if dark else ''}.png"
                await page.picture(f"{os.environ['COCKPIT_PICTURES']}/{name}", whole=True)

    run(look)
