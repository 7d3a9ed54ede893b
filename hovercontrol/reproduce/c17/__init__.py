"""What is rebuilt of C17."""

from __future__ import annotations

from hovercontrol.reproduce.c17 import simulation
from hovercontrol.reproduce.item import Item

ITEMS: list[Item] = [*simulation.ITEMS]
