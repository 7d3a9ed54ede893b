"""The items of all documents, and one by its name."""

from __future__ import annotations

import importlib
import inspect
import pkgutil

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.documents.item import KINDS, Item
from hovercontrol.documents.printed import numbered_items

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
        raise InputError(f"unknown document {document!r}{did_you_mean(document, DOCUMENTS)}")
    return [item for name in DOCUMENTS if document in ("", name) for item in _rebuilt(name)]


def _rebuilt(document: str) -> list[Item]:
    """Return the items of the functions in a document's modules, in the order of its table."""
    package = importlib.import_module(f"hovercontrol.documents.{document}")
    found: dict[tuple[str, str, str], Item] = {}
    for name in (m.name for m in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")):
        module = vars(importlib.import_module(name))
        marked = [vars(thing).get("item") for thing in module.values() if inspect.isfunction(thing)]
        for item in filter(None, marked):
            found[item.document, item.kind, item.number] = item
    return [found[n.key] for n in numbered_items(document) if n.key in found]


@checked
def find_items(document: str, name: str) -> list[Item]:
    """Return the items of a name, in both documents if none is given; none where there is no such item.

    Parameters
    ----------
    document : str
        ``c17``, ``k06``, or empty.
    name : str
        ``table 2``, ``fig15``, ``figure 15``, ``c17 table 2``.

    Raises
    ------
    InputError
        If the document is unknown.

    Examples
    --------
    >>> [item.title for item in find_items("c17", "table 1")]
    ['simulation in three phases: tracking error']
    """
    wanted = _short(name)
    return [i for i in all_items(document) if wanted in (_short(i.name), i.document + _short(i.name))]


def _short(name: str) -> str:
    """Return a name without spaces, the kind in its short form."""
    found = "".join(name.lower().split())
    for short, whole in KINDS.items():
        found = found.replace(whole, short)
    return found
