"""Every table and figure of the source documents again: what they print, what comes out here, a verdict."""

from hovercontrol.documents.item import Item, Outcome, Printed
from hovercontrol.documents.markers import Place, places
from hovercontrol.documents.printed import Numbered, numbered_items, printed, rebuilds
from hovercontrol.documents.registry import all_items, find_items
from hovercontrol.documents.runner import rebuild

__all__ = [
    "Item",
    "Outcome",
    "Printed",
    "Numbered",
    "Place",
    "numbered_items",
    "printed",
    "rebuilds",
    "places",
    "all_items",
    "find_items",
    "rebuild",
]
