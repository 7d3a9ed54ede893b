"""One interface for every kind of model: a craft's effects, a Block with effects, or a Block as it is."""

from __future__ import annotations

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model

#: What users give as a model: ``identify``, ``diagnose``, ``check`` and ``read_log`` take each of them.
AnyModel = Model | BlockModel | Block


@checked
def as_model(model: AnyModel) -> Model | BlockModel:
    """Return a model: a Block becomes a BlockModel without effects, a model is returned unchanged.

    Raises
    ------
    InputError
        If a Block cannot be a model: its inputs have delays, or a signal has a reserved name.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> as_model(decay).coefficients()
    {'k': 1.0}
    """
    return BlockModel(model) if isinstance(model, Block) else model
