"""``hovercontrol schema``: print the JSON Schema of a kind of file."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from hovercontrol.app.commands import names

EXAMPLE = "Example: hovercontrol schema model > model.schema.json"


def schema(
    kind: Annotated[
        str,
        typer.Argument(
            help="Format: result (of diagnose), fmu (diagnose of an FMU), monitor, simulation or sweep "
            "(their results), monitor_event (a line of monitor --follow), model or scenario (TOML files).",
            autocompletion=names.of(
                "result", "fmu", "monitor", "monitor_event", "simulation", "sweep", "model", "scenario"
            ),
        ),
    ] = "",
) -> int:
    """Print the JSON Schema of results, of model files or of scenario files.

    Editors complete and check TOML with it: put '#:schema model.schema.json' in the first line of the file.
    """
    from hovercontrol.app.schema import KINDS
    from hovercontrol.app.schema import schema as made
    from hovercontrol.base.errors import InputError
    from hovercontrol.base.plain_json import json_text

    if not kind:
        raise InputError(f"schema: expected a kind of file: {', '.join(KINDS)}")
    sys.stdout.write(json_text(made(kind)))
    return 0
