"""``--show-completion SHELL`` and ``--install-completion SHELL``.

Typer's own options take the shell from the parents of the process and ignore the one that is named
(``add_completion=False`` leaves them out); its scripts and its installation are used here.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer
from typer._completion_classes import completion_init
from typer.completion import install_callback, show_callback


class Shell(StrEnum):
    """The shells that can complete commands."""

    BASH = "bash"
    ZSH = "zsh"
    FISH = "fish"
    POWERSHELL = "powershell"
    PWSH = "pwsh"


Install = Annotated[
    Shell | None,
    typer.Option(
        "--install-completion",
        metavar="SHELL",
        callback=install_callback,
        help=f"Let Tab complete commands, options and names in a shell: {', '.join(Shell)}.",
    ),
]
Show = Annotated[
    Shell | None,
    typer.Option(
        "--show-completion",
        metavar="SHELL",
        callback=show_callback,
        help="Print the script that --install-completion installs.",
    ),
]

completion_init()
