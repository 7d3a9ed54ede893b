"""Convert a Block to one python-control system: continuous, sampled, or integrated over each step."""

from __future__ import annotations

from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.backends.control import BlockSystem
from hovercontrol.blocks.backends.discrete import HeldSystem, HybridSystem
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import pade as approximated
from hovercontrol.blocks.delays import registers


def to_control(
    block: Block, name: str | None = None, *, step: float | None = None, pade: int | None = None
) -> BlockSystem:
    """Return a Block as one :class:`control.NonlinearIOSystem`.

    Parameters
    ----------
    name : str, optional
        System name (default: the Block's).
    step : float, optional
        Sampling period of a discrete-time system with held inputs [s]. For a continuous Block (default: the
        system is continuous) the system and its linearisation are exact for held inputs. For a hybrid Block
        (default: its shortest period) ticks occur exactly at their times for every step. For a Block with
        delayed inputs and without `pade`, the system has shift registers with this step; each delay must be a
        multiple of it.
    pade : int, optional
        Order of the Pade approximation of delayed inputs (:func:`hovercontrol.blocks.delays.pade`).

    Raises
    ------
    InputError
        If the step is not positive, or differs from the period of a sampled Block. Also if inputs are delayed
        but neither `step` nor `pade` is given, or if `pade` is given but no input is delayed.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=2.0)
    >>> system = to_control(Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
    >>> float(system.dynamics(0, [1.0], [], params={"decay.k": 3.0})[0])
    -3.0
    >>> sampled = to_control(system.block, step=0.5)
    >>> float(sampled.dynamics(0, [1.0], [])[0].round(6)), round(sampled.linearize([1.0]).A.item(), 6)
    (0.367879, 0.367879)
    """
    if pade is not None:
        if not block.delays:
            raise InputError(f"block {block.name!r}: no input acts late, found pade={pade!r}")
        block = approximated(block, pade)
    elif block.delays:
        if step is None:
            late = next(iter(block.delays))
            raise InputError(
                block.where(
                    f"python-control has no continuous delay, and the input {late!r} acts late: "
                    "to_control(pade=4) approximates it; to_control(step=h) is exact where inputs change at "
                    "multiples of h alone and each delay is one"
                )
            )
        block = registers(block, positive(f"block {block.name!r}: step", step))
    if block.period:
        if step is not None and step != block.period:
            raise InputError(block.where(f"sampled every {block.period:g} s, found step={step!r}"))
        return BlockSystem(block, name)
    if not block.ticks:
        return BlockSystem(block, name) if step is None else HeldSystem(block, name, _checked(block, step))
    step = min(tick.period for tick in block.ticks) if step is None else step
    return HybridSystem(block, name, _checked(block, step))


def _checked(block: Block, step: float) -> float:
    return positive(f"block {block.name!r}: step", step)
