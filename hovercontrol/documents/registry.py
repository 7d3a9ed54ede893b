"""The items of all documents, and the choice of some by name."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from hovercontrol.core.boundary import checked
from hovercontrol.documents.item import KINDS, Item
from hovercontrol.documents.printed import rebuilt_items
from hovercontrol.errors import InputError, did_you_mean

DOCUMENTS = ("c17", "k06")


@checked
def all_items(document: str = "") -> list[Item]:
    """Return the items of a document, or of both, in its order.

    Raises
    ------
    InputError
        If the document is unknown.

    Examples
    --------
    >>> all_items("c17")[0].document
    'c17'
    """
    if document and document not in DOCUMENTS:
        raise InputError(f"reproduce: unknown document {document!r}{did_you_mean(document, DOCUMENTS)}")
    chosen = [name for name in DOCUMENTS if document in ("", name)]
    for name in chosen:
        importlib.import_module(f"hovercontrol.documents.{name}")
    return [item for name in chosen for item in rebuilt_items(name)]


@checked
def chosen_items(document: str = "", only: Sequence[str] = ()) -> list[Item]:
    """Return the items that are asked for.

    Parameters
    ----------
    document : str, optional
        ``c17`` or ``k06``; default both.
    only : sequence of str, optional
        Names (``table 2``, ``fig15``, ``figure 15``); default all.

    Raises
    ------
    InputError
        If the document or a name is unknown; the nearest is named.

    Examples
    --------
    >>> [item.title for item in chosen_items("c17", ["table 1"])]
    ['simulation in three phases: tracking error']
    """
    items = all_items(document)
    if not only:
        return items
    known = {_short(item.name): item.name for item in items}
    for name in only:
        if _short(name) not in known:
            hint = did_you_mean(name, list(dict.fromkeys(known.values())))
            raise InputError(f"reproduce: unknown item {name!r}{hint}; --list shows all")
    wanted = {_short(name) for name in only}
    return [item for item in items if _short(item.name) in wanted]


def _short(name: str) -> str:
    """Return a name without spaces, the kind in its short form."""
    found = "".join(name.lower().split())
    for short, whole in KINDS.items():
        if found.startswith(whole):
            return short + found.removeprefix(whole)
    return found
