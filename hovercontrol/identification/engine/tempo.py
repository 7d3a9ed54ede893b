"""The tempo of logs: how much slower a machine's logs are than those for which lengths of time are stated.

The lengths of time of the engine (horizons of predictions, blocks, gaps, trial values of delays) are stated
in seconds for logs of crafts. A craft is as fast as it is; another machine may be a coil, logged every 5 us,
or a lake, logged once a day. Whoever logs it chooses the rate for its motion. Its lengths of time are
therefore those stated times its tempo: the power of ten with which its rows are 5 to 50 ms apart. The same
machine ten or a million times slower has the same results.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hovercontrol.identification.engine.measure import Measured

#: Longest time between the rows of the logs for which the lengths of time are stated, and its tolerance [s].
STATED = 0.05 * 1.05


def tempo_of(logs: Sequence[Measured], *, is_craft: bool) -> float:
    """Return the tempo: 1 for a craft, for other machines a power of ten.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> from hovercontrol.identification.engine.measure import measure
    >>> from hovercontrol.logs import Log
    >>> i = Signal("i", "A")
    >>> from hovercontrol.blocks.block import Block
    >>> coil = Block("coil", [i], [], [i], derivatives={"i": -i.symbol * Signal("c", "1/s").symbol},
    ...              parameters=[Signal("c", "1/s")])
    >>> log = measure(coil, Log("pulse", 1e-5 * np.arange(50), {"i": np.arange(50.0)}))
    >>> tempo_of([log], is_craft=False), tempo_of([log], is_craft=True)
    (0.001, 1.0)
    """
    if is_craft:
        return 1.0
    steps = np.concatenate([np.diff(log.time[np.isfinite(log.values).any(axis=0)]) for log in logs])
    steps = steps[steps > 0.0]
    return 10.0 ** math.ceil(math.log10(float(np.median(steps)) / STATED)) if steps.size else 1.0
