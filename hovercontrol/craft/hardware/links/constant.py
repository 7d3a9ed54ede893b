"""Links with a constant delay."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import constant_delay
from hovercontrol.blocks.signals import Signal


@checked
def k06_downlink(signals: Sequence[Signal], *, name: str = "downlink") -> Block:
    """Return the hovercraft-to-controller link of K06's simulation: 6 unit delays of 6 ms [K06 fig 6.3].

    Parameters and errors as for :func:`constant_delay`.

    Parameters
    ----------
    signals : sequence of Signal
        Signals to send, in any units.
    name : str, optional

    Examples
    --------
    >>> import hovercontrol as hc
    >>> k06_downlink([hc.Signal("r", "rad/s")]).period
    0.006
    """
    return constant_delay(signals, 0.036, 0.006, name=name)


@checked
def k06_uplink(signals: Sequence[Signal], *, name: str = "uplink") -> Block:
    """Return the controller-to-hovercraft link of K06's simulation: 2 unit delays of 20 ms [K06 fig 6.4].

    Parameters and errors as for :func:`constant_delay`.

    Parameters
    ----------
    signals : sequence of Signal
        Signals to send, in any units.
    name : str, optional

    Examples
    --------
    >>> import hovercontrol as hc
    >>> k06_uplink([hc.Signal("thrust")]).period
    0.02
    """
    return constant_delay(signals, 0.04, 0.02, name=name)
