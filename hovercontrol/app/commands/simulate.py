"""``hovercontrol simulate``: run a scenario."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.app.commands.options import Out
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder

if TYPE_CHECKING:
    from hovercontrol.base.progress import Report
    from hovercontrol.blocks.block import Block
    from hovercontrol.documents.scenarios import Run
    from hovercontrol.documents.scenarios.machine import MachineRun
    from hovercontrol.fmi.replay.plant import FmuPlant
    from hovercontrol.logs import Log

EXAMPLE = "Example: hovercontrol simulate table1 --out out/table1"


def simulate(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A scenario's name (--list shows them) or file; a model file; FILE.py:NAME of a Model, "
            "BlockModel or Block; an FMU, FILE.fmu.",
            autocompletion=names.scenarios,
        ),
    ] = "",
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration",
            help="Length of the run of a model file in seconds (default: 20, or that of --commands).",
        ),
    ] = None,
    model: options.Runs = None,
    commands: options.Commands = "",
    columns: options.Columns = "",
    period: options.Period = None,
    params: options.Params = None,
    match_start: Annotated[
        bool,
        typer.Option(
            "--match-start",
            help="Estimate an FMU's states at the first row from the outputs in the log of --commands.",
        ),
    ] = False,
    animation: Annotated[
        str,
        typer.Option(
            "--animate",
            metavar="FILE",
            help="Also write an animation of the craft: .html, .gif, or .mp4 (needs ffmpeg).",
        ),
    ] = "",
    out: Out = None,
    list_: Annotated[bool, typer.Option("--list", help="List the scenarios and exit.")] = False,
    json: options.Json = False,
) -> int:
    """Run a scenario; write its log, a table of its figures of merit, and pictures.

    A model file or a Block of your own starts from rest, an FMU (--model plant.fmu) from its start values.
    Steps of the commands drive it, or the commands of a log. If the log has outputs of an FMU, the
    difference between measurement and simulation is printed and written.

    Exit status 1 if a figure of merit is outside the range that the scenario states.
    """
    from hovercontrol.blocks.block import Block
    from hovercontrol.craft.models.blockmodel import BlockModel
    from hovercontrol.documents.scenarios import load_scenario, run_scenario, scenario_names
    from hovercontrol.documents.scenarios.drive import driven

    if list_:
        options.show_list({name: load_scenario(name).title for name in scenario_names()}, json)
        return 0
    scenario = options.run_of("simulate", scenario, model)
    if not scenario:
        raise InputError(
            "simulate: expected a scenario's name (hovercontrol simulate --list shows them) or a TOML file"
        )
    if animation:
        from hovercontrol.app.animation.animate import check_format

        check_format(Path(animation))
    log = options.commands_of("simulate", commands, columns, period)
    plant = options.fmu_of("simulate", scenario, "", params)
    if plant is not None:
        return _drive_fmu(plant, duration, log, match_start, out, json, animation)
    if match_start:
        raise InputError(f"simulate: --match-start belongs to an FMU, found {scenario}")
    own = options.from_users_file(scenario, params)
    if own is None and params:
        raise InputError(f"simulate: --params belongs to a model FILE.py:NAME, found {scenario}")
    if isinstance(own, Block | BlockModel):
        block = own if isinstance(own, Block) else own.plant()
        return _drive(block, duration, log, out, json, animation)
    loaded = (
        load_scenario(scenario, seconds=duration, commands=log)
        if own is None
        else replace(driven(own, own.name, duration, log), file=scenario)
    )
    out = out or Path("out") / loaded.name
    check_folder(out)
    with options.progress_bar(f"simulate {loaded.name}", loaded.end) as report:
        run = run_scenario(loaded, report)
        _animate(run, animation, report, loaded.end)  # first: a run that cannot be animated leaves no files
        files = run.save(out)
    if not json:
        _show_metrics(run)
        _show_clipped(run)
    _show_written(_as_json(run), files, out, animation, json)
    return 0 if all(m.met for m in run.metrics()) else 1


def _animate(run: Run | MachineRun, file: str, report: Report, end: float) -> None:
    """Write the animation if requested; the progress bar of the run, up to `end`, shows its progress."""
    if file:
        from hovercontrol.app.animation.animate import animate

        name = Path(file).name
        animate(run, file, progress=lambda done: report(end, f"{name}, {done:.0%}"))


def _show_written(content: dict[str, Any], files: list[Path], out: Path, animation: str, json: bool) -> None:
    text = f"wrote {animation}" if animation else ""
    options.show(
        text, files, out, content | ({"animation": animation} if animation else {}) if json else None
    )


def _drive(
    block: Block, seconds: float | None, log: Log | None, out: Path | None, json: bool, animation: str
) -> int:
    """Simulate a user's model, which has no figures of merit."""
    from hovercontrol.documents.scenarios.drive import run_length
    from hovercontrol.documents.scenarios.machine import run_machine

    out = out or Path("out") / block.name
    check_folder(out)
    end = run_length(seconds, log)
    with options.progress_bar(f"simulate {block.name}", end) as report:
        run = run_machine(block, seconds=seconds, commands=log, progress=report)
        _animate(run, animation, report, end)
        files = run.save(out)
    content = {"scenario": block.name, "figures": [], "clipped": {}}
    _show_written(content, files, out, animation, json)
    return 0


def _drive_fmu(
    plant: FmuPlant,
    seconds: float | None,
    log: Log | None,
    match_start: bool,
    out: Path | None,
    json: bool,
    animation: str,
) -> int:
    """Simulate an FMU; its errors are those of a log with its outputs."""
    from hovercontrol.documents.scenarios.drive import run_length
    from hovercontrol.documents.scenarios.fmu_runs import simulate_fmu

    out = out or Path("out") / plant.name
    check_folder(out)
    end = run_length(seconds, log)
    with options.progress_bar(f"simulate {plant.name}", end) as report:
        run = simulate_fmu(plant, seconds=seconds, commands=log, match_start=match_start, progress=report)
        _animate(run, animation, report, end)
        files = run.save(out)
    if not json and (text := run.text()):
        print(text)
    errors = {channel: vars(apart) for channel, apart in run.apart.items()}
    content = {"scenario": plant.name, "figures": [], "clipped": {}, "errors": errors, "start": run.start}
    _show_written(content, files, out, animation, json)
    return 0


def _as_json(run: Run) -> dict[str, Any]:
    figures = [
        {
            "name": m.metric.name, "of": m.metric.of, "from": m.metric.start, "to": m.metric.end,
            "value": m.value, "unit": m.metric.unit, "low": m.metric.low, "high": m.metric.high, "met": m.met,
        }
        for m in run.metrics()
    ]  # fmt: skip
    return {"scenario": run.scenario.name, "figures": figures, "clipped": run.clipped()}


def _show_clipped(run: Run) -> None:
    from hovercontrol.craft.hardware.actuators.signals import TICK

    counted = {key: count for key, count in run.clipped().items() if count}
    if counted:
        ticks = round(run.scenario.end / TICK) + 1
        said = ", ".join(f"{key} at {count} ({count / ticks:.0%})" for key, count in counted.items())
        print(f"of {ticks} ticks, commands exceeded their limits or lookup tables and were clipped: {said}")


def _show_metrics(run: Run) -> None:
    if not run.scenario.metrics:
        return
    from rich.console import Console
    from rich.table import Table

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
    screen = Console()
    with screen.capture() as drawn:  # the library itself would end the process where a pipe is closed
        screen.print(table)
    print(drawn.get(), end="")
