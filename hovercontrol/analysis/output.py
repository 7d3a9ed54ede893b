"""What a script in ``analyses/`` leaves: a picture as PNG and SVG, a table as CSV, the findings as text."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from hovercontrol.endings import run
from hovercontrol.io.figure_style import figure_style
from hovercontrol.io.files import check_folder
from hovercontrol.io.folders import write_folder

#: Called now and then with the share that is done, 0 to 1.
Progress = Callable[[float], None]


def save(
    out: str | Path,
    name: str,
    figure: Figure,
    tables: Mapping[str, Callable[[Path], object]],
    findings: Sequence[str],
) -> list[Path]:
    """Write ``NAME.png``, ``NAME.svg``, ``NAME.txt`` and the tables; they are written atomically.

    Parameters
    ----------
    out : path
        The folder; made if it is not there.
    name : str
    figure : matplotlib.figure.Figure
    tables : mapping of str to callable
        By name without suffix; called with the path of a CSV file to write.
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
        for table, fill in tables.items():
            fill(folder / f"{table}.csv")

    return write_folder(out, write)


def script(main: Callable[..., list[Path]], description: str) -> None:
    """Run an analysis from the command line: ``python analyses/NAME.py --out DIR``.

    Parameters
    ----------
    main : callable
        ``main(out, progress=None)``; returns the files.
    description : str
        What ``--help`` says.

    Notes
    -----
    It ends as every command does, see :mod:`hovercontrol.endings`.
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
