"""The command line application: all commands."""

from __future__ import annotations

from inspect import cleandoc
from typing import Annotated

import typer

from hovercontrol.app.commands import (
    analyze,
    benchmark,
    check,
    cockpit,
    completion,
    diagnose,
    experiment,
    export,
    fleet,
    identify,
    monitor,
    new,
    schema,
    simulate,
    sweep,
)
from hovercontrol.app.commands.single_options import OnceCommand
from hovercontrol.base.endings import STATUSES, separate_interrupts

app = typer.Typer(
    name="hovercontrol",
    help="Model-based control of hovercraft and other machines: simulate, identify, diagnose, export.",
    epilog=STATUSES,
    add_completion=False,
    rich_markup_mode=None,  # rich takes as long to import as all else
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
    install_completion: completion.Install = None,
    show_completion: completion.Show = None,
) -> None:
    if version:
        from hovercontrol import __version__

        print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


def _paragraphs(text: str) -> str:
    """Return a docstring without its line breaks: a terminal is as wide as it is."""
    return "\n\n".join(" ".join(part.split()) for part in cleandoc(text).split("\n\n"))


for command, example in (
    (simulate.simulate, simulate.EXAMPLE),
    (new.new, new.EXAMPLE),
    (check.check, check.EXAMPLE),
    (identify.identify, identify.EXAMPLE),
    (diagnose.diagnose, diagnose.EXAMPLE),
    (experiment.experiment, experiment.EXAMPLE),
    (monitor.monitor, monitor.EXAMPLE),
    (fleet.fleet, fleet.EXAMPLE),
    (export.export, export.EXAMPLE),
    (analyze.analyze, analyze.EXAMPLE),
    (sweep.sweep, sweep.EXAMPLE),
    (benchmark.benchmark, benchmark.EXAMPLE),
    (cockpit.cockpit, cockpit.EXAMPLE),
    (schema.schema, schema.EXAMPLE),
):
    about = _paragraphs(command.__doc__ or "")
    first = about.partition("\n\n")[0]  # else its beginning is shown, cut to the line
    app.command(cls=OnceCommand, epilog=example, help=about, short_help=first)(separate_interrupts(command))
