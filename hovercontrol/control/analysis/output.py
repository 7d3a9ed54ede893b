"""What a script in ``analyses/`` leaves: a picture as PNG and SVG, a table as CSV, the findings as text."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.csv
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from hovercontrol.base.endings import run
from hovercontrol.base.figure_style import figure_style
from hovercontrol.base.files import check_folder
from hovercontrol.base.folders import write_folder

#: Called now and then with the share that is done, 0 to 1.
Progress = Callable[[float], None]


def quiet(share: float) -> None:
    """Report no progress."""


def part(progress: Progress, k: int, of: int, count: float = 1) -> Callable[[float], None]:
    """Return what reports the progress of part `k` of `of` equal parts, given how much of `count` is done."""
    return lambda done: progress((k + done / count) / of)


#: A table to write: a function that writes it to a path, rows, or columns by name.
Table = Callable[[Path], object] | Sequence[Mapping[str, Any]] | Mapping[str, ArrayLike]


def save(
    out: str | Path,
    name: str,
    figure: Figure,
    tables: Mapping[str, Table],
    findings: Sequence[str],
) -> list[Path]:
    """Write ``NAME.png``, ``NAME.svg``, ``NAME.txt`` and the tables; they are written atomically.

    Parameters
    ----------
    out : path
        The folder; made if it is not there.
    name : str
    figure : matplotlib.figure.Figure
    tables : mapping of str to :data:`Table`
        By file name without suffix; written as CSV.
    findings : sequence of str
        Sentences.

    Returns
    -------
    list of Path
        The files, sorted.
    """

    def write(folder: Path) -> None:
        figure.savefig(folder / f"{name}.png", dpi=150)
        figure.savefig(folder / f"{name}.svg", dpi=150)
        (folder / f"{name}.txt").write_text("\n".join(findings) + "\n", encoding="utf-8")
        for title, table in tables.items():
            _write_table(folder / f"{title}.csv", table)

    return write_folder(out, write)


def _write_table(path: Path, table: Table) -> None:
    if callable(table):
        table(path)
    elif isinstance(table, Mapping):
        pyarrow.csv.write_csv(pyarrow.table(dict(table)), path)
    else:
        pyarrow.csv.write_csv(pyarrow.Table.from_pylist(list(table)), path)


def script(main: Callable[..., list[Path]], description: str) -> None:
    """Run an analysis from the command line: ``python analyses/NAME.py --out DIR``.

    Parameters
    ----------
    main : callable
        ``main(out, progress)``; returns the files.
    description : str
        What ``--help`` says.

    Notes
    -----
    It ends as every command does, see :mod:`hovercontrol.base.endings`.
    """
    status = run(lambda: _script(main, description))
    if status:
        sys.exit(status)


def _script(main: Callable[..., list[Path]], description: str) -> None:
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the results (default: out)")
    out = parser.parse_args().out

    def report(done: float) -> None:
        if sys.stderr.isatty():
            print(f"\r{100 * done:3.0f} %", end="\n" if done >= 1 else "", file=sys.stderr, flush=True)

    check_folder(out)
    with figure_style():
        files = main(out, report)
    for file in files:
        if file.suffix == ".txt":
            print(file.read_text(encoding="utf-8"), end="")
    print("\n".join(str(file) for file in files))
