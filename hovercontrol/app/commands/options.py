"""Options that several commands share: logs, and the craft they were recorded with."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hovercontrol.app.commands import names
from hovercontrol.base import output
from hovercontrol.base.errors import InputError

if TYPE_CHECKING:
    from hovercontrol.base.progress import Report
    from hovercontrol.blocks.block import Block
    from hovercontrol.craft.models.blockmodel import BlockModel
    from hovercontrol.craft.models.model import Model
    from hovercontrol.fmi.replay.plant import FmuPlant
    from hovercontrol.logs import Log
    from hovercontrol.logs.reader import Reader

Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        help="Folder for the results, created if missing (default: out/NAME of what is run).",
    ),
]
#: What a log may be, in the help of a command's argument LOG.
FORMATS = "CSV, Parquet, ROS bag, ULog, BIN, MAT, MDF; POSE.csv+COMMANDS.csv for a run in two files."

Logs = Annotated[list[str] | None, typer.Argument(metavar="LOG", help=FORMATS)]
ModelFile = Annotated[
    str | None,
    typer.Option(
        "--model",
        help="Model file (TOML), or FILE.py:NAME of a Model, BlockModel or Block; or an FMU, FILE.fmu.",
    ),
]
Runs = Annotated[
    str | None,
    typer.Option("--model", help="A model file, FILE.py:NAME or FILE.fmu in place of the argument."),
]
Commands = Annotated[
    str,
    typer.Option(
        "--commands", metavar="LOG", help="Log whose commands drive a model file, a Block or an FMU."
    ),
]
Fit = Annotated[
    str,
    typer.Option("--fit", help="Parameters of an FMU (--model plant.fmu) to fit, separated by commas."),
]
LawsIn = Annotated[
    str,
    typer.Option(
        "--laws-in",
        metavar="STATES",
        help="Continuous states of an FMU whose derivatives may lack an offset, drag or dry friction, "
        "separated by commas.",
    ),
]
Params = Annotated[
    Path | None,
    typer.Option(
        "--params",
        help="Values and effects of the model: a parameters.toml from identify or diagnose; "
        "of an FMU its start_values.csv.",
    ),
]
Holdout = Annotated[
    list[str] | None, typer.Option("--holdout", help="A log held out of the fit; can be repeated.")
]
Vehicle = Annotated[
    str | None,
    typer.Option(
        "--vehicle",
        help="A built-in craft instead of --model.",
        autocompletion=names.vehicles,
    ),
]
Columns = Annotated[
    str,
    typer.Option(
        "--columns",
        help="Map file columns to signals: NAME=COLUMN[:UNIT]; a leading - of the unit flips the sign: "
        "time=stamp_ms:ms,rudder=servo:-deg,psi=qx,qy,qz,qw:z-up",
    ),
]
Period = Annotated[
    float | None,
    typer.Option("--period", help="Seconds between two rows of a log without a column of time: 0.01"),
]
Bench = Annotated[
    Path | None, typer.Option("--bench", help="Bench table: column pwm_NAME becomes the force of input NAME.")
]
BenchFans = Annotated[
    int, typer.Option("--bench-fans", help="Number of fans that ran together on the bench.", min=1)
]
OnlyWhile = Annotated[
    str, typer.Option("--while", help="Use only rows that meet this condition: 'pwm_lift>1000'")
]
Settle = Annotated[
    float,
    typer.Option("--settle", help="Seconds to leave out after the --while condition becomes true.", min=0.0),
]
Fixed = Annotated[
    str,
    typer.Option(
        "--fixed", help="Parameters that keep their values, separated by commas: --fixed g,m", metavar="NAMES"
    ),
]
Missing = Annotated[
    str,
    typer.Option("--missing", help="Codes of missing values in the logs, separated by commas: -999,9999"),
]
TrialColumn = Annotated[
    str,
    typer.Option("--trial", help="Column with the number of the trial, such as 'trial'."),
]
Frame = Annotated[
    str,
    typer.Option(
        "--frame",
        help="Axes of the logs: ned (x, y, psi, v, r are converted), z-up or enu (no conversion, no check).",
    ),
]


def _reserve(context: typer.Context, chosen: bool) -> bool:
    """Reserve standard output for the JSON value as soon as ``--json`` is read."""
    if chosen and not context.resilient_parsing:  # a shell that completes reads standard output
        output.reserve()
    return chosen


Json = Annotated[
    bool,
    typer.Option("--json", callback=_reserve, help="Print only the result, as JSON, on standard output."),
]
#: Gaps are always bridged; the option is accepted for scripts.
AllowGaps = Annotated[bool, typer.Option("--allow-gaps", hidden=True)]


def model_of(
    command: str, model: str | None, vehicle: str | None = None, params: Path | None = None
) -> Model | BlockModel:
    """Return the model of a model file or of a user's Python file, or a built-in craft.

    Parameters
    ----------
    command : str
        For error lines.
    model, vehicle : str, optional
        Values of ``--model`` and ``--vehicle``, one of which must be given.
    params : path, optional
        A parameter file, whose values and effects replace the model's.

    Raises
    ------
    InputError
        If none or both are given, one is unknown, or the parameters are of another model.
    """
    from hovercontrol.craft.models.interface import as_model
    from hovercontrol.craft.models.modelfile import load_model
    from hovercontrol.craft.models.vehicles import vehicle as known_vehicle

    if model and vehicle:
        raise InputError(f"{command}: --model and --vehicle exclude each other")
    if vehicle:
        return _with(known_vehicle(vehicle), params)
    if not model:
        raise InputError(
            f"{command}: expected the model of the logs: --model FILE (hovercontrol new writes one to "
            f"start from), or --vehicle NAME: {', '.join(names.vehicles())}"
        )
    if model in names.vehicles() and not Path(model).exists():
        raise InputError(f"{command}: expected a file after --model; the built-in craft is --vehicle {model}")
    own = from_users_file(model, params)
    return as_model(own) if own is not None else _with(load_model(model), params)


def fmu_of(
    command: str, model: str | None, fit: str, params: Path | None = None, laws_in: str = ""
) -> FmuPlant | None:
    """Return the FMU that ``--model`` names; None if it names no FMU.

    Raises
    ------
    InputError
        If the FMU cannot be used, or an option does not belong to it.
    """
    if not (model and model.endswith(".fmu")):
        for option, text in (("--fit", fit), ("--laws-in", laws_in)):
            if text:
                raise InputError(f"{command}: {option} belongs to an FMU; expected --model FILE.fmu")
        return None
    from hovercontrol.fmi.replay.opened import fmu_plant
    from hovercontrol.fmi.replay.start_values import read_csv

    return fmu_plant(
        model,
        listed(fit, "--fit") or [],
        values=read_csv(params) if params else None,
        laws_in=listed(laws_in, "--laws-in") or [],
    )


def run_of(command: str, named: str, model: str | None) -> str:
    """Return what is to be run: the argument of a command, or the value of ``--model`` in its place.

    Raises
    ------
    InputError
        If both are given.
    """
    if named and model:
        raise InputError(
            f"{command}: --model takes the place of the argument {named!r}; expected one of them"
        )
    return model or named


def craft(command: str, model: str | None, vehicle: str | None) -> Model:
    """Return a craft as :func:`model_of` does.

    Raises
    ------
    InputError
        As :func:`model_of`, or if it is another machine.
    """
    from hovercontrol.craft.models.model import Model

    found = model_of(command, model, vehicle)
    if not isinstance(found, Model):
        raise InputError(
            f"{command}: {model}: expected a craft (a model file or a Model), found the Block "
            f"{found.name!r}; hovercontrol simulate {model} runs it"
        )
    return found


def from_users_file(name: str, params: Path | None = None) -> Model | BlockModel | Block | None:
    """Return the Model, BlockModel or Block that ``FILE.py:NAME`` names; None if a text names no Python file.

    A list is connected by signal name to one Block.

    Raises
    ------
    InputError
        As :func:`hovercontrol.base.pythonfile.from_python`, if the Blocks of a list do not fit together, or
        if the parameters are of another model.
    """
    from hovercontrol.base.boundary import as_user
    from hovercontrol.blocks.interconnect import interconnect

    found = parts_in_file(name, params)
    if found is None or len(found) == 1:
        return found[0] if found else None
    joined: Block = as_user(interconnect, found, name.rpartition(":")[2])
    return joined


def parts_in_file(name: str, params: Path | None = None) -> list[Any] | None:
    """Return what ``FILE.py:NAME`` names in a list: one Model, BlockModel or Block, or the Blocks of a list.

    Raises
    ------
    InputError
        As :func:`hovercontrol.base.pythonfile.from_python`, or if the parameters are of another model.
    """
    from hovercontrol.base.pythonfile import from_python, names_python
    from hovercontrol.blocks.block import Block
    from hovercontrol.craft.models.blockmodel import BlockModel
    from hovercontrol.craft.models.model import Model

    if not names_python(name):
        return None
    found: Any = from_python(name, Block, BlockModel, Model, lists=True)
    if not isinstance(found, list):
        return [_with(found, params)]
    if params is not None:
        raise InputError(f"{name}: --params belongs to one model, found a list")
    return [one if isinstance(one, Block) else one.plant() for one in found]


def _with(model: Any, params: Path | None) -> Any:
    """Return a model with the values of a parameter file, or as it is without one."""
    from hovercontrol.craft.models.parameters import load_parameters

    return model if params is None else load_parameters(model, params)


def show(text: str, files: Sequence[Path], out: Path, result: object = None) -> None:
    """Print the text and the written files, or only the `result` as JSON."""
    if result is not None:
        from hovercontrol.base.plain_json import json_text, plain

        content = {**plain(result), "files": [str(out / f.name) for f in files]}
        output.write(json_text(content))
        return
    if text:
        print(text)
    print(f"wrote {', '.join(f.name for f in files)} to {out}")


def show_list(titles: Mapping[str, str], json: bool) -> None:
    """Print names and titles, one line each, or as a JSON object."""
    if json:
        from hovercontrol.base.plain_json import json_text

        output.write(json_text(titles))
        return
    width = max(map(len, titles), default=0)
    for name, title in titles.items():
        print(f"{name:{width}}  {title}")


def refuse_twice(command: str, names: Sequence[str], held: Sequence[str] = ()) -> None:
    """Refuse the same log given twice, also by different paths, and an option in a log's place."""
    from hovercontrol.base.files import readable
    from hovercontrol.logs.gather import split_files

    given: dict[Path, str] = {}
    for name in (*names, *held):
        if name.startswith("--"):
            raise InputError(
                f"{command}: expected a log, found {name}: does the option before it lack its value?"
            )
        first = Path(split_files(name)[0])  # commands may be those of several runs
        measured = Path(os.path.realpath(first if "\0" not in name else readable(first)))
        if measured in given:
            known = "" if given[measured] == name else f" (as {given[measured]})"
            why = (
                "; a held-out log must not be in the fit"
                if name in held and given[measured] not in held
                else ""
            )
            raise InputError(f"{command}: {name} is given twice{known}{why}")
        given[measured] = name


def readable_model(model: Model | BlockModel | FmuPlant | None) -> Model | BlockModel | None:
    """Return a model that logs can be read for: of an FMU the Block of its inputs and outputs."""
    from hovercontrol.craft.models.blockmodel import BlockModel
    from hovercontrol.craft.models.model import Model

    return model if model is None or isinstance(model, Model | BlockModel) else BlockModel(model.reading)


def reader(
    model: Model | BlockModel | FmuPlant | None,
    columns: str,
    period: float | None,
    bench: Path | None,
    bench_fans: int,
    only_while: str,
    settle: float,
    frame: str = "",
    *,
    missing: str = "",
    trial: str = "",
) -> Reader:
    """Return a function that reads logs by the options of a command; without a model all columns are read."""
    from hovercontrol.logs import BenchTable, Condition
    from hovercontrol.logs.reader import Reader

    return Reader(
        readable_model(model),
        pairs(columns),
        BenchTable.from_csv(bench, fans=bench_fans) if bench else None,
        Condition.parse(only_while) if only_while else None,
        settle,
        tuple(numbers(missing, "--missing")),
        trial,
        period,
        frame,
    )


def commands_of(command: str, commands: str, columns: str, period: float | None) -> Log | None:
    """Return the log of ``--commands``, or None if none is given.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.logs.read_log`, or if an option of a log is given without one.
    """
    from hovercontrol.logs import read_log

    for option, value in (("--columns", columns), ("--period", period)):
        if value and not commands:
            raise InputError(f"{command}: {option} belongs to the log of --commands; expected both")
    return read_log(commands, pairs(columns), period=period) if commands else None


def listed(text: str, option: str = "") -> list[str] | None:
    """Return the parts of a list separated by commas, None of an empty text.

    Raises
    ------
    InputError
        If the text has only commas and blanks.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if text and not parts:
        said = f"{option}: " if option else ""
        raise InputError(f"{said}expected names separated by commas, found {text!r}")
    return parts or None


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of a list separated by commas.

    Raises
    ------
    InputError
        If one is not a number.
    """
    found = []
    for part in listed(text, option) or []:
        try:
            found.append(float(part))
        except ValueError:
            raise InputError(f"{option}: expected numbers separated by commas, found {part!r}") from None
    return found


def pairs(text: str) -> dict[str, str]:
    """Return the mapping of ``--columns``: signal name to the file's column."""
    found: dict[str, str] = {}
    ours = ""
    for part in listed(text, "--columns") or []:
        if "=" not in part and found and found[ours].count(",") < 3:  # psi=qx,qy,qz,qw
            found[ours] += f",{part}"
            continue
        ours, equals, theirs = part.partition("=")
        ours, theirs = ours.strip(), theirs.strip()
        if not (ours and equals and theirs):
            raise InputError(f"--columns: expected NAME=COLUMN, found {part!r}")
        if ours in found:
            raise InputError(f"--columns: {ours!r} is given twice: {found[ours]!r} and {theirs!r}")
        found[ours] = theirs
    for theirs in found.values():
        if theirs.count(",") == 1 and not theirs.endswith((":east", ":north")):
            raise InputError(f"--columns: expected NAME=COLUMN, found {theirs.partition(',')[2]!r}")
    return found


def progress_bar(text: str, total: float) -> AbstractContextManager[Report]:
    """Show the progress of a command; its modules are imported here, not for ``--help``."""
    from hovercontrol.base import progress

    return progress.progress_bar(text, total)
