"""The server of the page: the page, frames and commands over a websocket, logs to replay."""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import os
import signal
import socket
from collections.abc import Callable
from contextlib import suppress
from importlib import resources
from pathlib import Path
from typing import Any

from aiohttp import WSMsgType, web

from hovercontrol.app.cockpit.guard import guard
from hovercontrol.app.cockpit.loop_description import loop_description
from hovercontrol.app.cockpit.loops import LOOPS, Loops
from hovercontrol.app.cockpit.messages import check_message
from hovercontrol.app.cockpit.pacer import Pacer
from hovercontrol.app.cockpit.recorder import NOTHING, Recorder
from hovercontrol.app.cockpit.shelf import Shelf
from hovercontrol.base.errors import InputError, check_known, one_line, shown

#: Time after which a recording that could not be written is tried again [s].
TRY_AGAIN = 10.0

#: Largest log that the page may send [bytes].
LARGEST_UPLOAD = 64 * 2**20

_SILENT = logging.getLogger(f"{__name__}.requests")
_SILENT.addHandler(logging.NullHandler())
_SILENT.propagate = False

_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


class Console:
    """The server's state: the pilot's page, the other pages, the folder of logs.

    Parameters
    ----------
    folder : Path
        Folder of recordings.
    replay : Path, optional
        A log for replay, shown first.

    Attributes
    ----------
    saved : list of str
        Names of the saved recordings.
    unsaved : list of Recorder
        Finished recordings that could not be written yet.
    """

    def __init__(self, pacer: Pacer, folder: Path, replay: Path | None = None) -> None:
        self.pacer, self.shelf, self.loops = pacer, Shelf(folder, replay), Loops(pacer)
        self.watchers: dict[web.WebSocketResponse, asyncio.Event] = {}
        self.pilot: web.WebSocketResponse | None = None
        self.saved: list[str] = []
        self.unsaved: list[Recorder] = []
        self._saving = asyncio.Lock()
        self._next_try = 0.0
        folder_of_page = resources.files("hovercontrol.app.cockpit") / "page"
        self._files = {
            file.name: file for file in folder_of_page.iterdir() if Path(file.name).suffix in _TYPES
        }
        self._flown = False
        self._switching: asyncio.Task[None] | None = None

    def application(self, token: str = "") -> web.Application:
        """Return the web application; see :func:`.guard.guard` for the token."""
        app = web.Application(middlewares=[guard(token)], client_max_size=LARGEST_UPLOAD)
        app.add_routes(
            [
                web.get("/", self._page),
                web.get("/page/{name}", self._page),
                web.get("/ws", self._talk),
                *self.shelf.routes(),
            ]
        )
        app.cleanup_ctx.append(self._running)
        return app

    async def _running(self, app: web.Application) -> Any:
        loop = asyncio.get_running_loop()

        def tell() -> None:
            with suppress(RuntimeError):  # the loop of events has ended
                loop.call_soon_threadsafe(self._wake)

        self.pacer.listeners.append(tell)
        self.pacer.start()
        yield
        await asyncio.to_thread(self.pacer.stop)
        self.pacer.listeners.remove(tell)
        self.pacer.record(False)
        await self._save_finished(last=True)
        for socket_ in list(self.watchers):
            await socket_.close(code=1001, message=b"the server has ended")

    def _wake(self) -> None:
        for event in self.watchers.values():
            event.set()

    # ---- the page ------------------------------------------------------------------------------------

    async def _page(self, request: web.Request) -> web.Response:
        name = request.match_info.get("name", "index.html")
        if name not in self._files:  # the page's own files, whatever path a name leads to
            raise web.HTTPNotFound(text=f"404: there is no {shown(name)}\n")
        kind = _TYPES[Path(name).suffix]
        return web.Response(body=self._files[name].read_bytes(), content_type=kind, charset="utf-8")

    # ---- frames and orders ---------------------------------------------------------------------------

    async def _talk(self, request: web.Request) -> web.WebSocketResponse:
        talk = web.WebSocketResponse(heartbeat=10.0, max_msg_size=64 * 1024, compress=False)
        await talk.prepare(request)
        self.watchers[talk] = asyncio.Event()
        if self.pilot is None:
            self._give(talk)
        frames = asyncio.create_task(self._send_frames(talk))
        try:
            await talk.send_json(self._about())
            async for message in talk:
                if message.type is WSMsgType.TEXT:
                    await self._hear(talk, message.data)
        finally:
            frames.cancel()
            del self.watchers[talk]
            if self.pilot is talk:
                self.pilot = None
                self.pacer.left()
        return talk

    def _about(self) -> dict[str, Any]:
        return {"about": loop_description(self.pacer.loop), "replay": self.shelf.replay is not None}

    async def _send_frames(self, talk: web.WebSocketResponse) -> None:
        sent, event = -1, self.watchers[talk]
        with suppress(ConnectionError):
            while not talk.closed:
                await event.wait()
                event.clear()
                await self._save_finished()
                state = self.pacer.state
                if state["frame"] != sent:
                    sent = state["frame"]
                    await talk.send_str(_json({**state, "pilot": self.pilot is talk}))

    async def _hear(self, talk: web.WebSocketResponse, text: str) -> None:
        try:
            message = json.loads(text, parse_constant=_refuse)
            if not isinstance(message, dict):
                raise InputError("expected an object")
            await self._obey(talk, message)
        except RecursionError:
            await talk.send_json({"error": "expected an object, found lists within lists without end"})
        except ValueError as error:  # wrong input, no JSON, a number of too many digits
            await talk.send_json({"error": one_line(error, 300)})

    async def _obey(self, talk: web.WebSocketResponse, message: dict[str, Any]) -> None:
        if message.get("take") and self.pilot is not talk:
            self._give(talk)
        if self.pilot is not talk:
            if message.keys() - {"stick", "take"}:
                raise InputError("another page controls this craft: take control first")
            return
        check_message(message)
        stick = tuple(message.get("stick", ()))
        if "loop" in message:
            self._switch(talk, message["loop"])
        if "monitor" in message:
            self._monitor(talk, message["monitor"])
        if "command" in message:
            self.pacer.command(**message["command"], **({"stick": stick} if stick else {}))
        elif stick:
            self.pacer.heard(stick)
        if "pause" in message:
            self.pacer.pause(message["pause"])
        if message.get("reset"):
            self.pacer.reset()
        if "record" in message:
            self.pacer.record(message["record"])
            await self._save_finished()

    def _switch(self, talk: web.WebSocketResponse, kind: str) -> None:
        """Switch to another loop as soon as it is built, and update all pages."""
        check_known(kind, LOOPS, f"unknown loop {shown(kind)}")
        if self.loops.building:
            raise InputError("another loop is being built: wait for it")
        if kind != self.pacer.loop.kind:
            self._switching = asyncio.create_task(self._fly(talk, kind))

    async def _fly(self, talk: web.WebSocketResponse, kind: str) -> None:
        paused = self.pacer.state["paused"]
        try:
            self.pacer.pause(True)
            news = f"Building the {kind} loop: a few seconds, a minute the first time."
            await talk.send_json({"news": news, "wait": True})
            await self.loops.fly(kind)
            await self._tell_all(self._about())
            await self._tell_all({"news": f"The {kind} loop runs, from its start."})
        except (InputError, RuntimeError) as error:
            await self._tell_all({"error": one_line(error, 300)})
        finally:
            self.pacer.pause(paused)
            await self._save_finished()

    def _monitor(self, talk: web.WebSocketResponse, on: bool) -> None:
        """Let the monitor watch as soon as it is built, or end it."""
        if not on:
            self.pacer.monitor(None)
            return
        if self.pacer.loop.kind != "ideal":
            raise InputError("the monitor knows the ideal loop only: switch to it first")
        if self.loops.building:
            raise InputError("another loop or monitor is being built: wait for it")
        self._switching = asyncio.create_task(self._watch(talk))

    async def _watch(self, talk: web.WebSocketResponse) -> None:
        try:
            news = "Building the monitor: half a minute, more the first time. The craft flies on."
            await talk.send_json({"news": news, "wait": True})
            await self.loops.watch()
            await self._tell_all({"news": "The monitor watches."})
        except (InputError, RuntimeError) as error:
            await self._tell_all({"error": one_line(error, 300)})

    async def _tell_all(self, news: dict[str, Any]) -> None:
        for talk in list(self.watchers):
            with suppress(ConnectionError):
                await talk.send_json(news)

    def _give(self, talk: web.WebSocketResponse) -> None:
        """Make this page the pilot's; the first one starts time."""
        self.pilot = talk
        self.pacer.heard((0.0, 0.0))
        if not self._flown:
            self._flown = True
            self.pacer.pause(self.shelf.replay is not None)

    async def _save_finished(self, *, last: bool = False) -> None:
        """Save the finished recordings; one that cannot be written is kept, and tried again later."""
        async with self._saving:
            now, finished = asyncio.get_running_loop().time(), self.pacer.finished()
            self.unsaved += [recording for recording in finished if not recording.empty]
            if any(recording.empty for recording in finished):
                await self._tell_all({"error": NOTHING})
            if not (finished or last) and now < self._next_try:
                return
            for recording in list(self.unsaved):
                try:
                    name = (await asyncio.to_thread(recording.save, self.shelf.folder)).name
                except InputError as error:
                    self._next_try = now + TRY_AGAIN
                    kept = f"the recording of {recording.seconds:.1f} s is kept, and tried again"
                    await self._tell_all({"error": f"{error}; {kept}"})
                    return
                self.unsaved.remove(recording)
                self.saved.append(name)
                await self._tell_all({"seconds": recording.seconds, "saved": name})


def _json(content: Any) -> str:
    return json.dumps(content, allow_nan=False, separators=(",", ":"))


def _refuse(text: str) -> None:
    raise InputError(f"expected a number, found {text}")


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises
    ------
    InputError
        If the port is in use or not allowed, or there is no such address.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family, backlog=16)
    except PermissionError:
        raise InputError(f"cockpit: port {port} is not allowed: choose one above 1023, or --port 0") from None
    except OSError as error:
        if isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
            line = f"--host: {host!r} is not an address of this machine"
        elif error.errno == errno.EADDRINUSE:
            line = f"port {port} is in use: choose another, or --port 0 for any"
        else:
            line = f"cannot listen at {host}, port {port}: {os.strerror(error.errno or 0)}"
        raise InputError(f"cockpit: {line}") from None


def runner(console: Console, token: str) -> web.AppRunner:
    """Return the runner of a console's server; invalid requests print nothing on the terminal."""
    return web.AppRunner(console.application(token), access_log=None, shutdown_timeout=1.0, logger=_SILENT)


async def serve(console: Console, listening: socket.socket, token: str, ready: Callable[[], object]) -> None:
    """Serve until an interrupt; `ready` is called when the page can be opened."""
    running = runner(console, token)
    end = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError):  # Windows: an interrupt is an exception there
            asyncio.get_running_loop().add_signal_handler(number, end.set)
    await running.setup()
    try:
        await web.SockSite(running, listening).start()
        ready()
        await end.wait()
    finally:
        await running.cleanup()
