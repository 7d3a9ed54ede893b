"""Messages in transit: a shift register with values, time of sending and time of arrival.

A new message enters at the first place and the others move on. The receiver knows the sequence numbers: it
shows the newest message that has arrived, and discards a message that arrives after a newer one. All times
are whole numbers of ticks, so there is no rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import fixed
from hovercontrol.blocks.expressions import Definitions
from hovercontrol.blocks.signals import Signal

#: When what never arrives would arrive [ticks]: later than any run lasts.
NEVER = 2**50


def received(signal: Signal, suffix: str) -> Signal:
    """Return a signal under its name after the link."""
    return signal.replace(
        name=signal.name + suffix, description=f"{signal.description or signal.name}, received"
    )


@dataclass
class Transmission:
    """Fate of the message sent at a tick: delay and loss.

    Parameters
    ----------
    wait : sympy.Expr
        Ticks to arrival, not negative.
    longest : int
        Upper bound of `wait`.
    lost : sympy Boolean, optional
        Condition under which the message is lost.
    states, following, definitions, parameters
        Parts of the Block on which `wait` and `lost` depend.
    """

    wait: sp.Expr
    longest: int
    lost: sp.logic.boolalg.Boolean = sp.false
    states: list[Signal] = field(default_factory=list)
    following: dict[str, sp.Expr] = field(default_factory=dict)
    definitions: dict[str, sp.Expr] = field(default_factory=dict)
    parameters: list[Signal] = field(default_factory=list)


class MessageLink:
    """States, definitions and outputs of a link during its construction.

    Parameters
    ----------
    name : str
        Name of the Block and prefix of its names.
    every : fractions.Fraction
        Ticks from message to message, at least 1.
    gate : Signal, optional
        Input that enables sending while it is positive.
    """

    def __init__(
        self, name: str, every: Fraction, transmission: Transmission, gate: Signal | None = None
    ) -> None:
        self.name, self.every, self.gate = name, every, gate
        self.states, self.following = list(transmission.states), dict(transmission.following)
        self.definitions, self.wait = Definitions(transmission.definitions), transmission.wait
        self.lost, self.longest = transmission.lost, transmission.longest
        self.order = Signal("in_order", "1", "1: a message waits for the one before it", lower=0.0, upper=1.0)
        self.parameters = [*transmission.parameters, self.order]
        self.now = self._state("ticks", "number of ticks")
        self.following[self.now.name] = self.now + 1
        # Exact for any two periods: counted in fractions of a tick that divide both.
        due = self._state("due", "time to the next message, in ticks")
        self.sending = due <= 0 if gate is None else sp.And(due <= 0, gate.symbol > 0)
        again = sp.Piecewise((every.numerator, due <= 0), (0, True))
        self.following[due.name] = due - every.denominator + again

    def _state(self, key: str, description: str, start: float = 0.0) -> sp.Symbol:
        signal = Signal(f"{self.name}_{key}", "1", description, start=start)
        self.states.append(signal)
        return signal.symbol

    def count(self, key: str, description: str, more: sp.Expr) -> Signal:
        """Return a counter, including this tick."""
        before = self._state(f"{key}_before", f"{description}, at the last tick")
        self.following[before.name] = self.definitions(f"{self.name}_{key}", before + more)
        return Signal(f"{self.name}_{key}", "1", description)

    def arrival(self) -> sp.Expr:
        """Return the tick of arrival of the message sent now."""
        latest = self._state("latest", "latest tick of arrival of the messages sent")
        soonest = sp.Max(self.now + self.wait, self.order.symbol * latest)
        tick = self.definitions(f"{self.name}_arrival", soonest)
        goes = sp.And(self.sending, sp.Not(self.lost))
        self.following[latest.name] = sp.Piecewise((sp.Max(tick, latest), goes), (latest, True))
        return sp.Piecewise((NEVER, self.lost), (tick, True))

    def register(self, signal: Signal, entering: sp.Expr) -> list[sp.Symbol]:
        """Return one field of all messages in transit, newest first, including the one sent now."""
        # The message k places on is floor(k every) ticks old or more; none that may still arrive falls out.
        count = math.ceil((self.longest + 1) / self.every)
        places = [signal.replace(name=f"{signal.name}_place{k}") for k in range(count)]
        self.states += places
        line = []
        for before, place in zip([entering, *(p.symbol for p in places)], places, strict=False):
            moved = sp.Piecewise((before, self.sending), (place.symbol, True))
            line.append(self.definitions(f"{place.name}_now", moved))
            self.following[place.name] = line[-1]
        return line

    def newest(self, signal: Signal, line: Sequence[sp.Symbol], arrived: Sequence[sp.Expr]) -> sp.Symbol:
        """Return the newest arrived value, else the last output; `signal` at the start."""
        held = signal.replace(name=f"{signal.name}_held")
        self.states.append(held)
        chain = (*zip(line, arrived, strict=True), (held.symbol, True))
        self.following[held.name] = self.definitions(f"{signal.name}_shown", sp.Piecewise(*chain))
        return self.following[held.name]

    def block(self, signals: Sequence[Signal], suffix: str, tick: float) -> Block:
        """Return the Block: the register, the receiver and their counters."""
        never = Signal(f"{self.name}_arrival", "1", "tick of arrival", start=NEVER)
        first = Signal(f"{self.name}_sent", "1", "tick of sending", start=-1.0)
        arrivals, sent = self.register(never, self.arrival()), self.register(first, self.now)
        arrived = [at <= self.now for at in arrivals]
        shown = self.newest(first, sent, arrived)
        outputs, told = [], {}
        for s in signals:
            outputs.append(received(s, suffix))
            told[s.name + suffix] = self.newest(s, self.register(s, s.symbol), arrived)
        step = fixed("tick", tick, "time between ticks")
        age = Signal(f"{self.name}_age", "s", "age of the received message")
        told[age.name] = (self.now - sp.Max(shown, 0)) * step.symbol
        fresh = sp.Piecewise((1, shown > sp.Symbol(f"{first.name}_held", real=True)), (0, True))
        come = sp.Add(*(sp.Piecewise((1, sp.Eq(at, self.now)), (0, True)) for at in arrivals))
        one = sp.Piecewise((1, self.sending), (0, True))
        gone = sp.Piecewise((1, sp.And(self.sending, self.lost)), (0, True))
        counters = [
            self.count("messages", "messages sent", one),
            self.count("delivered", "messages received", fresh),
            self.count("stale", "messages discarded after a newer one", come - fresh),
            self.count("lost", "messages lost after the last retransmission", gone),
        ]
        return Block(
            self.name,
            states=tuple(self.states),
            inputs=(*signals, *([self.gate] if self.gate else [])),
            outputs=(*outputs, age, *counters),
            parameters=(*self.parameters, step),
            derivatives=self.following,
            output_expressions=told,
            definitions=self.definitions,
            period=tick,
        )
