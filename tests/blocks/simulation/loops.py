"""A continuous Block with sampled Blocks in the loop, simulated in Python: for other tests."""

import numpy as np

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.trajectory import simulate


def run_loop(plant, sampled, until, x0=None, step=None, **options):
    """Simulate to a time [s], by default in steps of the shortest period; `x0` has the plant's own names."""
    blocks = [sampled] if isinstance(sampled, Block) else list(sampled)
    step = min(block.period for block in blocks) if step is None else step
    start = {f"{plant.name}.{name}": value for name, value in (x0 or {}).items()}
    times = step * np.arange(round(until / step - 0.5 + 1e-9) + 1)
    return simulate(interconnect([plant, *blocks], inputs=[]), times, x0=start, **options)
