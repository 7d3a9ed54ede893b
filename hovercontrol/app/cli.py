"""The command line; :mod:`hovercontrol.base.endings` has the exit statuses.

Only what handles signals is imported before Ctrl-C is handled.
"""

from __future__ import annotations

import os
import signal
import sys


def main() -> None:
    """Run the command line; the entry point of the ``hovercontrol`` command."""
    alone = sys.modules["__main__"].__dict__.get("main") is main  # a process of its own, nothing is done yet
    if alone:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, _leave)
    from hovercontrol.base import endings

    status = endings.run(_command)
    if alone:
        endings.leave(status)
    sys.exit(status)


def _leave(number: int, frame: object) -> None:
    os.write(2, b"hovercontrol: stopped; nothing was written\n")
    os._exit(128 + number)


def _command() -> object:
    import typer

    from hovercontrol.app.commands.app import app
    from hovercontrol.base import endings
    from hovercontrol.base.matplotlib_folder import set_matplotlib_folder

    set_matplotlib_folder()
    try:
        return app(prog_name="hovercontrol", standalone_mode=False)
    except typer.TyperException as error:
        return endings.refuse(error.format_message())
    except typer.Abort:
        raise KeyboardInterrupt from None


if __name__ == "__main__":
    main()
