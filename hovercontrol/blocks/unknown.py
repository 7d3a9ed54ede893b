"""Unknown functions in a Block's expressions: a growth rate mu(C_s) of which only the argument is known.

Such a Block has equations and units, but no backend can compute it. Logs fill the function in:
:func:`hovercontrol.identify` estimates it as a table, :func:`hovercontrol.diagnose` names its form. Both use
:func:`fill`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import sympy as sp
from sympy.core.symbol import Str

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, within_name
from hovercontrol.blocks.unknown_function import UnknownFunction


@checked
def unknown(name: str, of: Sequence[str], unit: str = "1") -> UnknownFunction:
    """Return a function that is not known, for the expressions of a Block.

    Several equations may use it, also with other signals of the same unit: the same name is the same
    function.

    Parameters
    ----------
    name : str
    of : sequence of str
        The signal on which it depends: a state, an input or a definition of the Block.
    unit : str, optional
        SI unit of its values.

    Raises
    ------
    InputError
        If a name is not an identifier, the unit is unknown, or it does not depend on one signal.

    Examples
    --------
    The drag of a cart, of which nothing is known but that it depends on the speed:

    >>> import hovercontrol as hc
    >>> v, F = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2")
    >>> drag = hc.unknown("drag", of=["v"], unit="m/s^2")
    >>> cart = hc.Block("cart", [v], [F], [v], [], {"v": F.symbol - drag})
    >>> print(cart.equations())
    v' = F - drag(v)

    A log of it shows the drag:

    >>> import numpy as np
    >>> t = np.arange(0.0, 20.0, 0.05)
    >>> push = np.repeat(np.random.default_rng(0).uniform(0.0, 2.0, 20), 20)
    >>> c = hc.Signal("c", "1/m", start=1.0)
    >>> known = hc.Block("cart", [v], [F], [v], [c], {"v": F.symbol - c.symbol * v.symbol**2})
    >>> run = hc.simulate(known, t, {"F": push})
    >>> noise = 1e-3 * np.random.default_rng(1).normal(size=t.size)
    >>> found = hc.identify(cart, [hc.Log("run", t, {"v": run.outputs + noise, "F": push})])
    >>> drag = found.functions[0]
    >>> bool(np.all(np.abs(drag.values - drag.grid**2) < 4.0 * drag.std + 0.01))
    True
    """
    if len(of) != 1:
        raise InputError(f"unknown function {name!r}: expected one signal in `of`, found {len(of)}")
    signal = Signal(name, unit)
    arguments = (Signal(one).symbol for one in of)
    found: UnknownFunction = UnknownFunction(Str(signal.name), Str(signal.unit), *arguments)
    return found


def unknown_functions(block: Block) -> dict[str, tuple[UnknownFunction, ...]]:
    """Return the unknown functions of a Block by name, each as it is called with its arguments.

    Raises
    ------
    InputError
        If a function has two units, or depends on parameters alone.

    Examples
    --------
    >>> v = Signal("v", "m/s")
    >>> drag = unknown("drag", of=["v"], unit="m/s^2")
    >>> unknown_functions(Block("cart", [v], [], [v], [], {"v": -drag}))
    {'drag': (drag(v),)}
    """
    calls: set[UnknownFunction] = set().union(*(e.atoms(UnknownFunction) for _, e in block.all_expressions()))
    known = {p.symbol for p in block.parameters}
    found: dict[str, tuple[UnknownFunction, ...]] = {}
    for call in sorted(calls, key=str):
        if all(block.expand(a).free_symbols <= known for a in call.arguments):
            raise InputError(block.where(f"{call} depends on parameters alone: a parameter is enough"))
        found[call.function] = (*found.get(call.function, ()), call)
    for name, own in found.items():
        units = sorted({call.unit for call in own})
        if len(units) > 1:
            raise InputError(block.where(f"the unknown function {name!r} has two units, {', '.join(units)}"))
    return found


def fill(block: Block, name: str, value: Callable[[sp.Expr], sp.Expr], parameters: Sequence[Signal]) -> Block:
    """Return a Block with an expression in place of an unknown function, as a definition of its name.

    Parameters
    ----------
    name : str
        Of the function.
    value : callable
        Returns its value as an expression of its argument and of `parameters`.
    parameters : sequence of Signal
        Added to the Block's.

    Examples
    --------
    >>> v, c = Signal("v", "m/s"), Signal("c", "1/s", start=0.5)
    >>> cart = Block("cart", [v], [], [v], [], {"v": -unknown("drag", of=["v"], unit="m/s^2")})
    >>> print(fill(cart, "drag", lambda v: c.symbol * v, [c]).equations())
    drag = c*v
    v' = -drag
    """
    calls = unknown_functions(block).get(name, ())
    own = [name if len(calls) == 1 else f"{name}_of_{within_name(str(c.arguments[0]))}" for c in calls]
    swap = {call: sp.Symbol(n, real=True) for call, n in zip(calls, own, strict=True)}
    changed = block.swapped(swap)
    filled = {n: value(*call.arguments) for call, n in zip(calls, own, strict=True)}
    changed["definitions"] = Expressions({**changed["definitions"], **filled})
    return replace(block, parameters=(*block.parameters, *parameters), **changed)
