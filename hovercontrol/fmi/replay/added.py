"""Laws added to derivatives of an FMU, as a function of NumPy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.sgn import regularise


@dataclass(frozen=True)
class Added:
    """Blocks whose output ``added`` is added to a derivative; it can be pickled.

    Attributes
    ----------
    blocks : tuple of (int, Block)
        The place of the state, and the Block of :attr:`hovercontrol.fmi.around.Around.added`. Its inputs are
        the FMU's states and inputs, in order.
    """

    blocks: tuple[tuple[int, Block], ...]

    @classmethod
    def of(cls, blocks: Mapping[str, Block], derivatives: Mapping[str, int]) -> Added:
        """Return the laws for derivatives at these places.

        Raises
        ------
        InputError
            If a law has states of its own.
        """
        found = []
        for name, block in blocks.items():
            if block.states:
                raise InputError(f"{block.states[0].name}: a law added to an FMU has no states of its own")
            smooth = {
                s.name: regularise(block.expand(block.output_expressions[s.name])) for s in block.outputs
            }
            found.append((derivatives[name], replace(block, output_expressions=smooth, definitions={})))
        return cls(tuple(found))

    @cached_property
    def _functions(self) -> list[tuple[int, Any]]:
        return [(place, block.to_numpy().scalar_pair("outputs")[0]) for place, block in self.blocks]

    def to(self, rates: Array, t: float, x: Array, u: Array, numbers: Sequence[Sequence[float]]) -> Array:
        """Return the rates with the laws added; `numbers` are the values of each Block's parameters."""
        z = np.concatenate([x, u]).tolist()
        for (place, function), parameters in zip(self._functions, numbers, strict=True):
            rates[place] += function(t, (), z, parameters)[0]
        return rates
