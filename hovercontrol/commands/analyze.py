"""``hovercontrol analyze``: draw a figure of stability, gain or beta regions."""

from __future__ import annotations

import ast
import importlib.util
import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, cast

import typer

import hovercontrol
from hovercontrol.commands import given
from hovercontrol.commands.given import Out
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.figure_style import figure_style
from hovercontrol.io.files import check_folder

EXAMPLE = "Example: hovercontrol analyze c17_gain_region --out out/gains"

_PACKAGE = Path(hovercontrol.__file__).parent
#: Where the scripts are: inside the installed package, beside it in a checkout.
FOLDERS = (_PACKAGE / "analyses", _PACKAGE.parent / "analyses")


def analyze(
    name: Annotated[
        str,
        typer.Argument(
            help="An analysis (--list shows them); budget is short for k06_budget.",
            autocompletion=lambda: list(known_scripts()),
        ),
    ] = "",
    trial: Annotated[
        str, typer.Argument(help="One trial, for analyses of trials (budget k06-turn) (default: all).")
    ] = "",
    out: Out = None,
    list_: Annotated[bool, typer.Option("--list", help="List the analyses and exit.")] = False,
    json: given.Json = False,
) -> int:
    """Run an analysis; write its figure (PNG, SVG), its table (CSV) and its findings as text."""
    scripts = known_scripts()
    if list_:
        given.show_list({known: _title(path) for known, path in scripts.items()}, json)
        return 0
    if not name:
        raise InputError(f"analyze: expected an analysis: {', '.join(scripts)}")
    name = _whole(name, scripts)
    main = _main(scripts[name])
    about = {"trial": trial} if trial else {}
    if about and "trial" not in inspect.signature(main).parameters:
        raise InputError(f"analyze: {name!r} is not an analysis of single trials, found {trial!r}")
    out = out or Path("out") / name
    check_folder(out)
    with given.progress_bar(f"analyze {name}", 1.0) as report, figure_style():
        files = main(out, lambda part: report(part, ""), **about)
    texts = [file.read_text(encoding="utf-8").rstrip("\n") for file in files if file.suffix == ".txt"]
    content = {"analysis": name, "title": _title(scripts[name]), "findings": "\n".join(texts).splitlines()}
    given.show("\n".join(texts), files, out, content if json else None)
    return 0


def _whole(name: str, scripts: Mapping[str, Path]) -> str:
    """Return an analysis' name: ``budget`` is ``k06_budget`` while no other ends so after its document."""
    if name in scripts:
        return name
    same = [known for known in scripts if known.partition("_")[2] == name]
    if len(same) > 1:
        raise InputError(f"analyze: {name!r} may be {' or '.join(same)}")
    if not same:
        short = {known.partition("_")[2]: known for known in scripts}
        raise InputError(f"analyze: unknown analysis {name!r}{did_you_mean(name, [*scripts, *short])}")
    return same[0]


def known_scripts() -> dict[str, Path]:
    """Return the analyses' scripts by name."""
    folder = next((f for f in FOLDERS if f.is_dir()), None)
    found = sorted(folder.glob("[!_]*.py")) if folder else []
    return {path.stem: path for path in found}


def _title(path: Path) -> str:
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]


def _main(path: Path) -> Callable[..., list[Path]]:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec and spec.loader
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return cast(Callable[..., list[Path]], module.main)
