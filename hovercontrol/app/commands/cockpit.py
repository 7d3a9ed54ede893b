"""``hovercontrol cockpit``: drive a craft from the browser."""

from __future__ import annotations

import secrets
import sys
import tempfile
import threading
import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder

EXAMPLE = "Example: hovercontrol cockpit --vehicle hoverdemon --out flights"


def cockpit(
    model: Annotated[
        str | None,
        typer.Option("--model", help="Model file (TOML) of a craft, or FILE.py:NAME of a Model."),
    ] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            help="A built-in craft instead of a model file (default: hoverdemon).",
            autocompletion=names.vehicles,
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for recordings, created if missing.")
    ] = Path("out/cockpit"),
    replay: Annotated[
        Path | None, typer.Option("--replay", help="Log (CSV or Parquet) to replay first.")
    ] = None,
    loop: Annotated[
        str, typer.Option("--loop", help="Loop: ideal, or real (with link, navigation and actuators).")
    ] = "ideal",
    port: Annotated[int, typer.Option(help="Port of the page; 0 for any free one.", min=0, max=65535)] = 8321,
    host: Annotated[
        str, typer.Option(help="Address of the server; from other machines the page needs a token.")
    ] = "127.0.0.1",
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
) -> int:
    """Fly a craft from a page in the browser, in real time: by hand or under one of K06's laws.

    The stick is the keyboard (arrows or WASD), a pad for mouse and touch, or a gamepad.

    K06's laws (stop, forward, reverse, turn, heading, goal) need a craft whose thrust is in newton.

    The real loop runs through K06's ground station: radio link, navigation, actuators.

    Wind, slopes and friction can be switched on. Recordings are logs for identify and diagnose.

    Commands go to zero when the page is closed or silent for 0.4 s. Ctrl-C ends the server.
    """
    try:
        from hovercontrol.app.cockpit.guard import is_loopback
        from hovercontrol.app.cockpit.server import Console, listen, serve
        from hovercontrol.app.cockpit.shelf import log_columns
    except ModuleNotFoundError as error:
        if error.name != "aiohttp":
            raise
        raise InputError("cockpit: needs aiohttp: pip install '.[cockpit]'") from None
    import asyncio

    from hovercontrol.app.cockpit.loops import loop_of
    from hovercontrol.app.cockpit.pacer import Pacer
    from hovercontrol.app.cockpit.real_loop import flies_real

    check_folder(out)
    if replay is not None:
        log_columns(replay)
    craft = options.craft("cockpit", model, vehicle or (None if model else "hoverdemon"))
    listening = listen(host, port)
    try:
        if loop == "real" and flies_real(craft):
            print("building the real loop: a few seconds, a minute the first time", file=sys.stderr)
        flown = loop_of(loop, craft)
    except InputError:
        listening.close()
        raise
    token = "" if is_loopback(host) else secrets.token_urlsafe(16)
    address = f"http://{_written(host)}:{listening.getsockname()[1]}/" + (f"?token={token}" if token else "")

    def ready() -> None:
        print(f"{flown.model.name}: {address}  (Ctrl-C ends)", flush=True)
        if open_:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    console = Console(Pacer(flown), out, replay)
    with suppress(KeyboardInterrupt):  # where signals are exceptions
        asyncio.run(serve(console, listening, token, ready))
    if console.unsaved:
        kept = Path(tempfile.mkdtemp(prefix="hovercontrol-flights-"))
        names = [recording.save(kept).name for recording in console.unsaved]
        raise InputError(f"cockpit: {out} cannot be written: {', '.join(names)} is in {kept}")
    wrote = f"wrote {', '.join(console.saved)} to {out}" if console.saved else "nothing was recorded"
    print(f"ended; {wrote}")
    return 0


def _written(host: str) -> str:
    """Return a host as an address has it; all interfaces are reached by this machine's name."""
    if host in ("0.0.0.0", "::"):
        import socket

        return socket.gethostname()
    return f"[{host}]" if ":" in host else host
