"""What the readers of logs need of a model: its plant, and whether it is a craft."""

from __future__ import annotations

from typing import ClassVar, Protocol, runtime_checkable

from hovercontrol.blocks.block import Block


@runtime_checkable
class PlantModel(Protocol):
    """A model that returns its plant; :class:`.Model` and :class:`.BlockModel` are."""

    is_craft: ClassVar[bool]

    def plant(self, *, late: bool = False) -> Block:
        """Return the plant; with `late`, the caller shifts inputs and clock itself."""
        ...
