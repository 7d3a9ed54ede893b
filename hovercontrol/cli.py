"""The command line. Exit status: 0 done, 1 negative finding, 2 bad input in one line, 3 a fault of ours."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from hovercontrol.errors import InputError
from hovercontrol.files import check_folder

if TYPE_CHECKING:
    from hovercontrol.logs import Log
    from hovercontrol.scenarios import Run

app = typer.Typer(
    name="hovercontrol",
    help="Model-based control of hovercraft: simulate, identify, export.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Out = Annotated[
    Path | None, typer.Option("--out", "-o", help="Folder for the results (else out/NAME); made if need be.")
]


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
) -> None:
    if version:
        from hovercontrol import __version__

        print(__version__)
        raise typer.Exit


@app.command(epilog="Example: hovercontrol simulate table1 --out out/table1")
def simulate(
    scenario: Annotated[
        str, typer.Argument(help="A scenario's name (--list shows them) or a TOML file.")
    ] = "",
    out: Out = None,
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
        raise InputError(
            f"simulate: expected a scenario's name ({', '.join(scenario_names())}) or a TOML file"
        )
    loaded = load_scenario(scenario)
    out = out or Path("out") / loaded.name
    check_folder(out)
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
        wanted = f"> {d.low:g}" if d.high == float("inf") else wanted
        wanted = "" if d.low == -d.high == -float("inf") else wanted
        mark = "" if m.met else "  [red]outside[/red]"
        table.add_row(d.name, window, f"{m.value:.3g} {d.unit}{mark}", wanted, d.paper)
    Console().print(table)


@app.command(
    epilog="Example: hovercontrol identify a.csv b.csv --holdout c.csv --model craft.toml --out out/identify"
)
def identify(
    logs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LOG...", help="CSV or Parquet; POSE.csv+COMMANDS.csv for a run in two files."
        ),
    ] = None,
    out: Out = None,
    model: Annotated[Path | None, typer.Option(help="Model file to start from.")] = None,
    vehicle: Annotated[
        str | None, typer.Option(help="Or one of the package's craft (else c17_experiment).")
    ] = None,
    holdout: Annotated[
        list[str] | None, typer.Option(help="A log that takes no part in the fit; may be repeated.")
    ] = None,
    coefficients: Annotated[
        str, typer.Option(help="Only these, separated by commas; the others keep their value.")
    ] = "",
    columns: Annotated[str, typer.Option(help="Names in the files: time=stamp,x=pose.x")] = "",
    bench: Annotated[
        Path | None, typer.Option(help="Bench table: column pwm_NAME becomes the force of input NAME.")
    ] = None,
    bench_fans: Annotated[int, typer.Option(help="Fans that pushed together on the bench.", min=1)] = 2,
    only_while: Annotated[
        str, typer.Option("--while", help="Use only rows where this holds: 'pwm_lift>1000'")
    ] = "",
    settle: Annotated[float, typer.Option(help="Seconds to leave out where that begins.", min=0.0)] = 1.0,
    window: Annotated[float, typer.Option(help="Length of the fit's windows in seconds.")] = 1.0,
    allow_gaps: Annotated[
        bool, typer.Option("--allow-gaps", help="Accept logs in which rows are missing.")
    ] = False,
    sample: Annotated[
        bool, typer.Option("--sample", help="Use the sample log that comes with the package.")
    ] = False,
) -> int:
    """Estimate a model's coefficients from logs, with standard errors and what the logs leave open.

    Writes model.toml, coefficients.csv, prediction.csv and rejected.csv,

    and for each log a picture of the free-running simulation over the measurement.

    Exit status 1 if a coefficient is not excited by the logs, or a body velocity of a held-out log is

    predicted worse 1 s ahead than by saying that it stays as it is.
    """
    from hovercontrol.identify.study import Study
    from hovercontrol.logs import BenchTable, Condition, gather
    from hovercontrol.logs.gather import split_files
    from hovercontrol.modelfile import load_model
    from hovercontrol.samples import sample_path
    from hovercontrol.vehicles import vehicle as known_vehicle

    names = [*(logs or []), *([str(sample_path())] if sample else [])]
    if not names:
        raise InputError("identify: expected one or more logs (or --sample)")
    if window <= 0:
        raise InputError(f"identify: --window must be positive, found {window:g}")
    out = out or Path("out") / "identify"
    check_folder(out)
    given: dict[Path, str] = {}
    for name in [*names, *(holdout or [])]:
        measured = split_files(name)[0].resolve()  # commands may be those of several runs
        if measured in given:
            known = "" if given[measured] == name else f" (as {given[measured]})"
            raise InputError(
                f"identify: {name} is given twice{known}; a hold-out log must take no part in the fit"
            )
        given[measured] = name
    if model and vehicle:
        raise InputError("identify: --model and --vehicle exclude each other")
    craft = load_model(model) if model else known_vehicle(vehicle or "c17_experiment")
    table = BenchTable.from_csv(bench, fans=bench_fans) if bench else None
    condition = Condition.parse(only_while) if only_while else None
    inputs = [s.name for s in craft.plant().inputs]

    def read(files: str) -> Log:
        return gather(
            files,
            inputs,
            columns=_pairs(columns),
            bench=table,
            only_while=condition,
            settle=settle,
            allow_gaps=allow_gaps,
        )

    with progress_bar("identify", 1.0) as report:
        every = []
        for k, name in enumerate([*names, *(holdout or [])]):
            every.append(read(name))
            report(0.1 * (k + 1) / (len(names) + len(holdout or [])))
        study = Study.make(
            craft,
            every[: len(names)],
            every[len(names) :],
            coefficients=_list(coefficients),
            window=window,
            progress=lambda part, what: report(0.1 + 0.9 * part),
        )
    files = study.save(out)
    print(study.text())
    print(f"wrote {', '.join(f.name for f in files)} to {out}")
    return 1 if study.negative else 0


@app.command(
    epilog="Example: hovercontrol export table1:plant -o plant.fmu --platforms x86_64-linux,x86_64-windows"
)
def export(
    block: Annotated[
        str,
        typer.Argument(
            help="A scenario or its TOML file: its whole closed loop; SCENARIO:PART: one part of it (plant, "
            "reference, controller, estimator); a craft or a model file: its plant. --list shows them."
        ),
    ] = "",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The FMU to write (else out/NAME.fmu).")
    ] = None,
    fmi: Annotated[int, typer.Option(help="Version of FMI: 2 or 3.")] = 3,
    platforms: Annotated[
        str | None,
        typer.Option(help="Names separated by commas, or all (else this machine's); others need ziglang."),
    ] = None,
    friction: Annotated[
        str, typer.Option(help="Dry friction: events (sticks at exactly zero velocity) or smooth.")
    ] = "events",
    stop: Annotated[float | None, typer.Option(help="End of the default experiment, in seconds.")] = None,
    step: Annotated[float | None, typer.Option(help="Its communication step, in seconds.")] = None,
    list_: Annotated[bool, typer.Option("--list", help="List what can be exported and leave.")] = False,
) -> int:
    """Write an FMU (FMI 2.0 or 3.0, Model Exchange and Co-Simulation in one file)."""
    from hovercontrol.fmi.binaries import PLATFORMS, chosen_platforms
    from hovercontrol.fmi.choose import choices, choose
    from hovercontrol.fmi.export import export_fmu
    from hovercontrol.fmi.variables import Interface

    if list_:
        for name, text in choices():
            print(f"{name:16} {text}")
        print(
            f"a model file or a scenario file (TOML), FILE.toml or FILE.toml:PART\n{'platforms':16} ", end=""
        )
        print(", ".join(PLATFORMS))
        return 0
    if not block:
        raise InputError("export: expected what to export; hovercontrol export --list shows what there is")
    wanted = chosen_platforms(platforms)
    chosen = choose(block)
    out = out or Path("out") / f"{chosen.block.name}.fmu"
    stop, step = chosen.stop if stop is None else stop, chosen.step if step is None else step
    with progress_bar(f"export {block}", 1.0) as report:
        path = export_fmu(
            chosen.block,
            out,
            version=fmi,  # type: ignore[arg-type]
            platforms=[p.name for p in wanted],
            friction=friction,  # type: ignore[arg-type]
            stop=stop,
            step=step,
            description=chosen.text,
            progress=report,
        )
    interface = Interface(chosen.block, friction)  # type: ignore[arg-type]
    kinds = (("input", "inputs"), ("parameter", "parameters"), ("state", "states"))
    counts = ", ".join(f"{len(interface.of(kind))} {word}" for kind, word in kinds)  # type: ignore[arg-type]
    print(
        f"wrote {path}: FMI {fmi}.0, {path.stat().st_size / 1000:.0f} kB for "
        f"{', '.join(p.name for p in wanted)}; {len(interface.variables)} variables "
        f"({counts}, {len(interface.outputs)} outputs)"
    )
    return 0


def _list(text: str) -> list[str] | None:
    return [part.strip() for part in text.split(",") if part.strip()] or None


def _pairs(text: str) -> dict[str, str]:
    pairs = {}
    for part in _list(text) or []:
        ours, equals, theirs = part.partition("=")
        if not (ours and equals and theirs):
            raise InputError(f"--columns: expected NAME=COLUMN, found {part!r}")
        pairs[ours.strip()] = theirs.strip()
    return pairs


@contextmanager
def progress_bar(text: str, total: float) -> Iterator[Callable[[float], None]]:
    """Show on standard error how far the work is; yields a function that is told.

    A terminal sees a bar, which leaves if the work ends in an error; a pipe gets one line at the end.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        begin = time.perf_counter()
        yield lambda done: None
        print(f"{text}: done in {time.perf_counter() - begin:.1f} s", file=sys.stderr)
        return
    parts = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Progress(*parts, TimeElapsedColumn(), console=console) as bar:
        task = bar.add_task(text, total=total)
        try:
            yield lambda done: bar.update(task, completed=done)
        except BaseException:
            bar.live.transient = True
            raise
        bar.update(task, completed=total)


if __name__ == "__main__":
    main()
