"""What is rebuilt of C17."""

from __future__ import annotations

from hovercontrol.reproduce.c17 import experiment, simulation, theory
from hovercontrol.reproduce.item import Item

ITEMS: list[Item] = [*simulation.ITEMS, *experiment.ITEMS, *theory.ITEMS]
