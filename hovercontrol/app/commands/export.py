"""``hovercontrol export``: write an FMU."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base.errors import InputError, one_line

if TYPE_CHECKING:
    from hovercontrol.app.commands.exportable import Choice

EXAMPLE = "Example: hovercontrol export table1:plant -o plant.fmu --platforms x86_64-linux,x86_64-windows"


def export(
    block: Annotated[
        str,
        typer.Argument(
            help="A scenario or its TOML file: the whole closed loop; SCENARIO:PART: one part of it (plant, "
            "reference, controller, estimator, of an autopilot its sensors, links and actuators); a part by "
            "itself (imu, rudder_servo); a craft or a model file: its plant; FILE.py:NAME: a Block of your "
            "own, or a list of Blocks that are connected by signal name. --list shows them.",
            autocompletion=names.exportable,
        ),
    ] = "",
    params: options.Params = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="FMU file to write (default: out/NAME.fmu); NAME.ssp: a loop's parts as FMUs."
        ),
    ] = None,
    fmi: Annotated[
        int | None,
        typer.Option(help="FMI version: 2 or 3 (default: 3, of a .ssp 2)", autocompletion=names.of("2", "3")),
    ] = None,
    platforms: Annotated[
        str | None,
        typer.Option(
            help="Platform names separated by commas, or all (default: this machine's); others need ziglang.",
            autocompletion=names.platforms,
        ),
    ] = None,
    friction: Annotated[
        str,
        typer.Option(
            help="Dry friction: smooth, as in simulate, or events (with sticking at rest).",
            autocompletion=names.of("events", "smooth"),
        ),
    ] = "smooth",
    stop: Annotated[
        float | None, typer.Option(help="Stop time of the default experiment, in seconds.")
    ] = None,
    step: Annotated[
        float | None, typer.Option(help="Communication step of the default experiment, in seconds.")
    ] = None,
    outputs: Annotated[
        str | None,
        typer.Option(help="Of NAME.ssp: outputs of the system too, separated by commas, as in x,y."),
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="List what can be exported and exit.")] = False,
    json: options.Json = False,
) -> int:
    """Write an FMU (FMI 2.0 or 3.0, Model Exchange and Co-Simulation in one file)."""
    from hovercontrol.app.commands.exportable import choose
    from hovercontrol.base.boundary import as_user
    from hovercontrol.fmi.exporter.binaries import chosen_platforms
    from hovercontrol.fmi.exporter.export import export_fmu
    from hovercontrol.fmi.exporter.variables import Interface

    if list_:
        return _list(json)
    if not block:
        raise InputError(
            "export: expected a scenario, a part, a craft or a file; hovercontrol export --list shows them"
        )
    wanted = chosen_platforms(platforms)
    chosen = choose(block, params)
    out = out or Path("out") / f"{chosen.block.name}.fmu"
    fmi = fmi if fmi is not None else 2 if out.suffix == ".ssp" else 3
    if fmi not in (2, 3):
        raise InputError(f"--fmi: expected 2 or 3, found {fmi}")
    if out.suffix not in (".fmu", ".ssp"):
        raise InputError(f"{out}: expected a file name that ends in .fmu, or in .ssp for a loop's parts")
    if out.suffix == ".ssp":
        return _system(chosen, out, fmi, platforms, (step, stop), outputs, json)
    stop, step = chosen.stop if stop is None else stop, chosen.step if step is None else step
    with options.progress_bar(f"export {one_line(block, 60)}", 1.0) as report:
        path: Path = as_user(
            export_fmu,
            chosen.block,
            out,
            version=fmi,
            platforms=[p.name for p in wanted],
            friction=friction,
            stop=stop,
            step=step,
            description=chosen.text,
            model_name=chosen.title,
            progress=report,
        )
    interface = Interface(chosen.block, friction)  # type: ignore[arg-type]
    kinds = (("input", "inputs"), ("parameter", "parameters"), ("state", "states"))
    if json:
        content: dict[str, object] = {
            "name": chosen.block.name,
            "fmi": fmi,
            "platforms": [p.name for p in wanted],
            "bytes": path.stat().st_size,
            "variables": [
                {"name": v.name, "kind": v.kind, "unit": v.unit.name if v.unit else None, "start": v.start}
                for v in interface.variables
            ],
        }
        options.show("", [path], path.parent, content)
        return 0
    counts = ", ".join(f"{len(interface.of(kind))} {word}" for kind, word in kinds)  # type: ignore[arg-type]
    print(
        f"wrote {path}: FMI {fmi}.0, {path.stat().st_size / 1000:.0f} kB for "
        f"{', '.join(p.name for p in wanted)}; {len(interface.variables)} variables "
        f"({counts}, {len(interface.outputs)} outputs)"
    )
    return 0


def _list(json: bool) -> int:
    """List what can be exported."""
    from hovercontrol.app.commands.exportable import choices
    from hovercontrol.base import output
    from hovercontrol.base.plain_json import json_text
    from hovercontrol.fmi.exporter.binaries import PLATFORMS

    if json:
        listed = {c.name: {"title": c.title, "parts": list(c.parts)} for c in choices()}
        output.write(json_text(listed))
        return 0
    for c in choices():
        print(f"{c.name:35} {c.title}")
        if c.parts:
            print(f"{', '.join(c.parts)}{c.more} its parts")
    print("a model file or a scenario file (TOML), FILE.toml or FILE.toml:PART")
    print("a Block, BlockModel or Model of your own, or a list of them, FILE.py:NAME")
    print(f"{'platforms':35} {', '.join(PLATFORMS)}")
    return 0


def _system(
    chosen: Choice,
    out: Path,
    fmi: int,
    platforms: str | None,
    times: tuple[float | None, float | None],
    outputs: str | None,
    json: bool,
) -> int:
    """Write the parts of a loop as a system of FMUs."""
    from hovercontrol.base.boundary import as_user
    from hovercontrol.fmi.ssp.write import export_ssp

    step, stop = (
        own if options is None else options
        for options, own in zip(times, (chosen.step, chosen.stop), strict=True)
    )
    if not chosen.parts:
        raise InputError(
            f"{out}: expected a loop: a continuous scenario, such as table1, or FILE.py:NAME of a list of "
            "Blocks, NAME = [plant, controller]"
        )
    more: dict[str, Any] = {k: v for k, v in (("step", step), ("stop", stop)) if v is not None}
    more["outputs"] = [name.strip() for name in outputs.split(",")] if outputs else []
    parts, title = list(chosen.parts), chosen.title
    path: Path = as_user(export_ssp, parts, out, name=title, version=fmi, platforms=platforms, **more)
    if json:
        content = {"name": title, "fmi": fmi, "parts": [p.name for p in parts], "bytes": path.stat().st_size}
        options.show("", [path], path.parent, content)
        return 0
    print(f"wrote {path}: {len(parts)} FMUs of FMI {fmi}.0 ({', '.join(p.name for p in parts)}), connected")
    return 0
