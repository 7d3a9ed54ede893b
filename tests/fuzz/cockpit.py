"""Messages to a cockpit and requests to its server, in whatever form."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import socket
import tempfile
import threading
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from aiohttp import web

from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.pacer import Pacer
from hovercontrol.app.cockpit.server import Console, runner
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.samples import sample_path
from tests.fuzz import mutate
from tests.fuzz.judge import LINE, Broken


class Talk:
    """A websocket that keeps what it is told."""

    def __init__(self) -> None:
        self.said: list[Any] = []

    async def send_json(self, content: Any) -> None:
        self.said.append(content)


@cache
def console() -> Console:
    return Console(Pacer(Loop(vehicle("hoverdemon"))), Path(tempfile.mkdtemp(prefix="hc-fuzz-flights-")))


def message(rng: Random, folder: Path) -> int:
    """Let a page say something; a page that says nonsense is told so in one line, and the craft flies on."""
    page = console()
    page.pilot = talk = Talk()  # type: ignore[assignment]
    sound = {
        "stick": [0.5, -0.5],
        "command": {
            "law": "manual",
            "references": {"surge_ref": 0.5},
            "disturbances": {"wind": {"speed": 1.0}, "slope": None},
        },
        "pause": True,
        "record": False,
        "reset": True,
        "take": True,
    }
    chosen = {key: sound[key] for key in rng.sample(list(sound), rng.randrange(1, 4))}
    text = mutate.text(rng, json.dumps(chosen), _WORDS)
    if rng.random() < 0.1:
        text = rng.choice(
            (
                "[" * 30_000,
                '{"stick": [' + "9" * 400 + ", 0]}",
                '{"stick": ' + "9" * 5000 + "}",
                '{"a":' * 5000,
            )
        )
    asyncio.run(page._hear(talk, text))  # type: ignore[arg-type]
    for answer in talk.said:
        error = answer.get("error", "")
        if "\n" in error or len(error) > LINE:
            raise Broken(f"not one line: {error[:300]!r}")
    if not all(abs(value) <= 1.0 for value in page.pacer.loop.stick):
        raise Broken(f"stick {page.pacer.loop.stick}")
    return 2 if talk.said else 0


_WORDS = [
    "NaN",
    "-Infinity",
    "1e999",
    "9" * 400,
    "null",
    "[]",
    "{}",
    '"x"',
    "true",
    "-1",
    "[[[",
    '"\\ud800"',
    '""',
    "0",
    "\\",
]


class _Noise(logging.Handler):
    """What a server would print at its user."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if not record.name.startswith("pint"):  # it keeps its remarks to itself: a handler that drops them
            self.records.append(self.format(record))


@cache
def served() -> tuple[int, _Noise]:
    """Return the port of a server, and what it logs."""
    noise, ready, port = _Noise(), threading.Event(), []

    async def serve() -> None:
        page = Console(Pacer(Loop(vehicle("hoverdemon"))), Path(tempfile.mkdtemp(prefix="hc-fuzz-flights-")))
        running = runner(page, "")
        await running.setup()
        listening = socket.create_server(("127.0.0.1", 0))
        port.append(listening.getsockname()[1])
        await web.SockSite(running, listening).start()
        ready.set()
        await asyncio.Event().wait()

    logging.getLogger().addHandler(noise)
    threading.Thread(target=lambda: asyncio.run(serve()), daemon=True).start()
    ready.wait(20)
    return port[0], noise


def request(rng: Random, folder: Path) -> int:
    """Send a request as bytes; whatever it is, no traceback, no status 500, and the next one is answered."""
    port, noise = served()
    host = f"127.0.0.1:{port}"
    body = sample_path().read_bytes()[: rng.choice((0, 50, 3000))]
    lines = [
        rng.choice(
            [
                "GET / HTTP/1.1",
                "GET /logs HTTP/1.1",
                "GET /page/main.js HTTP/1.1",
                "POST /upload?name=a.csv HTTP/1.1",
            ]
        ),
        f"Host: {host}",
        f"Origin: http://{host}",
        f"Content-Length: {len(body)}",
        rng.choice(
            ["Cookie: hovercontrol_token=x", "Cookie: \x80\xff", "X: " + "y" * 200_000, "Accept: */*"]
        ),
    ]
    raw = "\r\n".join(lines).encode("latin-1") + b"\r\n\r\n" + body
    if rng.random() < 0.5:
        raw = mutate.data(rng, raw)
    answer = _asked(port, raw)
    if noise.records:
        said, noise.records = noise.records, []
        raise Broken(f"the server printed: {said[0][:1500]}")
    if answer.startswith(b"HTTP/1.1 500"):
        raise Broken(answer[:300].decode(errors="replace"))
    if not _asked(
        port, f"GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode(), 5.0
    ).startswith(b"HTTP/1.1 200"):
        raise Broken("the server does not answer any more")
    return 0 if answer.startswith(b"HTTP/1.1 2") else 2


def _asked(port: int, raw: bytes, patience: float = 0.05) -> bytes:
    """Return the begin of an answer; empty where the server waits for more, or closes."""
    with socket.create_connection(("127.0.0.1", port), timeout=5) as line, contextlib.suppress(OSError):
        line.sendall(raw)
        line.settimeout(patience)
        return line.recv(65536)
    return b""
