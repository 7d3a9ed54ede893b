"""The command line. Exit status: 0 done, 1 done with a negative finding, 2 bad input (one line, no traceback)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from hovercontrol.errors import InputError

if TYPE_CHECKING:
    from hovercontrol.scenarios import Run

app = typer.Typer(
    name="hovercontrol",
    help="Model-based control of hovercraft: simulate, identify.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Out = Annotated[Path, typer.Option("--out", "-o", help="Folder for the results; made if it is not there.")]


def main() -> None:
    """Run the command line; the entry point of the ``hovercontrol`` command."""
    try:
        status = app(standalone_mode=False)
    except InputError as error:
        status = _refuse(str(error))
    except typer.TyperException as error:
        status = _refuse(error.format_message())
    except (typer.Abort, KeyboardInterrupt):
        status = _refuse("stopped; nothing was written")
    except BrokenPipeError:  # the reader of a pipe has left
        sys.stderr.close()
        status = 0
    sys.exit(status if isinstance(status, int) else 0)


def _refuse(text: str) -> int:
    line = " ".join(text.split())
    print(f"hovercontrol: {line}", file=sys.stderr)
    return 2


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and leave.")] = False,
) -> None:
    if version:
        from hovercontrol import __version__

        print(__version__)
        raise typer.Exit


@app.command(epilog="Example: hovercontrol simulate table1 --out out/table1")
def simulate(
    scenario: Annotated[str, typer.Argument(help="A scenario's name (--list shows them) or a TOML file.")] = "",
    out: Out = Path("out"),
    list_: Annotated[bool, typer.Option("--list", help="List the scenarios and leave.")] = False,
) -> int:
    """Run a scenario; write its log, a table of its figures of merit, and pictures.

    Exit status 1 if a figure of merit is outside the range that the scenario states.
    """
    from hovercontrol.scenarios import load_scenario, run_scenario, scenario_names

    if list_:
        for name in scenario_names():
            print(f"{name:16} {load_scenario(name).title}")
        return 0
    if not scenario:
        raise InputError(f"simulate: expected a scenario's name ({', '.join(scenario_names())}) or a TOML file")
    loaded = load_scenario(scenario)
    with progress_bar(f"simulate {loaded.name}", loaded.end) as report:
        run = run_scenario(loaded, report)
    files = run.save(out)
    _show_metrics(run)
    print(f"wrote {', '.join(f.name for f in files)} to {out}")
    return 0 if all(m.met for m in run.metrics()) else 1


def _show_metrics(run: Run) -> None:
    if not run.scenario.metrics:
        return
    table = Table(title=f"{run.scenario.title} ({run.scenario.source})", title_justify="left")
    for heading in ("figure", "window", "measured", "expected", "the paper says"):
        table.add_column(heading)
    for m in run.metrics():
        d = m.metric
        window = f"{d.start:g} s" if d.start == d.end else f"{d.start:g}-{d.end:g} s"
        wanted = f"< {d.high:g}" if d.low == -float("inf") else f"{d.low:g} to {d.high:g}"
        mark = "" if m.met else "  [red]outside[/red]"
        table.add_row(d.name, window, f"{m.value:.3g} {d.unit}{mark}", wanted, d.paper)
    Console().print(table)


@contextmanager
def progress_bar(text: str, total: float) -> Iterator[Any]:
    """Show a progress bar on standard error; yields a function that takes how far the work is."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=False) as bar:
        task = bar.add_task(text, total=total)

        def report(done: float) -> None:
            bar.update(task, completed=done)

        yield report
        bar.update(task, completed=total)


if __name__ == "__main__":
    main()
