"""What is rebuilt of K06."""

from __future__ import annotations

from hovercontrol.reproduce.item import Item

ITEMS: list[Item] = []
