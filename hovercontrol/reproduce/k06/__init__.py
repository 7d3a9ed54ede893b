"""What is rebuilt of K06, in its order."""

from __future__ import annotations

from hovercontrol.reproduce.item import Item
from hovercontrol.reproduce.k06 import bench, diagrams, hardware, trials


def _order(item: Item) -> tuple[str, int, bool]:
    chapter, _, number = item.number.partition(".")
    return chapter, int(number), item.kind != "table"


ITEMS: list[Item] = sorted([*hardware.ITEMS, *trials.ITEMS, *bench.ITEMS, *diagrams.ITEMS], key=_order)
