"""``hovercontrol new``: write a model file to begin with."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from hovercontrol.app.commands import names
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder, write_atomically
from hovercontrol.base.tables import positive

EXAMPLE = "Example: hovercontrol new craft.toml --kind fan"


def new(
    file: Annotated[
        Path | None,
        typer.Argument(help="File to write: .toml, or .py with --kind block. Without it, three questions."),
    ] = None,
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

    mass = None
    if file is None:
        kind, file, mass = _asked(kind)
    chosen = kind or ("block" if file.suffix == ".py" else "rudder")
    wanted = ".py" if chosen == "block" else ".toml"
    name = re.sub(r"\W", "_", file.stem)
    text = template(chosen, name, file.name, mass)
    if file.suffix != wanted:
        raise InputError(f"new: a file of kind {chosen} ends in {wanted}, found {file.name!r}")
    if file.exists():
        raise InputError(f"new: {file} exists; expected the name of a new file")
    check_folder(file.parent)
    write_atomically(file, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    print(f"wrote {file}: its comments say what to change and how to use it")
    return 0


def _asked(kind: str) -> tuple[str, Path, float | None]:
    """Return kind, file and mass, asked for in a terminal."""
    if not sys.stdin.isatty():
        raise InputError("new: expected the name of a file to write: hovercontrol new craft.toml")
    kind = kind or _answer(
        "Kind: rudder (propeller and rudder), fan (fixed fans), block (own equations)", "rudder"
    )
    file = Path(_answer("File to write", "machine.py" if kind == "block" else "craft.toml"))
    mass = _answer("Mass in kg (empty: coefficients per mass)", "")
    return kind, file, positive("mass", _number(mass)) if mass else None


def _answer(question: str, default: str) -> str:
    return input(f"{question}{f' [{default}]' if default else ''}: ").strip() or default


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"mass: expected a number in kg, found {text!r}") from None
