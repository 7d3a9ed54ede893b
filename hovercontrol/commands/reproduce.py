"""``hovercontrol reproduce``: every table and figure of the source documents again, with an index."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from hovercontrol.commands import given
from hovercontrol.commands.given import Out
from hovercontrol.io.files import check_folder

EXAMPLE = 'Example: hovercontrol reproduce c17 --only "table 2" --only "fig 15" --out out/c17'


def reproduce(
    document: Annotated[str, typer.Argument(help="c17 or k06 (default: both).")] = "",
    only: Annotated[
        list[str] | None, typer.Option("--only", help='An item ("table 2", "fig 6.23"); may be repeated.')
    ] = None,
    out: Out = None,
    list_: Annotated[bool, typer.Option("--list", help="List the items and exit.")] = False,
    json: given.Json = False,
) -> int:
    """Rebuild the tables and figures of C17 and K06; write an index of printed value, own value and verdict.

    The index lists the items of this run. Exit status 1 if an item differs from the printed value.
    """
    from hovercontrol.documents import chosen_items
    from hovercontrol.documents import reproduce as rebuild
    from hovercontrol.documents.index import index_content

    items = chosen_items(document, only or [])
    if list_:
        given.show_list({f"{item.document} {item.name}": item.title for item in items}, json)
        return 0
    out = out or Path("out") / "reproduce"
    check_folder(out)
    with given.progress_bar("reproduce", len(items)) as report:
        outcomes = rebuild(items, out, report)
    counts = Counter(o.verdict for o in outcomes)
    lines = [
        f"{o.item.document} {o.item.name:16} {o.verdict}{f' ({o.failure})' if o.failure else ''}"
        for o in outcomes
    ]
    lines.append(", ".join(f"{n} {verdict}" for verdict, n in counts.most_common()))
    files = [out / "index.html", out / "index.json"]
    given.show("\n".join(lines), files, out, index_content(outcomes) if json else None)
    if counts["failed"]:
        return 3
    return 1 if counts["differs"] else 0
