"""Set points of a law as a Block of constants."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.blocks.block import Block


@checked
def setpoints(
    blocks: Iterable[Block], values: Mapping[str, float] | None = None, name: str = "reference"
) -> Block:
    """Return a Block with the references that no other Block has as output: their open ``..._ref`` inputs.

    Parameters
    ----------
    blocks : iterable of Block
        A law, with its guidance if it has any.
    values : mapping, optional
        By input; where none is given, the input's start value. They are parameters: ``reference.surge_ref``.
    name : str, optional

    Returns
    -------
    Block
        Outputs named like the inputs.

    Raises
    ------
    InputError
        If a name is none of those inputs, or a value is out of its bounds.

    Examples
    --------
    >>> from hovercontrol.control.controllers.k06 import turn
    >>> setpoints([turn(k1=0.5, k2=3.5)], {"yaw_rate_ref": 3.0}).default_parameters
    {'reference.yaw_rate_ref': 3.0}
    """
    every = list(blocks)
    driven = {s.name for block in every for s in block.outputs}
    told = {s.name: s for b in every for s in b.inputs if s.name.endswith("_ref") and s.name not in driven}
    for key, value in (values or {}).items():
        check_known(key, told, f"{name}: unknown set point {key!r}")
        told[key] = told[key].replace(start=told[key].check(value))
    inner = {key: signal.replace(name=f"{name}.{key}") for key, signal in told.items()}
    return Block(
        name,
        outputs=tuple(told.values()),
        parameters=tuple(inner.values()),
        output_expressions={key: signal.symbol for key, signal in inner.items()},
    )
