"""The source documents C17 and K06: scenarios, figures, tables, the sample log.

May import every room but ``app``. Each printed number is a row of ``c17/printed.csv`` or
``k06/printed.csv``, and a function marked ``@rebuilds`` computes it again; begin with ``item.py`` and
``registry.py``. ``scenarios/`` runs experiments from TOML files (begin with ``definition.py``).
"""

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
