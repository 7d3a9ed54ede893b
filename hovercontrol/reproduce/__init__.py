"""Every table and figure of the source documents again: what they print, what comes out here, a verdict."""

from hovercontrol.reproduce.item import Item, Outcome, Printed, about, at_least, at_most
from hovercontrol.reproduce.markers import Numbered, Place, numbered_items, places
from hovercontrol.reproduce.registry import all_items, chosen_items
from hovercontrol.reproduce.runner import reproduce

__all__ = [
    "Item",
    "Outcome",
    "Printed",
    "about",
    "at_least",
    "at_most",
    "Numbered",
    "Place",
    "numbered_items",
    "places",
    "all_items",
    "chosen_items",
    "reproduce",
]
