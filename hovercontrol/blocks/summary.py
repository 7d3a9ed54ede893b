"""Text representation of a Block: its name, signal counts, and the names of its signals with units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hovercontrol.base.short_repr import WIDTH, cut

if TYPE_CHECKING:
    from hovercontrol.blocks.block import Block
    from hovercontrol.blocks.signals import Signal


def block_summary(block: Block) -> str:
    """Return a summary of a Block in a few lines.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> v, F, m = Signal("v", "m/s"), Signal("F", "N"), Signal("m", "kg", start=2.0)
    >>> Block("cart", [v], [F], [v], [m], {"v": F.symbol / m.symbol})
    Block 'cart': 1 state, 1 input, 1 output, 1 parameter
      states      v [m/s]
      inputs      F [N]
      outputs     v [m/s]
      parameters  m [kg]
    """
    groups = ("states", "inputs", "outputs", "parameters")
    lines = [block_line(block)]
    for kind in groups:
        signals = getattr(block, kind)
        if signals:
            lines.append(f"  {kind:10}  {signals_line(signals, WIDTH - 14, f'{block.name}.')}")
    return "\n".join(lines)


def block_line(block: Block) -> str:
    """Return a summary of a Block in one line: name, number of signals of each kind, and periods."""
    counts = [
        _counted(len(getattr(block, f"{kind}s")), kind) for kind in ("state", "input", "output", "parameter")
    ]
    periods = ", ".join(f"{p:g} s" for p in dict.fromkeys(tick.period for tick in block.ticks))
    notes = [f"sampled every {block.period:g} s"] if block.period else []
    notes += [f"ticks every {periods}"] if periods else []
    notes += [f"late: {', '.join(block.delays)}"] if block.delays else []
    return cut("; ".join([f"Block {block.name!r}: {', '.join(counts)}", *notes]))


def signals_line(signals: Sequence[Signal], width: int = WIDTH, prefix: str = "") -> str:
    """Return the names and units of signals in one line; if they do not all fit, the number of others.

    Parameters
    ----------
    width : int, optional
        Maximum length of the line.
    prefix : str, optional
        Prefix that is removed from the names.
    """
    line = ""
    for k, s in enumerate(signals):
        one = f"{', ' if line else ''}{s.name.removeprefix(prefix)} [{s.unit}]"
        more = f", ... {len(signals) - k} more"
        last = k == len(signals) - 1
        if len(line) + len(one) + (0 if last else len(more)) > width and line:
            return line + more
        line += one
    return line


def _counted(number: int, kind: str) -> str:
    return f"{number} {kind}{'' if number == 1 else 's'}"
