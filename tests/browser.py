"""A headless Chromium, driven over its DevTools protocol."""

import asyncio
import base64
import json
import os
import shutil
import subprocess
import tempfile
from contextlib import asynccontextmanager
from pathlib import Path

import aiohttp

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

KEYS = {"ArrowUp": 38, "ArrowLeft": 37, "ArrowRight": 39, "ArrowDown": 40}


class Page:
    """One page of the browser."""

    def __init__(self, socket):
        self._socket = socket
        self._next = 0
        self._answers = {}
        self.complaints = []  # of the page's console
        self.fetched = []  # addresses
        self._reader = asyncio.create_task(self._read())

    async def _read(self):
        async for message in self._socket:
            content = json.loads(message.data)
            if "id" in content:
                self._answers.pop(content["id"]).set_result(content)
            elif content["method"] in (
                "Runtime.exceptionThrown",
                "Runtime.consoleAPICalled",
                "Log.entryAdded",
            ):
                self.complaints.append(content["params"])
            elif content["method"] == "Network.requestWillBeSent":
                self.fetched.append(content["params"]["request"]["url"])

    async def call(self, method, **params):
        self._next += 1
        answer = self._answers[self._next] = asyncio.get_running_loop().create_future()
        await self._socket.send_json({"id": self._next, "method": method, "params": params})
        content = await asyncio.wait_for(answer, 30)
        assert "error" not in content, (method, content)
        return content["result"]

    async def value(self, script):
        """Return the value of an expression; promises are awaited."""
        told = await self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in told, told
        return told["result"].get("value")

    async def until(self, script, seconds=20.0):
        """Wait until an expression is true, and return its value."""
        for _ in range(int(seconds / 0.05)):
            value = await self.value(script)
            if value:
                return value
            await asyncio.sleep(0.05)
        raise AssertionError(f"not true within {seconds:g} s: {script}")

    async def open(self, address, width=1280, height=900, dark=False, ready="true"):
        """Open an address and wait until the page is there and `ready` is true."""
        for domain in ("Page", "Runtime", "Log", "Network"):
            await self.call(f"{domain}.enable")
        await self.scheme(dark)
        await self.size(width, height)
        await self.call("Page.navigate", url=address)
        there = f"location.href === {json.dumps(address)} && document.readyState === 'complete'"
        await self.until(f"{there} && ({ready})")

    async def scheme(self, dark):
        wanted = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        await self.call("Emulation.setEmulatedMedia", features=[wanted])

    async def size(self, width, height):
        await self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )

    async def key(self, code, down):
        kind = "keyDown" if down else "keyUp"
        await self.call(
            "Input.dispatchKeyEvent", type=kind, code=code, key=code, windowsVirtualKeyCode=KEYS[code]
        )

    async def picture(self, path, whole=False):
        told = await self.call("Page.captureScreenshot", captureBeyondViewport=whole)
        Path(path).write_bytes(base64.b64decode(told["data"]))


@asynccontextmanager
async def browser():
    """Yield a new page; the browser ends with it."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        flags = ["--headless=new", "--remote-debugging-port=0", f"--user-data-dir={folder}", "--disable-gpu"]
        flags += ["--no-first-run", "--disable-dev-shm-usage"]
        flags += ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
        own = subprocess.Popen([CHROMIUM, *flags], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            port = Path(folder) / "DevToolsActivePort"
            for _ in range(400):
                if port.is_file() and "\n" in port.read_text():
                    break
                await asyncio.sleep(0.05)
            address = f"http://127.0.0.1:{port.read_text().split()[0]}"
            async with aiohttp.ClientSession() as session:
                async with session.put(f"{address}/json/new?about:blank") as answer:
                    target = await answer.json()
                async with session.ws_connect(target["webSocketDebuggerUrl"], max_msg_size=0) as socket:
                    yield Page(socket)
        finally:
            own.terminate()
            own.wait(10)
