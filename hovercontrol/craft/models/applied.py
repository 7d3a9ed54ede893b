"""Estimators fed with the commands that a plant's actuators apply."""

from __future__ import annotations

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import rename
from hovercontrol.blocks.signals import suffixed
from hovercontrol.craft.models.actuated import APPLIED


@checked
def applied_inputs(block: Block, plant: Block) -> Block:
    """Return an estimator or observer that takes the applied commands of a plant as its inputs.

    While a limit is active, an estimator that sees the unlimited command attributes the difference to its
    coefficients, and winds up.

    Parameters
    ----------
    block : Block
        Its input ``NAME`` becomes ``NAME_applied`` where the plant has an output of that name.
    plant : Block
        As of :func:`~hovercontrol.craft.models.actuated.actuated`.

    Raises
    ------
    InputError
        If no applied command of the plant is an input of the Block.

    Examples
    --------
    >>> from hovercontrol.control.observers import kalman_bucy
    >>> from hovercontrol.craft.models.actuated import actuated
    >>> from hovercontrol.craft.models.vehicles import c17_experiment
    >>> craft = c17_experiment()
    >>> plant = actuated(craft, lag={"rudder": 0.1})
    >>> estimator = applied_inputs(kalman_bucy(craft.plant(), ["yaw_coulomb"]), plant)
    >>> [s.name for s in estimator.inputs][-2:]
    ['thrust_applied', 'rudder_applied']
    """
    told = {s.name for s in plant.outputs}
    names = {s.name: suffixed(s.name, APPLIED) for s in block.inputs}
    swap = {name: applied for name, applied in names.items() if applied in told}
    if not swap:
        raise InputError(
            plant.where(f"it has no applied command that is an input of {block.name!r}; see actuated()")
        )
    return rename(block, swap)
