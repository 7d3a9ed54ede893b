"""Wireless links: messages with random delays, which may overtake each other and get lost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative, number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import passed_through
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.links.csma import Csma
from hovercontrol.craft.hardware.links.distributions import Delays
from hovercontrol.craft.hardware.links.messages import (
    MessageLink,
    Transmission,
)

#: K06's base tick [s].
TICK = 0.001


@checked
def empirical_delay(
    signals: Sequence[Signal],
    delays: Delays | float,
    period: float,
    *,
    access: Csma | None = None,
    tick: float = TICK,
    seed: int = 1,
    suffix: str = "_received",
    name: str = "link",
) -> Block:
    """Return a link with a random delay for each message.

    Parameters
    ----------
    signals : sequence of Signal
        Content of each message.
    delays : Delays or float
        Distribution of the delays, for example
        :func:`~hovercontrol.craft.hardware.links.table_5_1.bluetooth_delays`, or one constant delay [s].
        Delays are rounded to whole ticks, as K06's are to milliseconds.
    period : float
        Time between two messages [s]: the inputs are sent at the first tick at or after each multiple.
    access : Csma, optional
        Waiting time for a shared medium before the delay begins; messages given up are lost.
    tick : float, optional
        Period of the receiver and of the Block [s].
    seed : int, optional
        Start value of the parameter ``seed``. Links with different names draw different numbers.
    suffix : str, optional
        Suffix of the outputs' names.
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs `signals`. Outputs: the same with the suffix, from the newest message that has arrived
        (start values before the first), its age ``<name>_age`` [s], and the counters ``<name>_messages``
        (sent), ``<name>_delivered``, ``<name>_stale`` (discarded after a newer one) and ``<name>_lost``. The
        remaining messages are in transit.

        Parameters: ``delay_scale`` (0: no delay, 1: all), ``in_order`` (1: the link keeps the order, as a
        serial line over Bluetooth does; a message waits for its predecessor) and, where delays differ,
        ``jitter`` (0: all delays are the mean) and ``seed``; of the medium access ``busy``.

    Raises
    ------
    InputError
        If a delay is negative, the period or tick not positive, the period shorter than the tick, or there
        are no signals or two of one name.

    Examples
    --------
    >>> from hovercontrol.craft.hardware.links import bluetooth_delays
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> uplink = empirical_delay([Signal("thrust", "N")], bluetooth_delays("linksys_22.0_uplink"), 0.02)
    >>> run = Ticking(uplink)
    >>> seen = [run.tick(0.001 * k, {"thrust": 3.0}) for k in range(200)]
    >>> 0.022 <= 0.001 * [row["thrust_received"] for row in seen].index(3.0) <= 0.09
    True
    """
    return _link(name, signals, delays, period, tick, suffix, seed, access=access)


@checked
def lossy_link(
    signals: Sequence[Signal],
    loss: float,
    period: float,
    *,
    retransmissions: int = 0,
    timeout: float = 0.0,
    delays: Delays | float = 0.0,
    access: Csma | None = None,
    gate: Signal | None = None,
    tick: float = TICK,
    seed: int = 1,
    suffix: str = "_received",
    name: str = "link",
) -> Block:
    """Return a link whose transmissions are lost with a given probability and repeated.

    K06 5.3.2-5.3.3: a corrupted packet is sent again until it arrives or is given up.

    Parameters
    ----------
    signals, delays, period, access, tick, seed, suffix, name
        As for :func:`empirical_delay`; without `delays` messages arrive at once.
    loss : float
        Probability that a transmission is lost, 0 to below 1.
    retransmissions : int, optional
        Largest number of retransmissions of a message; then it is given up.
    timeout : float, optional
        Time from a lost transmission to the next [s]; positive if there are retransmissions.
    gate : Signal, optional
        Input that switches the sender on (1) or off (0); messages due while it is off are not sent. K06's "TX
        Enb" (K06 figure 5.2).

    Returns
    -------
    Block
        As of :func:`empirical_delay`, with the further parameter ``loss``. A message that will be given up
        counts as lost when it is first sent.

    Raises
    ------
    InputError
        As for :func:`empirical_delay`, and if `loss` is not in [0, 1), `retransmissions` is not a whole
        number from 0 on, or the timeout is negative, or zero with retransmissions.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> link = Ticking(lossy_link([Signal("y")], 0.5, 0.02, retransmissions=2, timeout=0.005))
    >>> last = [link.tick(0.001 * k, {"y": 1.0}) for k in range(1000)][-1]
    >>> int(last["link_messages"]), int(last["link_delivered"] + last["link_lost"])
    (50, 50)
    """
    if not 0 <= number(f"{name}: loss", loss) < 1:
        raise InputError(f"{name}: loss must be a probability in [0, 1), found {loss!r}")
    if not (isinstance(retransmissions, int) and retransmissions >= 0):
        raise InputError(
            f"{name}: retransmissions must be a whole number from 0 on, found {retransmissions!r}"
        )
    if not_negative(f"{name}: timeout", timeout) == 0 and retransmissions:
        raise InputError(f"{name}: with retransmissions, timeout must be positive, found {timeout!r}")
    repeat = (float(loss), retransmissions, float(timeout))
    return _link(name, signals, delays, period, tick, suffix, seed, repeat, gate, access)


def _link(
    name: str,
    signals: Sequence[Signal],
    delays: Delays | float,
    period: float,
    tick: float,
    suffix: str,
    seed: int,
    repeat: tuple[float, int, float] | None = None,
    gate: Signal | None = None,
    access: Csma | None = None,
) -> Block:
    signals = passed_through(name, signals, suffix)
    positive(f"{name}: period", period)
    positive(f"{name}: tick", tick)
    every = Fraction(str(period)) / Fraction(str(tick))
    if every < 1:
        raise InputError(f"{name}: period {period:g} s must not be shorter than the tick, {tick:g} s")
    transmission = _transmission(name, delays, tick, seed, repeat, access)
    return MessageLink(name, every, transmission, gate).block(signals, suffix, tick)


def _transmission(
    name: str,
    delays: Delays | float,
    tick: float,
    seed: int,
    repeat: tuple[float, int, float] | None,
    access: Csma | None,
) -> Transmission:
    """Return the delay of a message, and whether it is lost."""
    scale = Signal("delay_scale", "1", "factor of the delays; 0: no delay", start=1.0, lower=0.0, upper=1.0)
    parameters, drawn = [scale], repeat is not None or access is not None
    differ, waits = isinstance(delays, Delays), 2 * access.attempts if access else 0
    noise = random_numbers(1 + differ + waits, salt=name, kind="uniform", seed=seed)
    if isinstance(delays, Delays):
        jitter = Signal(
            "jitter",
            "1",
            "factor of the spread about the mean; 0: constant delay",
            start=1.0,
            lower=0.0,
            upper=1.0,
        )
        parameters.append(jitter)
        seconds = delays.mean + jitter.symbol * (delays.quantile(noise.values[1]) - delays.mean)
        longest, drawn = delays.most, True
    else:
        seconds = longest = not_negative(f"{name}: delay (or a distribution of delays)", delays)
    lost: list[sp.Basic] = []
    if access is not None:
        use = Signal("busy", "1", "probability that the medium is in use", access.busy, lower=0.0, upper=1.0)
        parameters.append(use)
        waited, given_up = access.drawn(noise.values[-waits:], use)
        seconds, longest = seconds + waited, longest + access.most
        lost.append(given_up)
    seconds = scale.symbol * seconds
    if repeat is not None:
        probability, retransmissions, timeout = repeat
        p = Signal("loss", "1", "probability that a transmission is lost", probability, lower=0.0, upper=1.0)
        parameters.append(p)
        # As many transmissions fail as powers of the probability exceed the number drawn.
        fails = [noise.values[0] < p.symbol**k for k in range(1, retransmissions + 2)]
        seconds += timeout * sp.Add(*(sp.Piecewise((1, f), (0, True)) for f in fails[:-1]))
        longest += timeout * retransmissions
        lost.append(fails[-1])
    wait = sp.Symbol(f"{name}_wait", real=True)
    most = math.floor(longest / tick + 0.5 + 1e-6)  # rounded, it may not come out less than the wait itself
    found = Transmission(wait, most, sp.Or(*lost), parameters=parameters)
    if drawn:
        found.states, found.following = list(noise.states), dict(noise.next_values)
        found.definitions, found.parameters = dict(noise.definitions), [*parameters, *noise.parameters]
    found.definitions[wait.name] = sp.floor(seconds / tick + sp.Rational(1, 2))
    return found
