"""``hovercontrol analyze``: analyses, and tables and figures of C17 and K06 with an index."""

from __future__ import annotations

import ast
import importlib.util
import inspect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

import hovercontrol
from hovercontrol.app.commands import options
from hovercontrol.app.commands.options import Out
from hovercontrol.base import output
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.figure_style import figure_style
from hovercontrol.base.files import check_folder

if TYPE_CHECKING:
    from hovercontrol.documents import Item

EXAMPLE = 'Example: hovercontrol analyze c17_gain_region "table 6.6" --out out/found'

_PACKAGE = Path(hovercontrol.__file__).parent
#: Where the scripts are: inside the installed package, beside it in a checkout.
FOLDERS = (_PACKAGE / "analyses", _PACKAGE.parent / "analyses")


@dataclass(frozen=True)
class _Done:
    """Text, files (names) and folder, JSON and exit status of a result."""

    text: str
    files: Sequence[Path]
    folder: Path
    content: Mapping[str, Any]
    status: int = 0


def analyze(
    name: Annotated[
        list[str] | None,
        typer.Argument(
            help='An analysis (k06_budget, or budget) or an item of C17 or K06 ("table 6.6", "c17 eq 24"); '
            "several may be given.",
            autocompletion=lambda: list(known_scripts()),
        ),
    ] = None,
    document: Annotated[
        str, typer.Option("--document", help="c17 or k06 alone; without a name, all its items.")
    ] = "",
    trial: Annotated[
        str, typer.Option("--trial", help="One trial, for analyses of trials (default: all).")
    ] = "",
    out: Out = None,
    list_: Annotated[bool, typer.Option("--list", help="List analyses and items and exit.")] = False,
    json: options.Json = False,
) -> int:
    """Run analyses; rebuild tables and figures of C17 and K06 and compare them with the printed values.

    An analysis writes a figure (PNG, SVG), a table (CSV) and its findings as text. Items have an index
    (index.html, index.json). Exit status 1 if an item differs from the printed value.
    """
    if list_:
        options.show_list(_titles(document), json)
        return 0
    scripts, items = _chosen(name or [], document)
    if trial:
        _refuse_trial(scripts, items, trial)
    found = []
    for work in _works(scripts, items, trial, out):
        found.append(work())
        if not json:
            options.show(found[-1].text, found[-1].files, found[-1].folder)
    if json:
        _show_json(found)
    return max(done.status for done in found)


def _titles(document: str) -> dict[str, str]:
    """Return the titles of analyses and items by their names on the command line."""
    from hovercontrol.documents import all_items

    items = all_items(document)
    scripts = {name: path for name, path in known_scripts().items() if _is_of(name, document)}
    titles = {name: f"analysis: {_title(path)}" for name, path in scripts.items()}
    return titles | {f"{item.document} {item.name}": item.title for item in items}


def _is_of(name: str, document: str) -> bool:
    return not document or name.startswith(f"{document}_")


def _chosen(names: Sequence[str], document: str) -> tuple[dict[str, Path], list[Item]]:
    """Return the requested analyses and items.

    Raises
    ------
    InputError
        If a name is unknown or may be two analyses, or nothing is asked for.
    """
    from hovercontrol.documents import all_items, find_items

    scripts = {name: path for name, path in known_scripts().items() if _is_of(name, document)}
    if not names and not document:
        raise InputError(f"analyze: expected an analysis: {', '.join(scripts)}; or an item, see --list")
    chosen: dict[str, Path] = {}
    items: dict[str, Item] = {} if names else {item.folder: item for item in all_items(document)}
    for name in names:
        whole = _whole(name, scripts)
        if whole:
            chosen[whole] = scripts[whole]
            continue
        found = find_items(document, name)
        if not found:
            short = [known.partition("_")[2] for known in scripts]
            known = [*scripts, *short, *(item.name for item in all_items(document))]
            raise InputError(
                f"analyze: unknown analysis or item {name!r}{did_you_mean(name, known)}; see --list"
            )
        items |= {item.folder: item for item in found}
    return chosen, list(items.values())


def _whole(name: str, scripts: Mapping[str, Path]) -> str:
    """Return the full name of an analysis: ``k06_budget`` for ``budget``, if that is unique."""
    if name in scripts:
        return name
    same = [known for known in scripts if known.partition("_")[2] == name]
    if len(same) > 1:
        raise InputError(f"analyze: {name!r} may be {' or '.join(same)}")
    return same[0] if same else ""


def _refuse_trial(scripts: Mapping[str, Path], items: Sequence[Item], trial: str) -> None:
    """Raise if a trial is given for an analysis without trials."""
    without = [n for n, path in scripts.items() if "trial" not in inspect.signature(_main(path)).parameters]
    without += [item.name for item in items]
    if without:
        raise InputError(f"analyze: {without[0]!r} is not an analysis of single trials, found {trial!r}")


def _works(
    scripts: Mapping[str, Path], items: Sequence[Item], trial: str, out: Path | None
) -> list[Callable[[], _Done]]:
    """Return the runs to do; several analyses write into a folder each."""
    alone = len(scripts) == 1 and not items
    works: list[Callable[[], _Done]] = []
    for name, path in scripts.items():
        folder = out if out and alone else (out or Path("out")) / name
        works.append(lambda name=name, path=path, folder=folder: _run(name, path, folder, trial))  # type: ignore[misc]
    if items:
        works.append(lambda: _rebuild(items, out or Path("out") / "documents"))
    return works


def _run(name: str, path: Path, folder: Path, trial: str) -> _Done:
    """Run an analysis."""
    check_folder(folder)
    with options.progress_bar(f"analyze {name}", 1.0) as report, figure_style():
        about = {"trial": trial} if trial else {}
        files = _main(path)(folder, lambda part: report(part, ""), **about)
    texts = [file.read_text(encoding="utf-8").rstrip("\n") for file in files if file.suffix == ".txt"]
    content = {"analysis": name, "title": _title(path), "findings": "\n".join(texts).splitlines()}
    return _Done("\n".join(texts), files, folder, content)


def _rebuild(items: Sequence[Item], folder: Path) -> _Done:
    """Rebuild items and write their index; the index lists the items of this run."""
    from hovercontrol.documents import rebuild
    from hovercontrol.documents.index import index_content

    check_folder(folder)
    with options.progress_bar("analyze", len(items)) as report:
        outcomes = rebuild(items, folder, report)
    counts = Counter(o.verdict for o in outcomes)
    lines = [
        f"{o.item.document} {o.item.name:16} {o.verdict}{f' ({o.failure})' if o.failure else ''}"
        for o in outcomes
    ]
    lines.append(", ".join(f"{n} {verdict}" for verdict, n in counts.most_common()))
    status = 3 if counts["failed"] else 1 if counts["differs"] else 0
    files = [folder / "index.html", folder / "index.json"]
    return _Done("\n".join(lines), files, folder, index_content(outcomes), status)


def _show_json(found: Sequence[_Done]) -> None:
    """Print one result as an object, several as a list."""
    from hovercontrol.base.plain_json import json_text

    results = [{**done.content, "files": [str(done.folder / f.name) for f in done.files]} for done in found]
    output.write(json_text(results[0] if len(results) == 1 else {"results": results}))


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
