"""``hovercontrol new``: write a model file to begin with."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from hovercontrol.app.commands import names
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder, write_atomically

EXAMPLE = "Example: hovercontrol new craft.toml --kind fan"


def new(
    file: Annotated[Path, typer.Argument(help="File to write: .toml, or .py with --kind block.")],
    kind: Annotated[
        str,
        typer.Option(
            "--kind",
            help="Kind of model: rudder (propeller and rudder), fan (fixed fans) or block (own Block).",
            autocompletion=names.of("rudder", "fan", "block"),
        ),
    ] = "",
) -> int:
    """Write a commented model file to start from; it can be simulated and diagnosed as it is."""
    from hovercontrol.craft.models.template import template

    chosen = kind or ("block" if file.suffix == ".py" else "rudder")
    wanted = ".py" if chosen == "block" else ".toml"
    name = re.sub(r"\W", "_", file.stem)
    text = template(chosen, name, file.name)
    if file.suffix != wanted:
        raise InputError(f"new: a file of kind {chosen} ends in {wanted}, found {file.name!r}")
    if file.exists():
        raise InputError(f"new: {file} exists; expected the name of a new file")
    check_folder(file.parent)
    write_atomically(file, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    print(f"wrote {file}: its comments say what to change and how to use it")
    return 0
