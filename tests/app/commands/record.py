"""What each command does with a small fixed input: its exit status, the files it writes, its figures.

``python -m tests.app.commands.record`` prints it as JSON; ``recorded.json`` is what the tests compare with.
Run as a file (``python tests/app/commands/record.py``) it records whatever hovercontrol is first on the path,
so that two versions can be set side by side.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import sys
import tempfile
import tomllib
from pathlib import Path

#: The words of each command; those that take longer than two seconds or so come last.
COMMANDS = {
    "new": ["new", "craft.toml"],
    "schema": ["schema", "model"],
    "simulate": ["simulate", "k06-turn", "--json"],
    "sweep": ["sweep", "k06-turn", "--vary", "controller.k2=0.5:6:3", "--of", "r", "--json"],
    "check": ["check", "out/k06-turn/log.csv", "--json"],
    "export": ["export", "table1:plant", "--friction", "events", "--json"],
    "analyze": ["analyze", "k06_gyro", "--json"],
    "table1": ["simulate", "table1", "--json"],
    "identify": ["identify", "--sample", "--json"],
    "items": ["analyze", "c17 table 1", "--json"],
    "field": ["simulate", "k06-field-turn", "--json"],
    "diagnose": ["diagnose", "out/k06-field-turn/log.csv", "--vehicle", "hoverdemon", "--json"],
}
SLOW = ("check", "analyze", "table1", "identify", "items", "field", "diagnose")
#: A command that reads another's log comes after it.
NEEDS = {"check": "simulate", "diagnose": "field"}
#: What differs from run to run, or names version and machine; gains near zero in a trace are rounding.
PASSING = (
    "seconds",
    "version",
    "elapsed",
    "time_taken",
    "made_by",
    "created",
    "versions",
    "machine",
    "bytes",
    "trace",
)


def figures(value: object, name: str = "") -> dict[str, float]:
    """Return all numbers of a JSON value by path; of a long list its first, last and mean."""
    if isinstance(value, bool) or value is None:
        return {}
    if isinstance(value, str):  # findings are sentences
        numbers = re.findall(r"(?<![\w.])-?\d+\.\d+", value) if name.startswith("findings") else []
        return {f"{name} {n}": float(number) for n, number in enumerate(numbers)}
    if isinstance(value, int | float):
        return {name: float(f"{value:.4g}")}
    if isinstance(value, dict):
        found = {}
        for key, part in value.items():
            if key not in PASSING:
                found |= figures(part, f"{name}.{key}" if name else str(key))
        return found
    if len(value) > 20 and all(isinstance(x, int | float) for x in value):
        return figures({"first": value[0], "last": value[-1], "mean": sum(value) / len(value)}, name)
    return {k: v for n, part in enumerate(value) for k, v in figures(part, f"{name}[{n}]").items()}


def told(command: str, status: int, out: str, folder: Path, before: set[str]) -> dict[str, object]:
    """Return the record of a command that has run in a folder which had the files `before`."""
    files = files_of(folder) - before
    if command == "new":
        said = tomllib.loads((folder / "craft.toml").read_text(encoding="utf-8"))
    else:
        said = json.loads(out)
    return {"status": status, "files": sorted(files), "figures": dict(sorted(figures(said).items()))}


def files_of(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("[!.]*") if p.is_file()}


def main() -> None:
    """Run all commands, or those that are named, in a temporary folder; print their records."""
    from hovercontrol.app.cli import main as command_line

    wanted = sys.argv[1:] or list(COMMANDS)
    records = {}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name in wanted:
            sys.argv = ["hovercontrol", *COMMANDS[name]]
            before, status, out = files_of(Path(folder)), 0, io.StringIO()
            try:
                with contextlib.redirect_stdout(out):
                    command_line()
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else int(bool(end.code))
            records[name] = told(name, status, out.getvalue(), Path(folder), before)
            print(f"{name}: {status}, {len(records[name]['figures'])} figures", file=sys.stderr)
        os.chdir("/")
    print(json.dumps(records, indent=1))


if __name__ == "__main__":
    main()
