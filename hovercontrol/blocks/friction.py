"""Dry friction in a Block: found in its equations and rewritten for a runtime with events.

``sgn(v, w)`` in the derivative of the state v itself is dry friction. It is set-valued at v = 0, where the
state can stick. A sgn anywhere else (a controller that cancels friction, a regressor) is a smooth function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.sgn import sgn

#: How a backend computes dry friction, ``sgn(v, w)`` in the derivative of v itself.
#:
#: "smooth" replaces sgn by tanh(v/w). NumPy, python-control, ``simulate``, ``compile`` and FMUs compute this
#: form by default, so that all agree; estimators, Jacobians and fits use it too. For speeds below the width w
#: the friction is viscous: under a force a body creeps and never sticks.
#:
#: "events" is Coulomb's law: at rest the friction balances the other forces up to its level, and a body
#: sticks until they exceed it. This is closer to a real craft at rest. However, a controller that cancels
#: friction by a smooth sgn does not cancel this friction near rest: in the third phase of C17's Table I the
#: craft then sticks and slips, centimetres from its reference. It is an option of ``compile`` and ``to_fmu``;
#: importers of such an FMU find its events.
Friction = Literal["events", "smooth"]


@dataclass(frozen=True)
class DryFriction:
    """One dry friction: ``v' = a + b s``, where s in [-1, 1] replaces its sgn.

    Parameters
    ----------
    state : str
        Name of the velocity v.
    symbol : sympy.Symbol
        The symbol s.
    a, b : sympy.Expr
        Expressions that may use the Block's definitions.
    """

    state: str
    symbol: sp.Symbol
    a: sp.Expr
    b: sp.Expr


def dry_frictions(block: Block) -> tuple[DryFriction, ...]:
    """Return the dry frictions of a Block, in the order of its states.

    Raises
    ------
    InputError
        If a derivative is not linear in the sgn of its own state.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> [f.state for f in dry_frictions(c17_simulation().plant())]
    ['u', 'v', 'r']
    """
    found: list[DryFriction] = []
    for state in block.states:
        e = block.derivatives[state.name]
        own = sorted((f for f in e.atoms(sgn) if f.args[0] == state.symbol), key=str)
        if not own:
            continue
        s = sp.Symbol(f"sgn_{len(found)}", real=True)
        replaced = e.xreplace(dict.fromkeys(own, s))
        b = sp.diff(replaced, s)
        if s in b.free_symbols:
            raise InputError(
                f"block {block.name!r}: {state.name}' is not linear in sgn({state.name}), '{e}': "
                "dry friction must enter it linearly"
            )
        # v' = a + b s:  a = v' at s = 0,  b = dv'/ds
        found.append(DryFriction(state.name, s, replaced.xreplace({s: sp.S.Zero}), b))
    return tuple(found)


def with_modes(block: Block, frictions: tuple[DryFriction, ...]) -> Block:
    """Return the Block with ``v' = a + b s`` for each dry friction; the free symbols s are its modes."""
    changed = {f.state: f.a + f.b * f.symbol for f in frictions}
    return block.unchecked(derivatives=Expressions({**block.derivatives, **changed}))
