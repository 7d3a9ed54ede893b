"""Logs for replay: recordings in a folder, a log given at the start, or an uploaded one."""

from __future__ import annotations

import asyncio
import math
import mimetypes
import os
import re
import shutil
import stat
import tempfile
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote

import numpy as np
from aiohttp import web

from hovercontrol.app.cockpit.recorder import names_in
from hovercontrol.base.errors import InputError
from hovercontrol.logs import POSE, read_log
from hovercontrol.logs.log import PARQUET

#: Most rows of a log that the page is given.
MOST_ROWS = 20_000


class Shelf:
    """The logs for replay.

    Parameters
    ----------
    folder : Path
        Folder of recordings.
    replay : Path, optional
        A log for replay, shown first.
    """

    def __init__(self, folder: Path, replay: Path | None = None) -> None:
        self.folder, self.replay = folder, replay

    def routes(self) -> list[web.RouteDef]:
        """Return the routes of the server."""
        return [
            web.get("/logs", self._logs),
            web.get("/logs/{name}", self._download),
            web.get("/logs/{name}/columns", self._columns),
            web.get("/replay", self._replay),
            web.post("/upload", self._upload),
        ]

    async def _logs(self, request: web.Request) -> web.Response:
        return web.json_response(names_in(self.folder))

    def _opened(self, request: web.Request) -> BinaryIO:
        """Open the requested log; later changes of its name do not change the file that is read."""
        name = request.match_info["name"]
        try:
            if name not in names_in(self.folder):  # no path leads out of the folder
                raise FileNotFoundError
            return open_log(self.folder, name)
        except OSError:
            raise web.HTTPNotFound(text=f"there is no log {name!r} in {self.folder}\n") from None

    async def _download(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        return web.Response(
            body=self._opened(request),  # sent piece by piece, then closed
            content_type=mimetypes.guess_type(name)[0] or "application/octet-stream",
            headers={"Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}"},
        )

    async def _columns(self, request: web.Request) -> web.Response:
        name = request.match_info["name"]
        with self._opened(request) as log, tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / f"log{Path(name).suffix.lower()}"
            with copy.open("wb") as file:
                await asyncio.to_thread(shutil.copyfileobj, log, file)
            return await self._shown(copy, name)

    async def _replay(self, request: web.Request) -> web.Response:
        if self.replay is None:
            raise web.HTTPNotFound(text="no log was given with --replay\n")
        return await self._shown(self.replay)

    async def _upload(self, request: web.Request) -> web.Response:
        name = Path(request.query.get("name", "log.csv")).name
        body = await request.read()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / ("log.parquet" if name.lower().endswith(PARQUET) else "log.csv")
            await asyncio.to_thread(path.write_bytes, body)
            return await self._shown(path, name)

    async def _shown(self, path: Path, name: str = "") -> web.Response:
        try:
            columns = await asyncio.to_thread(log_columns, path)
        except InputError as error:
            text = re.sub(r" \(--columns [^)]*\)", "", str(error))  # an option of other commands
            raise web.HTTPBadRequest(text=text.replace(str(path), name or path.name)) from None
        return web.json_response({"name": name or path.name, "columns": columns})


def open_log(folder: Path, name: str) -> BinaryIO:
    """Open a regular file of a folder, and only of this folder, for reading.

    A name may become a link between its check and its opening. So the name is opened relative to the open
    folder, links are not followed, and the open file is checked.

    Raises
    ------
    OSError
        If the name is missing, or is a link, a folder or a pipe.
    """
    flags = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
    if os.open not in os.supports_dir_fd:  # Windows: links are for administrators there
        file = os.open(folder / name, flags)
    else:
        place = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            file = os.open(name, flags | os.O_NOFOLLOW, dir_fd=place)
        finally:
            os.close(place)
    if os.sep in name or not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise FileNotFoundError(name)
    return os.fdopen(file, "rb")


def log_columns(path: str | Path) -> dict[str, list[float]]:
    """Return the columns of a log for the page; a long log is thinned.

    Rows without a pose are left out, then columns with missing numbers.

    Raises
    ------
    InputError
        If it is not a log, or has no pose.
    """
    try:
        log = read_log(path, motion=True)
    except InputError as error:  # its advice to rename columns is for other commands
        raise InputError(str(error).partition(" (a column of another name")[0]) from None
    if not log.has(*POSE):
        raise InputError(f"{path}: expected the pose x, y, psi to draw; this log has only velocities")
    log = log.select(np.flatnonzero(np.isfinite(log.stack(*POSE)).all(axis=1)))
    every = max(1, math.ceil(len(log) / MOST_ROWS))
    rest = (name for name in log.columns if name not in POSE and np.isfinite(log[name]).all())
    return {name: log[name][::every].tolist() for name in ("time", *POSE, *rest)}
