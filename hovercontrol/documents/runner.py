"""Rebuilding items one after the other, each into its own folder, and writing their index."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.figure_style import figure_style
from hovercontrol.base.folders import write_folder
from hovercontrol.documents.index import write_index
from hovercontrol.documents.item import Item, Outcome


@checked
def rebuild(
    items: Sequence[Item], folder: str | Path, progress: Callable[[float, str], None] | None = None
) -> list[Outcome]:
    """Rebuild items and write the index.

    Parameters
    ----------
    items : sequence of Item
    folder : path
        Made if it is not there; each item's files stand in a folder of its own, beside ``index.html`` and
        ``index.json``.
    progress : callable, optional
        Called with the number of items done and the name of the next.

    Returns
    -------
    list of Outcome
        One that raises an error is ``failed``, and the others are still rebuilt.

    Raises
    ------
    InputError
        If there is nothing to rebuild, or the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> item = Item("c17", "table", "1", "errors", lambda folder: {"error": 0.02})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [outcome.values for outcome in rebuild([item], folder)]
    [{'error': 0.02}]
    """
    if not items:
        raise InputError("nothing to rebuild")
    target = Path(folder)
    outcomes = []
    for k, item in enumerate(items):
        if progress is not None:
            progress(k, f"{item.document} {item.name}")
        outcomes.append(_rebuilt(item, target))
    write_index(outcomes, target)
    return outcomes


def _rebuilt(item: Item, target: Path) -> Outcome:
    begin = time.perf_counter()
    values: dict[str, float] = {}

    def write(place: Path) -> None:
        with figure_style():
            values.update({key: float(value) for key, value in item.measure(place).items()})
        missing = [p.name for p in item.printed if p.name not in values]
        if missing:
            raise KeyError(f"{missing[0]!r} was not measured")

    try:
        files = write_folder(target / item.folder, write)
    except Exception as error:  # a failure of one item is in the index; the others are rebuilt
        text = f"{type(error).__name__}: {error}"
        return Outcome(item, seconds=time.perf_counter() - begin, failure=text)
    names = tuple(f"{item.folder}/{file.name}" for file in files)
    return Outcome(item, values, names, time.perf_counter() - begin)
