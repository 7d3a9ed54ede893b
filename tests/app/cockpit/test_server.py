"""The server of the cockpit: who may talk to it, what it tells and does, logs to look at again."""

import asyncio
import errno
import json
import os
import socket
import threading
import time
from contextlib import asynccontextmanager
from functools import cache
from importlib import resources
from urllib.parse import quote

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
from aiohttp import WSServerHandshakeError
from aiohttp.test_utils import TestClient, TestServer
from yarl import URL

from hovercontrol.app.cockpit.guard import is_loopback
from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.pacer import Pacer
from hovercontrol.app.cockpit.server import Console, listen
from hovercontrol.app.cockpit.shelf import MOST_ROWS, log_columns, open_log
from hovercontrol.base.errors import InputError
from hovercontrol.base.folders import _swap
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.logs import Log, read_log


@cache
def shared():
    """The loop of all consoles, built when a test first needs it."""
    return Loop(vehicle("hoverdemon"))


@pytest.fixture(autouse=True)
def _patient(monkeypatch, request):
    """Let a test on a busy machine be slow; silence has its own tests."""
    if "silent" not in request.node.name:
        monkeypatch.setattr("hovercontrol.app.cockpit.pacer.SILENCE", 20.0)


def served(test):
    """Let a test be a coroutine that gets a client of a console that saves to `tmp_path`."""

    def run(tmp_path):
        asyncio.run(with_client(test, tmp_path))

    run.__name__ = test.__name__
    return run


async def with_client(test, tmp_path, **given):
    async with client_of(tmp_path, **given) as client:
        await test(client, tmp_path)


@asynccontextmanager
async def client_of(tmp_path, token="", replay=None):
    shared().reset()
    shared().command(law="manual", stick=(0.0, 0.0), disturbances={key: None for key in shared().switched_on})
    console = Console(Pacer(shared()), tmp_path / "flights", replay)
    async with TestClient(TestServer(console.application(token))) as client:
        yield client


def origin(client):
    return str(client.make_url("/")).rstrip("/")


@asynccontextmanager
async def talking(client):
    async with client.ws_connect("/ws", origin=origin(client)) as talk:
        about = await talk.receive_json()
        yield talk, about


async def told(talk, wanted, seconds=20.0):
    """Return the first message that is wanted; every frame is answered as the page does."""
    end = asyncio.get_running_loop().time() + seconds
    while asyncio.get_running_loop().time() < end:
        message = await talk.receive_json(timeout=seconds)
        if message.get("pilot"):
            await talk.send_json({"stick": [0.5, 0.0]})
        if wanted(message):
            return message
    raise AssertionError("never told")


def log(rows=50, **more):
    t = np.arange(rows) * 0.02
    return Log("demo", t, {"x": t, "y": 0 * t, "psi": 0 * t, "thrust": 1 + 0 * t, **more})


@served
async def test_the_page_and_its_parts_are_served_and_load_nothing_from_elsewhere(client, tmp_path):
    page = await client.get("/")
    text = await page.text()
    assert page.status == 200 and "<canvas" in text and "http" not in text
    assert "default-src 'self'" in page.headers["Content-Security-Policy"]
    for name in (
        "cockpit.css",
        "main.js",
        "map.js",
        "stick.js",
        "panel.js",
        "gauges.js",
        "replay.js",
        "station.js",
        "units.js",
    ):
        part = await client.get(f"/page/{name}")
        assert part.status == 200, name
        assert "://" not in (await part.text()).replace('"wss" : "ws"}://${location.host}', ""), name


@pytest.mark.parametrize("suffix", ["html", "css", "js", "svg", "py"])
def test_no_name_leads_to_a_file_that_is_not_the_pages_own(tmp_path, suffix):
    """Files beside the page, above it and elsewhere, by every way of writing a path."""
    secret = tmp_path / f"secret.{suffix}"
    secret.write_text("42.4242")
    page = resources.files("hovercontrol.app.cockpit") / "page"
    up = os.path.relpath(secret, str(page))
    paths = [
        str(secret),
        f"/{secret}",
        up,
        f"./{up}",
        f"main.js/../{up}",
        f"x/../{up}",
        f"{up}\0.js",
        f"{secret}\0",
    ]
    paths += ["..", ".", "", "../page/main.js", "./main.js", "main.js/", "main.js\0", "\0main.js", "MAIN.JS"]
    own = [file.read_text(encoding="utf-8") for file in page.iterdir() if file.is_file()]
    names = [way(path) for path in paths for way in (quoted, twice, backslashed, quote)]

    async def ask(client, folder):
        for name in dict.fromkeys(names):
            answer = await client.get(URL(f"/page/{name}", encoded=True))
            assert answer.status in (400, 404) or await answer.text() in own, name

    asyncio.run(with_client(ask, tmp_path))


def quoted(path):
    return quote(path, safe="")


def twice(path):
    return quote(quote(path, safe=""), safe="")


def backslashed(path):
    return quote(path.replace("/", "\\"), safe="")


@served
async def test_a_browser_is_told_the_craft_and_then_frames(client, tmp_path):
    async with talking(client) as (talk, first):
        about = first["about"]
        assert about["craft"] == "hoverdemon" and [i["name"] for i in about["inputs"]] == ["thrust", "rudder"]
        assert all("unit" in i and "full" in i for i in about["inputs"])
        rates = []
        while not rates or max(rates) < 30:  # a machine with other work may miss some
            assert len(rates) < 10, rates
            begin = await told(talk, lambda m: "frame" in m and not m["paused"])
            later = begin["signals"]["time"] + 1.0
            end = await told(talk, lambda m, later=later: "frame" in m and m["signals"]["time"] > later)
            passed = end["signals"]["time"] - begin["signals"]["time"]
            rates.append((end["frame"] - begin["frame"]) / passed)
        assert end["signals"]["thrust"] == 1.0  # half of full stick, 2 N


@served
async def test_orders_are_obeyed_and_wrong_ones_answered_in_one_line(client, tmp_path):
    async with talking(client) as (talk, _):
        await talk.send_json({"command": {"law": "forward", "references": {"surge_ref": 0.5}}})
        await told(talk, lambda m: m.get("law") == "forward" and m["references"] == {"surge_ref": 0.5})
        for wrong, text in [
            ({"command": {"law": "forwards"}}, "did you mean 'forward'"),
            ({"command": {"references": {"surge_ref": 9}}}, "out of its bounds"),
            ({"command": {"laws": "stop"}}, "did you mean 'law'"),
            ({"command": {"references": 3}}, "expected an object"),
            ({"command": {"disturbances": {"wind": 3}}}, "expected an object or null"),
            ({"command": "stop"}, "expected dict"),
            ({"pawse": True}, "did you mean 'pause'"),
            ({"pause": "yes"}, "expected bool"),
            ({"stick": [3, 0]}, "out of its bounds"),
            ({"stick": "left"}, "expected two numbers"),
            ([1, 2], "expected an object"),
        ]:
            await talk.send_json(wrong)
            answer = await told(talk, lambda m: "error" in m)
            assert text in answer["error"] and "\n" not in answer["error"], wrong
        for raw in ("{", '{"stick": [NaN, 0]}'):
            await talk.send_str(raw)
            assert "error" in await told(talk, lambda m: "error" in m)
        state = await told(talk, lambda m: "frame" in m)
        assert state["law"] == "forward" and state["references"] == {"surge_ref": 0.5}


@served
async def test_the_craft_is_left_without_commands_when_the_pilot_goes(client, tmp_path):
    async with talking(client) as (talk, _):
        await told(talk, lambda m: m.get("signals", {}).get("thrust", 0) > 0)
    async with talking(client) as (talk, _):
        message = await talk.receive_json()
        assert message["signals"]["thrust"] == 0 and message["law"] == "manual"


@served
async def test_a_page_that_falls_silent_loses_the_craft_within_half_a_second(client, tmp_path):
    async with talking(client) as (talk, _):
        message = await told(talk, lambda m: m.get("signals", {}).get("thrust", 0) > 0)
        silent_since = message["signals"]["time"]
        while "frame" not in message or message["signals"]["thrust"]:  # heard, not answered
            message = await talk.receive_json(timeout=20)
        assert message["signals"]["time"] - silent_since <= 0.5
        assert "No word from the browser" in message["note"]


@pytest.mark.parametrize(
    "said",
    [
        "{}",
        "junk",
        "[]",
        '{"stick": null}',
        '{"stick": [9, 0]}',
        '{"stick": [1, 0], "pawse": true}',
        '{"stick": [1, 0], "command": {"law": "nonsense"}}',
        '{"command": {}}',
        '{"command": {"references": {}, "disturbances": {}}}',
        '{"command": {"law": "nonsense"}}',
        '{"take": true}',
        '{"pause": false}',
        '{"record": false}',
    ],
)
def test_what_is_no_stick_and_no_command_is_as_silent_as_nothing(tmp_path, said, monkeypatch):
    """Full thrust goes off in time, however often it is said."""

    async def fly(client, folder):
        async with talking(client) as (talk, _):
            await told(talk, lambda m: m.get("signals", {}).get("thrust", 0) > 0)
            since = asyncio.get_running_loop().time()
            thrust = 1.0
            while thrust:
                assert asyncio.get_running_loop().time() - since < 5.0
                await talk.send_str(said)
                message = await talk.receive_json(timeout=20)
                thrust = message["signals"]["thrust"] if "frame" in message else thrust
            assert message["law"] == "manual" and "No word from the browser" in message["note"]

    monkeypatch.setattr("hovercontrol.app.cockpit.pacer.SILENCE", 0.3)
    asyncio.run(with_client(fly, tmp_path))


@pytest.mark.parametrize("said", ['{"stick": [1, 0]}', '{"command": {"law": "forward"}}'])
def test_a_stick_and_a_command_keep_the_craft(tmp_path, said, monkeypatch):
    async def fly(client, folder):
        async with talking(client) as (talk, _):
            since = asyncio.get_running_loop().time()
            while asyncio.get_running_loop().time() - since < 1.0:
                await talk.send_str(said)
                message = await talk.receive_json(timeout=20)
            assert "No word" not in message["note"]

    monkeypatch.setattr("hovercontrol.app.cockpit.pacer.SILENCE", 0.4)
    asyncio.run(with_client(fly, tmp_path))


@served
async def test_one_page_flies_and_another_watches_until_it_takes_control(client, tmp_path):
    async with talking(client) as (pilot, _), talking(client) as (other, _):
        await told(pilot, lambda m: m.get("pilot"))
        await told(other, lambda m: m.get("pilot") is False)
        await other.send_json({"command": {"law": "stop"}})
        assert "another page controls" in (await told(other, lambda m: "error" in m))["error"]
        await other.send_json({"take": True})
        await told(other, lambda m: m.get("pilot"))
        await told(pilot, lambda m: m.get("pilot") is False)


@served
async def test_a_recording_is_saved_whole_listed_downloaded_and_shown(client, tmp_path):
    assert await (await client.get("/logs")).json() == []
    async with talking(client) as (talk, _):
        await told(talk, lambda m: "frame" in m)
        await talk.send_json({"record": True})
        await told(talk, lambda m: (m.get("recording") or 0) > 0.3)
        await talk.send_json({"record": False})
        saved = (await told(talk, lambda m: "saved" in m))["saved"]
        await talk.send_json({"record": True})
        await told(talk, lambda m: (m.get("recording") or 0) > 0.1)
    assert await (await client.get("/logs")).json() == [saved] == ["pilot-001.csv"]
    assert [f.name for f in (tmp_path / "flights").iterdir()] == [saved]  # nothing half written beside it
    download = await client.get(f"/logs/{saved}")
    assert "attachment" in download.headers["Content-Disposition"]
    assert await download.read() == (tmp_path / "flights" / saved).read_bytes()
    shown = await (await client.get(f"/logs/{saved}/columns")).json()
    flown = read_log(tmp_path / "flights" / saved, inputs=["thrust", "rudder"])
    assert shown["columns"]["x"] == flown["x"].tolist() and shown["name"] == saved
    for name in ("nothing.csv", "..%2F..%2Fsecret.csv"):
        assert (await client.get(f"/logs/{name}")).status == 404


def full_for(times, monkeypatch):
    """Let the disk be full: the first times that a log is written, half of it is."""
    save, left = Log.save, [times]

    def write(log, path):
        if left[0]:
            left[0] -= 1
            path.write_text("time,x")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        save(log, path)

    monkeypatch.setattr(Log, "save", write)


def test_a_recording_that_meets_a_full_disk_is_kept_and_written_later(tmp_path, monkeypatch):
    full_for(2, monkeypatch)
    monkeypatch.setattr("hovercontrol.app.cockpit.server.TRY_AGAIN", 0.3)

    async def fly(client, folder):
        async with talking(client) as (talk, _):
            await talk.send_json({"record": True})
            await told(talk, lambda m: (m.get("recording") or 0) > 0.3)
            await talk.send_json({"record": False})
            said = (await told(talk, lambda m: "error" in m))["error"]
            assert "No space left on device" in said and "is kept, and tried again" in said
            assert list((folder / "flights").glob("*")) == []  # nothing half-written
            saved = await told(talk, lambda m: "saved" in m)
        assert saved["seconds"] > 0.3 and len(read_log(folder / "flights" / saved["saved"])) > 30

    asyncio.run(with_client(fly, tmp_path))


def test_a_recording_that_cannot_be_written_is_there_when_the_server_has_ended(tmp_path, monkeypatch):
    full_for(100, monkeypatch)
    consoles = []

    async def fly():
        console = Console(Pacer(shared()), tmp_path / "flights")
        consoles.append(console)
        async with TestClient(TestServer(console.application())) as client, talking(client) as (talk, _):
            await talk.send_json({"record": True})
            await told(talk, lambda m: (m.get("recording") or 0) > 0.2)

    asyncio.run(fly())
    (recording,) = consoles[0].unsaved
    assert recording.seconds > 0.2 and not (tmp_path / "flights").exists()


def test_the_server_ends_at_once_while_a_monitor_is_built(tmp_path, monkeypatch):
    """The craft flies on meanwhile."""
    end = threading.Event()
    monkeypatch.setattr("hovercontrol.app.cockpit.loops.elsewhere", lambda make, model: end.wait(60.0))

    async def fly(client, folder):
        async with talking(client) as (talk, _):
            await talk.send_json({"monitor": True})
            await told(talk, lambda m: "Building" in m.get("news", ""))
            begun = (await told(talk, lambda m: "frame" in m))["signals"]["time"]
            await told(talk, lambda m: m.get("signals", {}).get("time", 0.0) > begun + 0.3)

    begin = time.monotonic()
    asyncio.run(with_client(fly, tmp_path))
    assert time.monotonic() - begin < 30.0
    end.set()


def test_a_recording_that_still_runs_is_saved_when_the_server_ends(tmp_path):
    async def fly(client, folder):
        async with talking(client) as (talk, _):
            await talk.send_json({"record": True})
            await told(talk, lambda m: (m.get("recording") or 0) > 0.2)

    asyncio.run(with_client(fly, tmp_path))
    assert len(read_log(tmp_path / "flights" / "pilot-001.csv")) > 20


@served
async def test_a_log_sent_by_the_page_is_shown_or_refused_in_one_line(client, tmp_path):
    headers = {"Origin": origin(client)}
    log().save(tmp_path / "a.csv")
    pyarrow.parquet.write_table(pyarrow.csv.read_csv(tmp_path / "a.csv"), tmp_path / "a.parquet")
    for name in ("a.csv", "a.parquet"):
        body = (tmp_path / name).read_bytes()
        answer = await client.post(f"/upload?name={name}", data=body, headers=headers)
        assert (await answer.json())["columns"]["x"][-1] == pytest.approx(0.98)
    gaps = await client.post(
        "/upload?name=%00.csv", data=b"time,x,y,psi,a\n0,1,2,3,\n1,1,2,3,4\n", headers=headers
    )
    assert list((await gaps.json())["columns"]) == ["time", "x", "y", "psi"]
    for body, text in [
        (b"", "empty"),
        (b"\x00\xff\x00,\xfe", "binary"),
        (b"time,x,y\n0,1,2\n", "no column 'psi'"),
        (b"time,u,v,r\n0,1,2,0\n0.1,1,2,0\n", "expected the pose"),
        (b"time,x,y,psi\n0,1,2,3\n0,1,2,4\n", "time"),
    ]:
        answer = await client.post("/upload?name=/tmp/bad.csv", data=body, headers=headers)
        line = await answer.text()
        assert answer.status == 400 and text in line and line.startswith("bad.csv"), line
        assert "--columns" not in line  # no option of this command
        assert "\n" not in line


def test_a_long_log_is_thinned_for_the_page(tmp_path):
    log(rows=3 * MOST_ROWS).save(tmp_path / "long.csv")
    columns = log_columns(tmp_path / "long.csv")
    assert MOST_ROWS / 2 < len(columns["time"]) <= MOST_ROWS and {len(c) for c in columns.values()} == {
        len(columns["time"])
    }


def test_a_log_to_show_first_keeps_time_still(tmp_path):
    log().save(tmp_path / "a.csv")

    async def look(client, folder):
        async with talking(client) as (talk, first):
            assert first["replay"]
            assert (await told(talk, lambda m: "frame" in m))["paused"]
        assert (await (await client.get("/replay")).json())["name"] == "a.csv"

    asyncio.run(with_client(look, tmp_path, replay=tmp_path / "a.csv"))


@served
async def test_pages_of_other_sites_cannot_fly_or_send(client, tmp_path):
    for header in ({}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
        with pytest.raises(WSServerHandshakeError) as refused:
            await client.ws_connect("/ws", headers=header)
        assert refused.value.status == 403
        assert (await client.post("/upload", data=b"x", headers=header)).status == 403


@served
async def test_a_foreign_name_that_points_to_this_machine_is_refused(client, tmp_path):
    port = client.port
    for host, status in [("evil.example", 403), (f"evil.example:{port}", 403), (f"localhost:{port}", 200)]:
        assert (await client.get("/", headers={"Host": host})).status == status
    with pytest.raises(WSServerHandshakeError):
        foreign = {"Host": f"evil.example:{port}", "Origin": f"http://evil.example:{port}"}
        await client.ws_connect("/ws", headers=foreign)


def test_beyond_this_machine_the_token_is_needed_once(tmp_path):
    async def look(client, folder):
        for address in ("/", "/?token=", "/?token=wrong", "/page/main.js", "/logs", "/?token=%F0%9F%9A%A2"):
            assert (await client.get(address)).status == 403
        with pytest.raises(WSServerHandshakeError):
            await client.ws_connect("/ws", origin=origin(client))
        page = await client.get("/?token=secret")
        cookie = page.headers["Set-Cookie"]
        assert page.status == 200 and "HttpOnly" in cookie and "SameSite=Strict" in cookie
        held = {"Cookie": cookie.partition(";")[0]}
        assert (await client.get("/page/main.js", headers=held)).status == 200
        async with client.ws_connect("/ws", origin=origin(client), headers=held) as talk:
            assert "about" in await talk.receive_json()

    asyncio.run(with_client(look, tmp_path, token="secret"))


@pytest.mark.parametrize(
    ("host", "own"),
    [
        ("127.0.0.1", 1),
        ("127.1.2.3", 1),
        ("::1", 1),
        ("localhost", 1),
        ("0.0.0.0", 0),
        ("::", 0),
        ("evil", 0),
    ],
)
def test_addresses_of_this_machine_are_known(host, own):
    assert is_loopback(host) is bool(own)


def test_a_port_in_use_and_a_wrong_address_are_refused_in_one_line():
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(InputError, match="--port 0"):
        listen("127.0.0.1", taken.getsockname()[1])
    for host in ("no.such.host.invalid", "203.0.113.7"):
        with pytest.raises(InputError, match=f"cockpit: --host: '{host}' is not an address of this machine"):
            listen(host, 0)


def test_what_is_told_is_json_that_every_browser_reads(tmp_path):
    assert json.loads(json.dumps(Pacer(shared()).state, allow_nan=False))


# ---- hostile input -------------------------------------------------------------------------------------


@served
async def test_nonsense_is_refused_in_one_line_and_the_connection_stays(client, tmp_path):
    async with client.ws_connect("/ws", headers={"Origin": origin(client)}) as talk:
        for text in (
            '{"stick": [' + "9" * 400 + ", 0]}",
            '{"stick": ' + "9" * 5000 + "}",
            "[" * 30_000,
            '{"a":' * 9_000,
            '{"command": {"references": {"surge_ref": ' + "9" * 400 + "}}}",
            '{"' + "x" * 9_000 + '": 1}',
        ):
            await talk.send_str(text)
            while "error" not in (answer := await talk.receive_json(timeout=10)):
                pass
            assert "\n" not in answer["error"] and len(answer["error"]) <= 300
        assert not talk.closed


@served
async def test_a_link_among_the_recordings_is_not_served(client, tmp_path):
    folder = tmp_path / "flights"
    folder.mkdir()
    (tmp_path / "secret.csv").write_text("time,x,y,psi\n0,0,0,0\n")
    (folder / "link.csv").symlink_to(tmp_path / "secret.csv")
    (folder / "own.csv").write_text("time,x,y,psi\n0,0,0,0\n")
    assert await (await client.get("/logs")).json() == ["own.csv"]
    assert (await client.get("/logs/link.csv")).status == 404
    assert (await client.get("/logs/own.csv")).status == 200


@pytest.mark.skipif(os.name == "nt", reason="links are for administrators there")
@pytest.mark.parametrize("what", ["", "/columns"])
def test_a_link_that_is_swapped_in_during_a_download_is_not_served(tmp_path, what):
    """A log and a link to a secret change places all the while: what is served is the log, or nothing."""
    (tmp_path / "secret.csv").write_text("time,x,y,psi,secret\n0,1,2,3,42.4242\n1,1,2,3,42.4242\n")
    flights = tmp_path / "flights"
    flights.mkdir()
    own = "time,x,y,psi\n0,1,2,3\n1,1,2,3\n"
    (flights / "a.csv").write_text(own)
    (flights / "link").symlink_to(tmp_path / "secret.csv")
    end = threading.Event()

    def swap():
        while not end.is_set():
            _swap(os.fsencode(flights / "link"), os.fsencode(flights / "a.csv"))

    async def ask(client, folder):
        answers = []
        until = asyncio.get_running_loop().time() + 1.0
        while asyncio.get_running_loop().time() < until:
            answer = await client.get(f"/logs/a.csv{what}")
            answers.append((answer.status, await answer.text()))
        assert not [text for _, text in answers if "secret" in text or "42.4242" in text]
        assert {status for status, _ in answers} == {200, 404}
        assert what or {text for status, text in answers if status == 200} == {own}

    swapping = threading.Thread(target=swap)
    swapping.start()
    try:
        asyncio.run(with_client(ask, tmp_path))
    finally:
        end.set()
        swapping.join()


def test_only_files_of_the_folder_itself_are_opened(tmp_path):
    (tmp_path / "secret.csv").write_text("x")
    folder = tmp_path / "flights"
    (folder / "sub.csv").mkdir(parents=True)
    (folder / "own.csv").write_text("y")
    (folder / "link.csv").symlink_to(tmp_path / "secret.csv")
    (folder / "up").symlink_to(tmp_path)
    os.mkfifo(folder / "pipe.csv")
    for name in ("link.csv", "sub.csv", "pipe.csv", "../secret.csv", "up/secret.csv", "none.csv"):
        with pytest.raises(OSError):
            open_log(folder, name)
    with open_log(folder, "own.csv") as file:
        assert file.read() == b"y"


@served
async def test_an_unclosed_quote_in_an_upload_is_one_line(client, tmp_path):
    body = 'time,x,y,psi\n0,0,0,0\n0.1,0,0,"' + "1\n" * 100_000
    answer = await client.post("/upload?name=a.csv", data=body, headers={"Origin": origin(client)})
    said = await answer.text()
    assert answer.status == 400 and said.startswith("a.csv: ") and said.strip().count("\n") == 0


@pytest.mark.parametrize("header", [b"Cookie: hovercontrol_token=\xff\xfe", b"X: " + b"y" * 200_000])
def test_a_strange_header_is_answered_and_nothing_is_printed(tmp_path, header, capfd):
    async def test():
        async with client_of(tmp_path, token="right") as client:
            reader, writer = await asyncio.open_connection("127.0.0.1", client.port)
            writer.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + header + b"\r\n\r\n")
            answer = await asyncio.wait_for(reader.readline(), 10)
            writer.close()
            assert answer.split()[1] in (b"400", b"403")
            assert (await client.get("/?token=right")).status == 200

    asyncio.run(test())
    assert capfd.readouterr() == ("", "")


def test_rows_without_a_pose_are_not_drawn(tmp_path):
    (tmp_path / "a.csv").write_text("time,x,y,psi\n0,1,0,0\n1,,,\n2,3,0,0\n")
    assert log_columns(tmp_path / "a.csv")["x"] == [1.0, 3.0]
