"""Order of the updates of a hybrid Block's parts at a common tick.

The order is the usual one of sampled control: first all outputs, each after the outputs that it depends on
without delay; then all next states. If all inputs of a part are known at its turn, its outputs and next
states are computed together, so that their common parts are computed once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hovercontrol.blocks.block import Block


def tick_order(blocks: Sequence[Block], drivers: Mapping[str, Block]) -> list[tuple[Block, bool]]:
    """Return the Blocks that tick, in order, and whether each updates its states only after all outputs.

    Parameters
    ----------
    blocks : sequence of Block
        All Blocks to be joined, without an algebraic loop.
    drivers : mapping of str to Block
        The Block that drives each signal.
    """
    left = [block for block in blocks if block.period or block.ticks]
    direct = {b.name: _sources(b, _direct_inputs(b), drivers) for b in left}
    every = {b.name: _sources(b, [s.name for s in b.inputs], drivers) for b in left}
    order: list[tuple[Block, bool]] = []
    while left:
        waiting = {block.name for block in left}
        ready = [b for b in left if not direct[b.name] & waiting] or left
        complete = [b for b in ready if not every[b.name] & waiting]
        block = (complete or ready)[0]
        order.append((block, not complete))
        left.remove(block)
    return order


def _direct_inputs(block: Block) -> list[str]:
    return [] if block.ticks else [name for inputs in block.feedthrough.values() for name in inputs]


def _sources(block: Block, inputs: Sequence[str], drivers: Mapping[str, Block]) -> set[str]:
    """Return the other ticking Blocks that act on some inputs without delay, also via continuous Blocks."""
    found: set[str] = set()
    seen: set[str] = set()
    stack = list(inputs)
    while stack:
        name = stack.pop()
        if name in seen or name not in drivers:
            continue
        seen.add(name)
        driver = drivers[name]
        if driver.period:
            found.add(driver.name)
        else:
            if driver.ticks:
                found.add(driver.name)
            stack += driver.feedthrough[name]
    return found - {block.name}
