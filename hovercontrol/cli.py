"""The command line. Exit status: 0 done, 1 negative finding, 2 bad input in one line, 3 a fault of ours."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from hovercontrol.commands import (
    analyze,
    check,
    cockpit,
    diagnose,
    export,
    identify,
    new,
    reproduce,
    schema,
    simulate,
    sweep,
)
from hovercontrol.errors import InputError

app = typer.Typer(
    name="hovercontrol",
    help="Model-based control of hovercraft: simulate, identify, diagnose, export, analyze.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line; the entry point of the ``hovercontrol`` command."""
    try:
        status = app(standalone_mode=False)
    except InputError as error:
        status = _refuse(str(error))
    except typer.TyperException as error:
        text = error.format_message()
        status = _refuse(text) if text else 0  # no arguments at all: the help was printed
    except (typer.Abort, KeyboardInterrupt):
        status = _refuse("stopped; nothing was written")
    except BrokenPipeError:  # the reader of a pipe has left
        sys.stderr.close()
        status = 0
    except Exception as error:  # a fault of ours: never a traceback at a user, never taken for a finding
        _refuse(f"unexpected {type(error).__name__}: {error} (please report this)")
        status = 3
    sys.exit(status if isinstance(status, int) else 0)


def _refuse(text: str) -> int:
    line = " ".join(text.split())
    print(f"hovercontrol: {line}", file=sys.stderr)
    return 2


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and leave.")] = False,
    completion: Annotated[
        str, typer.Option("--completion", metavar="SHELL", help="Print completion for bash, zsh or fish.")
    ] = "",
) -> None:
    if version:
        from hovercontrol import __version__

        print(__version__)
        raise typer.Exit
    if completion:
        from hovercontrol.commands.completion import script

        print(script(completion, context.command), end="")
        raise typer.Exit


for command, example in (
    (simulate.simulate, simulate.EXAMPLE),
    (new.new, new.EXAMPLE),
    (check.check, check.EXAMPLE),
    (identify.identify, identify.EXAMPLE),
    (diagnose.diagnose, diagnose.EXAMPLE),
    (export.export, export.EXAMPLE),
    (analyze.analyze, analyze.EXAMPLE),
    (sweep.sweep, sweep.EXAMPLE),
    (reproduce.reproduce, reproduce.EXAMPLE),
    (cockpit.cockpit, cockpit.EXAMPLE),
    (schema.schema, schema.EXAMPLE),
):
    app.command(epilog=example)(command)


if __name__ == "__main__":
    main()
