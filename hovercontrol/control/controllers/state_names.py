"""The states of a plant by the names that its outputs give them, and which of them are angles."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.backends.trim_conditions import with_rates
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal


class StateNames:
    """The state of a name: a state's own name, or that of an output that is the state.

    Parameters
    ----------
    where : str
        Of errors: the function that asks.

    Raises
    ------
    InputError
        Where a name is no state's; the nearest is named.
    """

    def __init__(self, where: str, plant: Block) -> None:
        self._where, self._plant = where, plant
        self._states = [s.name for s in plant.states]
        symbols = {s.symbol: k for k, s in enumerate(plant.states)}
        self._aliases = {
            o.name: symbols[e] for o in plant.outputs if (e := plant.output_expressions[o.name]) in symbols
        }

    def index(self, name: str) -> int:
        """Return the index of a state."""
        if name in self._states:
            return self._states.index(name)
        if name in self._aliases:
            return self._aliases[name]
        hint = did_you_mean(name, [*self._aliases, *self._states])
        raise InputError(f"{self._where}: block {self._plant.name!r} has no state {name!r}{hint}")

    def shown(self) -> set[int]:
        """Return the states that an output shows."""
        return set(self._aliases.values())

    def find(self, name: str) -> int | None:
        """Return the index of a state, None where the name is no state's."""
        return self.index(name) if name in self._states or name in self._aliases else None

    def signal(self, k: int) -> Signal:
        """Return the k-th state under the name by which an output shows it."""
        state = self._plant.states[k]
        shown = [name for name, index in self._aliases.items() if index == k]
        if state.name in shown or not shown:
            return state
        return state.replace(name=shown[0])


def is_angle(plant: Block, state: Signal) -> bool:
    """Return whether a state is an angle: a change by 2 pi does not change the plant's equations.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> plant = c17_simulation().plant()
    >>> [s.name for s in plant.states if is_angle(plant, s)]
    ['psi']
    """
    if state.unit != "rad":
        return False
    turn = {state.symbol: state.symbol + 2 * sp.pi}
    plain = with_rates(plant)  # a sampled heading's next value turns with it, its change does not
    expanded = (plain.expand(e) for e in plain.derivatives.values())
    return all(e.xreplace(turn) == e for e in expanded)
